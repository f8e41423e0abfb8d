"""The example on real recordings: its session from logs or from the public CSV, and what the stages make of it."""


import numpy as np
import pytest

from examples.asl_trunk.session import COLUMNS, make_loaded_session, make_session, read_releases
from tests.support.folders import SHARED, with_recordings
from trunkline.errors import InputError
from trunkline.recordings.cleaning.checks import TrialLimits
from trunkline.recordings.cleaning.loading import load_raw_trials
from trunkline.recordings.session.session import read_session

LIMITS = TrialLimits(0.5, 0.3, 0.1, 1.0)


def rows(trajectories: int = 13, frames: int = 90) -> str:
    """A CSV like the public one: `trajectories` swings of three discs."""
    lines, time = [",".join(COLUMNS)], np.arange(frames) / 100
    for number in range(trajectories):
        for swing in 0.1 * np.cos(8 * time + number):
            discs = [(0.1 + share * swing, -0.107 * disc, 0.105) for disc, share in ((1, 0.2), (2, 0.5), (3, 1.0))]
            lines.append(",".join([str(number), *(repr(float(value)) for disc in discs for value in disc)]))
    return "\n".join(lines) + "\n"


@pytest.fixture
def public(tmp_path):
    path = tmp_path / "observations_manual_decay_200g.csv"
    path.write_text(rows())
    return path


def test_the_public_csv_becomes_a_session_that_ingest_reads(public, tmp_path):
    folder = tmp_path / "session"
    assert make_session(public, folder) == 13
    session = read_session(folder)
    assert [trial.split for trial in session.trials] == ["identify", "identify", "test"] * 3 + ["validate"] * 4
    positions = read_releases(public)
    for number, (_, raw, findings) in enumerate(load_raw_trials(folder, session, LIMITS)):
        assert (raw.markers, raw.tendons, raw.quaternions) == (("1", "2", "3"), (), None)
        np.testing.assert_array_equal(raw.positions, positions[number][: len(raw.time)])  # to the last bit
        np.testing.assert_allclose(np.diff(raw.time), 0.01)
        assert not findings.repairs


def test_a_folder_of_logs_is_taken_as_it_is(public, tmp_path):
    make_session(public, tmp_path / "first")
    assert make_session(tmp_path / "first", tmp_path / "second") == 13
    for log in (tmp_path / "first").iterdir():
        assert (tmp_path / "second" / log.name).read_bytes() == log.read_bytes()


def test_releases_with_another_load_are_a_session_of_their_own(public, tmp_path):
    folder = tmp_path / "session"
    assert make_loaded_session(public, 0.1, folder) == 13
    make_session(public, tmp_path / "first")
    session, first = read_session(folder), read_session(tmp_path / "first")
    assert (session.frame, session.base) == (first.frame, first.base)
    assert {(trial.experiment, trial.split, trial.load) for trial in session.trials} == {("release", "test", 0.1)}
    positions = read_releases(public)
    for number, (_, raw, _) in enumerate(load_raw_trials(folder, session, LIMITS)):
        np.testing.assert_array_equal(raw.positions, positions[number][: len(raw.time)])


@pytest.mark.parametrize(
    ("change", "message"),
    [
        (lambda text: text.replace("x1", "a1"), "row 1: found ID, a1"),
        (lambda text: text.replace("\n0,", "\n0,x", 1), "row 2: could not convert"),
        (lambda text: text.replace("\n0,", "\n0,1.0,", 1), "row 2: found 11 cells, expected 10"),
        (lambda text: "", "row 1: found nothing"),
    ],
)
def test_another_csv_is_refused(public, tmp_path, change, message):
    public.write_text(change(public.read_text()))
    with pytest.raises(InputError, match=message):
        make_session(public, tmp_path / "session")
    assert not (tmp_path / "session").exists()


def test_a_source_that_is_not_there_is_refused(tmp_path):
    with pytest.raises(InputError, match=r"found no release_200g_\*.mcap"):
        make_session(tmp_path, tmp_path / "session")
    with pytest.raises(InputError, match=r"nothing\.csv: no such file or directory, expected a CSV file"):
        make_session(tmp_path / "nothing.csv", tmp_path / "session")


@pytest.fixture(scope="module")
def recorded(tmp_path_factory):
    """The real recordings."""
    folder = tmp_path_factory.mktemp("asl") / "session"
    make_session(SHARED / "asl_trunk", folder)
    return folder


@with_recordings
def test_the_csv_gives_the_very_logs_that_are_shared(recorded, tmp_path):
    session = read_session(recorded)
    lines = [",".join(COLUMNS)]
    for number, log in enumerate(sorted(recorded.glob("*.mcap"))):
        session.trials = [type(session.trials[0])(file=log.name, experiment="release", split="identify")]
        [(_, raw, _)] = load_raw_trials(recorded, session, LIMITS)
        lines += [",".join([str(number), *map(repr, frame)]) for frame in raw.positions.reshape(-1, 9).tolist()]
    (tmp_path / "public.csv").write_text("\n".join(lines) + "\n")
    make_session(tmp_path / "public.csv", tmp_path / "session")
    for log in recorded.glob("*.mcap"):
        assert (tmp_path / "session" / log.name).read_bytes() == log.read_bytes()


@with_recordings
def test_frames_that_the_recorder_lost_are_found_in_two_logs_of_thirteen(recorded):
    repairs = {
        raw.name: findings.repairs for _, raw, findings in load_raw_trials(recorded, read_session(recorded), LIMITS)
    }
    assert len(repairs) == 13
    repaired = {name: lines for name, lines in repairs.items() if lines}
    assert set(repaired) == {"release_200g_09", "release_200g_10"}
    assert repaired["release_200g_09"][0].startswith("21 frames lost at 1.31, 1.35, 1.39, 1.46, 1.49, 1.54 s")
    assert repaired["release_200g_10"][0].startswith("1 frame lost at 1.13 s")
