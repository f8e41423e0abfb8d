"""Sessions that another unit, frame or convention has spoilt: put right where it is proven, or refused in one line."""

from dataclasses import replace

import numpy as np
import pytest
import yaml
from scipy.spatial.transform import Rotation

from tests.support.sessions import (
    LIMITS,
    MARKERS,
    PLAUSIBLE,
    bent_truth,
    curl_truth,
    instruments,
    motion_truth,
    record,
    release_truth,
    static_truth,
)
from trunkline.errors import InputError
from trunkline.recordings.cleaning.loading import load_raw_trials
from trunkline.recordings.cleaning.session_checks import CheckedSession, check_session
from trunkline.recordings.session.session import read_session
from trunkline.recordings.signals.units import METRES_PER

ARM = {name: np.array([0.0, 0.0, -along]) for name, along in zip(MARKERS, (0.1, 0.2, 0.3, 0.4), strict=True)}
TILTS = [static_truth(tilt) for tilt in (0.0, 30.0, 60.0)]
FREE = [*TILTS, release_truth()]


def quiet():
    return instruments(occlusions_per_s=0, outliers=0, dropped_frames=0)


def checked(folder, arm=ARM) -> CheckedSession:
    session = read_session(folder)
    return check_session(load_raw_trials(folder, session, LIMITS, arm), session, PLAUSIBLE, "leave_out", "here", arm)


def spoilt(folder, change, truths=None):
    """A session whose poses (T, B, 3), (T, B, 4) wxyz went through `change`, as instruments wrote them."""
    record(folder, [changed(truth, change) for truth in truths or FREE], replace(quiet(), up=(0.0, 0.0, 1.0)))
    return folder


def changed(truth, change):
    """Truths are z-up in the world."""
    def pose(position, quaternion):
        return change(np.array(position, float), np.array(quaternion, float))

    base, turn = pose(truth.base_position, truth.base_quaternion)
    positions, quaternions = pose(truth.positions, truth.quaternions)
    return replace(truth, base_position=base, base_quaternion=turn, positions=positions, quaternions=quaternions)


@pytest.mark.parametrize("unit", METRES_PER)
@pytest.mark.parametrize("declared", ["m", "mm"])
def test_a_unit_is_taken_where_the_described_arm_proves_it(tmp_path, unit, declared):
    record(tmp_path, FREE, quiet())
    expected = checked(tmp_path).raw_trials[0].positions
    scale = 1 / METRES_PER[unit]
    spoilt_folder = spoilt(tmp_path / "spoilt", lambda p, q: (scale * p, q))
    path = spoilt_folder / "session.yaml"
    path.write_text(path.read_text().replace("unit: m", f"unit: {declared}"))
    gathered = checked(spoilt_folder)
    repairs = [repair for repair in gathered.findings[0].repairs if "taken as" in repair]
    assert [repair.endswith(f"taken as {unit}") for repair in repairs] == [True] * (unit != declared)
    size = np.nanmedian(np.linalg.norm(np.diff(gathered.raw_trials[0].positions[:, [0, -1]], axis=1), axis=-1))
    assert size == pytest.approx(np.nanmedian(np.linalg.norm(np.diff(expected[:, [0, -1]], axis=1), axis=-1)), rel=0.05)


def test_a_size_that_no_unit_explains_is_refused(tmp_path):
    with pytest.raises(InputError, match=r"unit: bodies are 4\.\d+ times as far apart .* expected 0.5 to 2 times: no"):
        checked(spoilt(tmp_path, lambda p, q: (4.2 * p, q)))


def test_one_body_in_another_frame_or_unit_is_named(tmp_path):
    def last_elsewhere(position, quaternion):
        if position.ndim == 3:
            position[:, -1] *= 100
        return position, quaternion

    with pytest.raises(InputError, match=r"'unit_08' is usually \d+ mm from 'unit_06', 100 mm on the described arm"):
        checked(spoilt(tmp_path, last_elsewhere))


@pytest.mark.parametrize(
    ("change", "remedy"),
    [
        (lambda p, q: (p[..., [0, 2, 1]] * [1, 1, -1], q), r"turning positions to"),
        (lambda p, q: (p * [1, 1, -1], q), r"turning positions to \(x, y, -z\)"),
        (lambda p, q: (p, q * [1, -1, -1, -1]), r"leaves \d %"),  # in one plane, axes exchanged do as well
        (lambda p, q: (p, np.roll(q, -1, axis=-1)), r"leaves \d %"),
    ],
)
def test_attitudes_that_contradict_positions_are_refused(tmp_path, change, remedy):
    with pytest.raises(InputError, match=r"attitudes: a body's way to its neighbour wanders .*" + remedy):
        checked(spoilt(tmp_path, change), None)


def mirrored(axis: int):
    """A change to a left-handed frame, quaternions likewise."""
    mirror = np.ones(3)
    mirror[axis] = -1
    return lambda p, q: (p * mirror, q * [1, *(-mirror)])


