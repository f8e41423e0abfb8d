"""The ASL Trunk's commanded motion: from the public CSV files to a session, and what is refused of them."""

from pathlib import Path

import numpy as np
import pytest

from examples.asl_motion.session import COMMANDS, LOADS, OBSERVED, make_session
from tests.support.folders import SHARED, with_recordings
from trunkline.errors import InputError
from trunkline.recordings.session.session import read_session
from trunkline.recordings.session.source import open_log

RECORDED = SHARED / "asl_trunk/actuated"
ROWS = 15_000


def write(path: Path, columns: tuple[str, ...], values: np.ndarray) -> None:
    rows = [",".join(columns), *(f"{number}," + ",".join(map(str, row)) for number, row in enumerate(values.tolist()))]
    path.write_text("\n".join(rows) + "\n")


@pytest.fixture(scope="module")
def source(tmp_path_factory):
    """As the public files: commands, and one row more of what was seen."""
    folder, rng = tmp_path_factory.mktemp("public"), np.random.default_rng(0)
    write(folder / "control_inputs_controlled_1.csv", COMMANDS, rng.normal(size=(ROWS, 6)).round(3))
    for file, _ in LOADS.values():
        write(folder / file, OBSERVED, rng.normal(size=(ROWS + 1, 15)).round(3))
    return folder


def test_each_recording_becomes_trials_of_25_s(source, tmp_path):
    assert make_session(source, tmp_path / "session") == 12
    session = read_session(tmp_path / "session")
    splits = [*["identify"] * 4, "validate", "test", "identify", *["test"] * 5]
    assert [trial.split for trial in session.trials] == splits
    assert {trial.load for trial in session.trials if trial.file == "loaded.mcap"} == {0.2}
    assert session.trials[4].window == (100.0, 124.99)
    names, coupling = session.coupling()
    assert len(names) == 12
    np.testing.assert_allclose(coupling.sum(axis=0), 0, atol=1e-12, err_msg="a motor pays out what it winds in")
    log = open_log(tmp_path / "session" / "unloaded.mcap", session)
    assert log.commands is not None
    assert len(log.poses.stamps) == len(log.commands.stamps) == ROWS
    sent = (source / "control_inputs_controlled_1.csv").read_text().splitlines()[8]
    assert log.commands.positions[7].tolist() == [float(cell) for cell in sent.split(",")[1:]]


def test_files_that_do_not_belong_together_are_refused(source, tmp_path):
    for file in source.iterdir():
        (tmp_path / file.name).write_text(file.read_text())
    recording = tmp_path / LOADS["loaded"][0]
    recording.write_text("\n".join(recording.read_text().splitlines()[:100]) + "\n")
    with pytest.raises(InputError, match=r"200g.csv: found 99 rows, expected the 15000 of .*control_inputs"):
        make_session(tmp_path, tmp_path / "session")
    assert not (tmp_path / "session").exists()
    with pytest.raises(InputError, match="no such file or directory, expected"):
        make_session(tmp_path / "nowhere", tmp_path / "session")


@with_recordings
def test_the_public_recordings_are_as_expected(tmp_path):
    assert make_session(RECORDED, tmp_path / "session") == 12
