"""Rows of a long study outlast its process, are of one arm and one code, and are never replaced."""

import csv
import subprocess
import sys
from dataclasses import replace

import pytest

from studies.rows import Rows, digest
from trunkline.errors import InputError
from upkeep.origin import Origin

ORIGIN = Origin("aaaaaaa", "2026-01-01", {"trunkline/model/arm": "0123"})
OTHER = Origin("bbbbbbb", "2026-01-02", {"trunkline/model/arm": "3210"})
SAME = replace(OTHER, code=ORIGIN.code)  # a later commit that changed nothing that the study goes through


def table(folder, origin=ORIGIN, made_of="arm"):
    return Rows("study", made_of, "session", folder, origin)


def written(folder):
    with (folder / "study.csv").open(newline="") as file:
        return list(csv.DictReader(file))


def test_rows_come_back_in_their_order_with_their_types(tmp_path):
    rows = table(tmp_path)
    assert rows.read() == {}
    rows.add("clean", error=0.1 + 0.2, said="", off=float("nan"), done=True)
    rows.add("7", error=2.0, said='"a", b; c', off=1.5, done=False)
    read = table(tmp_path).read()
    assert list(read) == ["clean", "7"]
    assert read["clean"]["error"] == 0.1 + 0.2
    assert [row["said"] for row in read.values()] == ["", '"a", b; c']
    assert [row["done"] for row in read.values()] == [True, False]
    assert read["clean"]["off"] != read["clean"]["off"]
    assert read["7"]["off"] == 1.5
    assert [file.name for file in tmp_path.iterdir()] == ["study.csv"]
    assert rows.attempts() == ""


def test_a_row_says_of_which_code_it_is(tmp_path):
    table(tmp_path).add("0", error=1.0)
    (row,) = written(tmp_path)
    assert (row["commit"], row["code"], row["made_of"], row["attempt"]) == ("aaaaaaa", ORIGIN.digest, "arm", "1")
    assert len({ORIGIN.digest, OTHER.digest}) == 2
    assert SAME.digest == ORIGIN.digest


@pytest.mark.parametrize("other", [{"origin": OTHER}, {"made_of": "another arm"}])
def test_rows_of_other_code_or_of_another_arm_are_neither_taken_nor_deleted(tmp_path, other):
    table(tmp_path).add("0", error=1.0)
    rows = table(tmp_path, **other)
    assert rows.read() == {}, "a study that resumes makes it again"
    rows.add("0", error=2.0)
    assert rows.read()["0"]["error"] == 2.0
    assert table(tmp_path).read()["0"]["error"] == 1.0
    assert [(row["error"], row["attempt"]) for row in written(tmp_path)] == [("1.0", "1"), ("2.0", "2")]
    line = "1 rows, and 1 rows of other code or settings, which do not count (commits aaaaaaa)"
    assert rows.attempts() == line


def test_a_later_commit_of_the_same_code_goes_on(tmp_path):
    table(tmp_path).add("0", error=1.0)
    rows = table(tmp_path, SAME)
    rows.add("1", error=2.0)
    assert list(rows.read()) == ["0", "1"]
    assert rows.attempts() == ""


def test_of_several_attempts_the_first_counts_and_the_others_are_told(tmp_path):
    rows = table(tmp_path)
    for error in (3.0, 1.0, 2.0):
        rows.add("0", error=error)
    rows.add("1", error=4.0)
    assert [row["error"] for row in rows.read().values()] == [3.0, 4.0]
    assert [row["attempt"] for row in written(tmp_path)] == ["1", "2", "3", "1"]
    assert [row["error"] for row in rows.uncounted()] == ["1.0", "2.0"]
    assert rows.attempts() == "2 rows, and 2 further attempts, which do not count"


def test_older_rows_that_name_no_code_stay_as_they_were_written(tmp_path):
    text = "session,error,made_of,commit\n0,0.10,arm,aaaaaaa with changes\n"
    (tmp_path / "study.csv").write_text(text)
    rows = table(tmp_path)
    assert rows.read() == {}
    rows.add("0", error=2.0, tip=1.0)
    old, new = written(tmp_path)
    assert (old["error"], old["commit"], old["code"], old["tip"]) == ("0.10", "aaaaaaa with changes", "", "")
    assert new["attempt"] == "2"
    assert rows.read()["0"]["tip"] == 1.0, "and its types are its own"
    assert "(commits aaaaaaa with changes)" in rows.attempts()


def test_a_study_with_changes_is_refused_before_its_first_row(tmp_path, monkeypatch):
    monkeypatch.chdir(tmp_path)
    monkeypatch.setattr(sys, "orig_argv", ["python", "-m", "studies.some"])
    (tmp_path / "studies").mkdir()
    (tmp_path / "studies/some.py").write_text("STEPS = 1\n")
    git = ["git", "-c", "user.name=test", "-c", "user.email=test@localhost"]
    for words in (["init", "-q"], ["add", "-A"], ["commit", "-qm", "code"]):
        subprocess.run([*git, *words], check=True)
    Rows("study", "arm", "session").add("0", error=1.0)
    assert list(Rows("study", "arm", "session").read()) == ["0"], "its own rows are no changes"
    (tmp_path / "studies/some.py").write_text("STEPS = 2\n")
    with pytest.raises(InputError, match=r"^studies/some.py: found changes, expected them committed.*\Z"):
        Rows("study", "arm", "session")


def test_a_digest_knows_settings_and_files_of_folders(tmp_path):
    (tmp_path / "trials").mkdir()
    (tmp_path / "trials/one").write_bytes(b"1")
    before = digest(["a"], tmp_path)
    assert digest(["a"], tmp_path) == before
    assert digest(["b"], tmp_path) != before
    (tmp_path / "trials/one").write_bytes(b"2")
    assert digest(["a"], tmp_path) != before
