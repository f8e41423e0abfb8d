"""Trials that share data: refused across splits, said within one."""

import os
import shutil

import pytest

from trunkline.errors import InputError
from trunkline.recordings.session.session import read_session


def session(folder, *trials):
    """The session of `trials`, (file, split, window or None); each file that is not there yet has bytes of its own."""
    lines = []
    for number, (file, split, window) in enumerate(trials):
        if not (folder / file).exists():
            (folder / file).write_bytes(bytes([number]) * 1000)
        inside = "" if window is None else f", window: {list(window)}"
        lines.append(f"  - {{name: t{number}, file: {file}, experiment: release, split: {split}{inside}}}\n")
    (folder / "session.yaml").write_text("frame: {up: [0, 0, 1]}\nbase: base\ntrials:\n" + "".join(lines))
    return read_session(folder)


def test_files_and_windows_of_their_own_are_fine(tmp_path):
    read = session(
        tmp_path,
        ("a.mcap", "identify", (0, 5)),
        ("a.mcap", "validate", (5, 10)),
        ("b.mcap", "validate", None),
        ("c.mcap", "identify", None),
    )
    assert read.shared == {}


def test_empty_logs_are_not_one_recording(tmp_path):
    for name in ("a.mcap", "b.mcap"):
        (tmp_path / name).touch()
    assert session(tmp_path, ("a.mcap", "identify", None), ("b.mcap", "validate", None)).shared == {}


@pytest.mark.parametrize("same", [shutil.copy, os.link, lambda source, other: other.symlink_to(source)])
def test_one_file_under_two_names_in_two_splits_is_refused(tmp_path, same):
    (tmp_path / "a.mcap").write_bytes(b"log" * 500)
    same(tmp_path / "a.mcap", tmp_path / "b.mcap")
    with pytest.raises(InputError, match=r"trials.1: trials t0 and t1 share data: a.mcap and b.mcap, which hold"):
        session(tmp_path, ("a.mcap", "identify", None), ("b.mcap", "validate", None))
    read = session(tmp_path, ("a.mcap", "identify", None), ("b.mcap", "identify", None))
    assert list(read.shared) == ["t0", "t1"]
    assert "counts twice in the split identify" in read.shared["t1"][0]


@pytest.mark.parametrize("windows", [((0, 5), (4.9, 10)), ((0, 10), (2, 3)), ((0, 5), None), (None, None)])
def test_overlapping_windows_are_refused_across_splits_and_said_within_one(tmp_path, windows):
    with pytest.raises(InputError, match=r"t0 and t1 share data: one file.*t0 is of the split identify, t1 of val"):
        session(tmp_path, ("a.mcap", "identify", windows[0]), ("a.mcap", "validate", windows[1]))
    read = session(tmp_path, ("a.mcap", "validate", windows[0]), ("a.mcap", "validate", windows[1]))
    assert list(read.shared) == ["t0", "t1"]
