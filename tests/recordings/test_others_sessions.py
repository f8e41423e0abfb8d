"""Sessions as others record them, each with one fault: what becomes of it is right, or a line that says what it is."""

import numpy as np
import pytest

from tests.support.folders import CASES, with_cases
from tests.support.sessions import LIMITS, PLAUSIBLE
from trunkline.errors import InputError
from trunkline.model.places import marker_places
from trunkline.model_files import read_spec
from trunkline.recordings.cleaning.loading import load_raw_trials
from trunkline.recordings.cleaning.session_checks import CheckedSession, check_session
from trunkline.recordings.preparation.inspect import main as inspect
from trunkline.recordings.preparation.motive import main as import_motive
from trunkline.recordings.session.session import read_session

pytestmark = with_cases


def checked(folder) -> CheckedSession:
    arm = marker_places(read_spec(CASES / "00-common/own_links.xml").compile())
    session = read_session(folder)
    return check_session(load_raw_trials(folder, session, LIMITS, arm), session, PLAUSIBLE, "leave_out", "here", arm)


@pytest.mark.parametrize("case", ["00-honest", "00-honest-steps"])
def test_honest_sessions_are_neither_refused_nor_repaired(case):
    gathered = checked(CASES / case / "session")
    assert gathered.refused == {}
    assert [line for record in gathered.findings for line in record.repairs if "frames lost" not in line] == []


@pytest.mark.parametrize(
    ("case", "message"),
    [
        ("05-one-topic-in-another-frame", r"frames 'mocap' \(.*/base/pose.*\), 'world' \(.*/hand/pose\), expected all"),
        ("42-base-topic-in-another-frame", r"header.frame_id: found poses in the frames 'world' \(.*/base/pose\)"),
        ("08-positions-turned-attitudes-not", r"attitudes: .* turning positions to \(x, z, -y\) or .* leaves 2 %"),
        ("09-left-handed", r"is the frame left-handed"),
    ],
)
def test_frames_that_contradict_each_other_are_refused_in_one_line(case, message):
    with pytest.raises(InputError, match=message):
        checked(CASES / case / "session")


def test_centimetres_are_taken_as_such():
    gathered = checked(CASES / "06-centimetres/session")
    assert "unit: bodies 20.99 apart are no arm in m, as declared; taken as cm" in gathered.findings[0].repairs
    raw = gathered.raw_trials[0]
    apart = np.linalg.norm(np.nanmedian(raw.positions[:, 0] - raw.base_positions, axis=0))
    assert (raw.markers[0], apart) == ("hand", pytest.approx(0.21, rel=0.02))


@pytest.mark.parametrize("case", ["34-proposed-levels-of-curls", "39-folder-per-bag"])
def test_a_proposal_is_taken_as_it_is(case, tmp_path, capsys):
    for log in (CASES / case / "session").rglob("*.mcap"):
        link = tmp_path / log.relative_to(CASES / case / "session")
        link.parent.mkdir(exist_ok=True)
        link.symlink_to(log)
    assert inspect([str(tmp_path)]) == 0
    text = capsys.readouterr().out.partition("Proposed session.yaml:\n")[2]
    (tmp_path / "session.yaml").write_text(text.replace("topics:", "tendons: {a: a, b: b, c: c}\ntopics:"))
    assert checked(tmp_path).refused == {}
    levels = [trial.level for trial in read_session(tmp_path).trials]
    assert levels == ([12, 10, 12, 0, 30, 45, 60] if case.startswith("34") else [0, 30, 45, 60])


def test_an_export_with_z_up_is_seen_by_how_the_arm_sags(tmp_path):
    assert import_motive(["--session", str(tmp_path), *map(str, sorted((CASES / "15-motive-z-up").glob("*.csv")))]) == 0
    session = read_session(tmp_path)
    assert session.frame.up == (0, 0, 1)
    assert [trial.level for trial in session.trials if trial.level is not None] == [0, 30, 45, 60]
    assert not any("up:" in line for record in checked(tmp_path).findings for line in record.warnings + record.repairs)
