"""Files are written whole or not at all, and known by their bytes."""

import hashlib

import pytest

from trunkline.files import file_digest, written_whole


def test_a_file_is_there_once_it_is_whole(tmp_path):
    path = tmp_path / "table.csv"
    path.write_text("old")
    with written_whole(path) as part:
        part.write_text("new")
        assert path.read_text() == "old"
    assert path.read_text() == "new"
    assert list(tmp_path.iterdir()) == [path]


def fail_half_way(path, error):
    with written_whole(path) as part:
        part.write_text("half")
        raise error


@pytest.mark.parametrize("error", [OSError, KeyboardInterrupt])
def test_what_fails_leaves_the_old_file_and_nothing_beside_it(tmp_path, error):
    path = tmp_path / "table.csv"
    path.write_text("old")
    with pytest.raises(error):
        fail_half_way(path, error)
    assert path.read_text() == "old"
    assert list(tmp_path.iterdir()) == [path]


def test_what_a_killed_process_left_is_not_gone_on_with(tmp_path):
    path = tmp_path / "table.csv"
    (tmp_path / ".table.csv.part").write_text("half")
    with written_whole(path) as part, part.open("a") as file:
        file.write("new")
    assert path.read_text() == "new"


def test_a_digest_is_that_of_the_bytes(tmp_path):
    (tmp_path / "log").write_bytes(b"poses")
    assert file_digest(tmp_path / "log") == hashlib.sha256(b"poses").hexdigest()
