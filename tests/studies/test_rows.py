"""Rows of a long study outlast its process, and are of one arm."""

import pytest

from studies.rows import Rows, digest, other_commits
from trunkline.errors import InputError


def test_rows_come_back_in_their_order_with_their_types(tmp_path):
    rows = Rows("study", "arm", "session", tmp_path)
    assert rows.read() == {}
    rows.add("clean", error=0.1 + 0.2, said="")
    rows.add("7", error=2.0, said='"a", b; c')
    found = Rows("study", "arm", "session", tmp_path).read()
    assert list(found) == ["clean", "7"]
    assert found["clean"]["error"] == 0.1 + 0.2
    assert [row["said"] for row in found.values()] == ["", '"a", b; c']
    assert [file.name for file in tmp_path.iterdir()] == ["study.csv"]


def test_rows_of_another_arm_are_refused(tmp_path):
    Rows("study", "arm", "session", tmp_path).add("0", error=1.0)
    with pytest.raises(InputError, match=r"study.csv: found rows of another arm.* \(arm\), expected other; delete"):
        Rows("study", "other", "session", tmp_path).read()


def test_a_digest_knows_settings_and_files_of_folders(tmp_path):
    (tmp_path / "trials").mkdir()
    (tmp_path / "trials/one").write_bytes(b"1")
    before = digest(["a"], tmp_path)
    assert digest(["a"], tmp_path) == before
    assert digest(["b"], tmp_path) != before
    (tmp_path / "trials/one").write_bytes(b"2")
    assert digest(["a"], tmp_path) != before


def test_rows_of_other_commits_are_named(monkeypatch):
    monkeypatch.setattr("studies.rows.commit_of", lambda root: "bbbbbbb")
    assert other_commits({"0": {"commit": "bbbbbbb"}}) == ""
    assert other_commits({str(i): {"commit": c} for i, c in enumerate(["aaaaaaa", "bbbbbbb", "aaaaaaa"])}) == (
        "rows made at commits aaaaaaa, bbbbbbb"
    )