def test_a_left_handed_frame_is_refused(tmp_path):
    with pytest.raises(InputError, match="is the frame left-handed, or are its axes not the arm's"):
        checked(spoilt(tmp_path, mirrored(2)))


@pytest.mark.parametrize("axis", [0, 1])
def test_a_frame_that_is_mirrored_across_the_arm_gets_no_wrong_advice(tmp_path, axis):
    """Without tendons it is as good as another arm that hangs; with them, their sides tell
    (tests/identification/test_checks.py)."""
    gathered = checked(spoilt(tmp_path, mirrored(axis)))
    assert gathered.refused == {}
    assert said_of_up(gathered) == ""
    assert not any("attitudes" in line or "base" in line for each in gathered.findings for line in each.warnings)


def test_a_base_of_other_axes_is_refused(tmp_path):
    """As Motive chooses them where a body is made: along the frame's."""
    def other(truth):
        turn = Rotation.from_quat(truth.base_quaternion, scalar_first=True) * Rotation.from_euler("x", 90, degrees=True)
        return replace(truth, base_quaternion=turn.as_quat(scalar_first=True))

    record(tmp_path, [other(truth) for truth in FREE], quiet())
    with pytest.raises(InputError, match=r"'base': in its axes the arm leaves it .*are its axes not the arm's"):
        checked(tmp_path)


def test_a_base_that_one_trial_has_turned_about_the_arm_refuses_that_trial(tmp_path):
    turn = Rotation.from_euler("z", 90, degrees=True)
    truth = TILTS[1]
    base = Rotation.from_quat(truth.base_quaternion, scalar_first=True) * turn
    turned = replace(truth, base_quaternion=base.as_quat(scalar_first=True))
    record(tmp_path, [TILTS[0], turned, TILTS[2], release_truth()], quiet())
    gathered = checked(tmp_path)
    (reason,) = gathered.refused.values()
    assert "tilt_30" in reason
    assert "base: 'base' is turned about the arm by 9" in reason or "by 8" in reason


def test_honest_sessions_have_no_fault(tmp_path):
    """Nor is an arm that bends far, or to all sides, taken for one that is mirrored."""
    bent = bent_truth("pull_deep", "static_pull", None, "identify", 40.0, np.full(480, 2.0), np.full((480, 3), 0.04))
    record(tmp_path, [*FREE, curl_truth(60.0, "identify"), motion_truth(), bent], quiet())
    gathered = checked(tmp_path)
    assert gathered.refused == {}
    assert not any("unit" in line or "attitudes" in line for record_ in gathered.findings for line in record_.warnings)


def levelled(folder, up, levels) -> CheckedSession:
    """Tilts and a release in a z-up world, declared with another vertical and levels."""
    record(folder, FREE, replace(quiet(), up=(0.0, 0.0, 1.0)))
    path = folder / "session.yaml"
    content = yaml.safe_load(path.read_text())
    content["frame"]["up"] = up
    for trial, level in zip(content["trials"], levels, strict=False):
        trial["level"] = level
    path.write_text(yaml.safe_dump(content))
    return checked(folder)


def said_of_up(gathered: CheckedSession) -> str:
    return "; ".join({line for record_ in gathered.findings for line in record_.warnings + record_.repairs
                      if line.startswith("up:")})  # fmt: skip


def test_releases_are_looked_at_beside_levels_that_fit_a_wrong_vertical(tmp_path):
    """As where levels were computed with it."""
    base = Rotation.from_euler("z", 40, degrees=True)
    axes = [(base * Rotation.from_euler("y", tilt, degrees=True)).apply([0, 0, 1]) for tilt in (0, 30, 60)]
    levels = [float(np.degrees(np.arccos(axis[1]))) for axis in axes]
    assert "released arms come to rest 90° from hanging with [0, 1, 0]" in said_of_up(
        levelled(tmp_path, [0, 1, 0], levels)
    )
    assert said_of_up(levelled(tmp_path / "right", [0, 0, 1], [0, 30, 60])) == ""


def test_a_vertical_that_releases_exclude_is_not_taken(tmp_path):
    """Levels that are upside down prove nothing against an arm that hangs."""
    gathered = levelled(tmp_path, [0, 0, 1], [180, 150, 120])
    assert "levels would fit [0, 0, -1], along which released arms do not hang: check" in said_of_up(gathered)
    assert gathered.raw_trials[0].up.tolist() == [0, 0, 1]


def test_a_log_that_no_trial_is_of_is_said(tmp_path):
    record(tmp_path, FREE, quiet())
    path = tmp_path / "session.yaml"
    content = yaml.safe_load(path.read_text())
    content["trials"] = content["trials"][:-1]
    path.write_text(yaml.safe_dump(content))
    (line_,) = {line for record_ in checked(tmp_path).findings for line in record_.warnings if "logs:" in line}
    assert line_ == "logs: release_a.mcap in the folder, but in no trial of session.yaml: left out"
