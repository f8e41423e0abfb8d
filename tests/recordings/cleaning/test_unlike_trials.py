"""Trials of one session that are not alike, and bodies that a driver puts somewhere while it does not see them."""

from dataclasses import replace

import numpy as np
import pytest
from scipy.spatial.transform import Rotation

from tests.recordings.cleaning.test_described_arm import ARM, FREE, checked, quiet
from tests.recordings.cleaning.test_loading import PER_FRAME, edit_session, one_trial, taken
from tests.recordings.cleaning.test_motors import curl
from tests.recordings.logs.test_other_loggers import rewritten
from tests.support.folders import ROOT
from tests.support.sessions import motion_truth, record
from trunkline.errors import InputError
from trunkline.frames import rotation_from_wxyz
from trunkline.recordings.logs.samples import PoseSamples
from trunkline.recordings.preparation.survey import describe, survey
from trunkline.recordings.session.session import read_session
from trunkline.recordings.session.source import open_log
from trunkline.tools.monitor.loading import load_logs

TURN = Rotation.from_euler("x", 90, degrees=True)


def with_one_changed(folder, change):
    """The session of `FREE`, with its last trial's truth through `change`."""
    record(folder, [*FREE[:-1], change(FREE[-1])], replace(quiet(), up=(0.0, 0.0, 1.0)))
    return checked(folder)


def sideways(truth):
    """Its base's place 60 mm aside in the base's own axes."""
    aside = rotation_from_wxyz(truth.base_quaternion).apply([0.0, 0.06, 0.0])
    return replace(truth, base_position=truth.base_position + aside)


def positions_turned(truth):
    positions = TURN.apply(truth.positions.reshape(-1, 3)).reshape(truth.positions.shape)
    return replace(truth, positions=positions, base_position=TURN.apply(truth.base_position))


@pytest.mark.parametrize("change", [sideways, positions_turned])
def test_a_trial_whose_base_is_another_is_refused_alone(tmp_path, change):
    gathered = with_one_changed(tmp_path, change)
    (reason,) = gathered.refused.values()
    assert "base: in the axes of 'base', 'unit_02' is " in reason
    assert "expected one choice of the base's axes and place in a session" in reason
    assert len(gathered.raw_trials) == len(FREE) - 1


def test_a_trial_in_a_frame_of_another_name_is_refused_with_what_to_do(tmp_path):
    record(tmp_path, FREE, replace(quiet(), up=(0.0, 0.0, 1.0)))
    rewritten(tmp_path / f"{FREE[-1].name}.mcap", lambda data: data.replace(b"mocap\0", b"world\0", 1))
    (reason,) = checked(tmp_path).refused.values()
    assert "header.frame_id: found poses in the frame 'world', expected 'mocap' as in most trials" in reason
    assert "a session for each, with its own `frame.up`" in reason


@pytest.mark.parametrize(("scale", "doubtful"), [(1.0, False), (1.1, True), (0.8, True)])
def test_an_arm_of_another_size_than_described_is_said(tmp_path, scale, doubtful):
    record(tmp_path, FREE, replace(quiet(), up=(0.0, 0.0, 1.0)))
    arm = {name: place / scale for name, place in ARM.items()}
    warned = [any("times as far apart as on the arm" in line for line in record.warnings)
              for record in checked(tmp_path, arm).findings]  # fmt: skip
    assert set(warned) == {doubtful}


@pytest.mark.parametrize(
    ("place", "reason"),
    [
        (lambda m: m.positions[40:60, 0], "exactly at the place of another body"),
        (lambda m: np.full((20, 3), -3.0), "farther away than the arm reaches"),
        (lambda m: np.full((20, 3), 9999.0), "farther away than the arm reaches"),
    ],
)
def test_a_body_that_is_not_seen_is_nowhere(tmp_path, place, reason):
    def hide(m):
        m.positions[40:60, 4] = place(m)

    raw, findings = one_trial(tmp_path, hide)
    assert any(reason in line and "20 samples" in line and "(unit_08)" in line for line in findings.repairs)
    assert np.isnan(raw.positions[40:60, 3]).all()


def test_stamps_of_a_clock_that_ticks_too_seldom_are_refused(tmp_path):
    def coarse(m):
        m.stamps[:] = m.stamps // 100_000_000 * 100_000_000

    one_trial(tmp_path, coarse)
    for clock in ("stamp", "log"):
        edit_session(tmp_path, "clock: frame" if clock == "stamp" else "clock: stamp", f"clock: {clock}")
        ((raw, _),) = taken(tmp_path)
        assert isinstance(raw, InputError) == (clock == "stamp")
        if clock == "stamp":
            assert "different stamps of" in str(raw)


def test_stamps_in_another_unit_are_told_by_log_times(tmp_path):
    def slow(m):
        m.stamps[:] = m.stamps[0] + (m.stamps - m.stamps[0]) // 1000

    one_trial(tmp_path, slow)
    edit_session(tmp_path, "clock: frame", "clock: stamp")
    ((error, _),) = taken(tmp_path)
    assert "s pass by log times: are stamps in another unit? `clock: log` does without" in str(error)


def test_numbers_that_are_not_finite_are_of_motors_not_told(tmp_path):
    right, _ = curl(tmp_path)

    def untold(m):
        same = np.diff(m.commands, axis=0, prepend=np.nan) == 0
        m.commands[same] = np.nan

    raw, findings = curl(tmp_path, untold)
    commanded = np.stack([np.interp(right.command_time, raw.command_time, c) for c in raw.commands.T], axis=1)
    assert np.abs(commanded - right.commands).max() < 1e-3
    assert any("messages hold numbers that are not finite" in line for line in findings.repairs)


def test_a_few_jumps_to_and_fro_are_said(tmp_path):
    def jump(m):
        m.commands[[60, 90], 0] += 0.02

    raw, findings = curl(tmp_path, jump)
    assert not isinstance(raw, InputError)
    assert any("commands jump to and fro 2 times, by up to 2" in line for line in findings.warnings)


def test_a_motors_clock_that_jumps_is_said(tmp_path):
    def step(m):
        m.command_stamps[len(m.command_stamps) // 2 :] += 400_000_000

    _, findings = curl(tmp_path, step)
    (line,) = [line for line in findings.warnings if line.startswith("command stamps jump by")]
    assert "jump by +0.39" in line
    assert "against log times: expected a clock that runs evenly" in line


def test_commands_that_begin_after_the_motion_are_said(tmp_path):
    def late(m):
        first = len(m.commands) // 3
        return replace(m, **{key: getattr(m, key)[first:] for key in ("commands", "command_stamps", "command_logged")})

    for change, begin in ((lambda m: None, None), (late, "1.")):
        one_trial(tmp_path, change, motion_truth())
        warnings = [line for record in checked(tmp_path).findings for line in record.warnings]
        lines = [line for line in warnings if line.startswith("commands: the first comes")]
        assert bool(lines) == (begin is not None)
        assert begin is None or f"comes {begin}" in lines[0]


def test_positions_that_stand_for_commands_and_begin_after_the_motion_are_said(tmp_path):
    def late(m):
        first = len(m.tendon_positions) // 3
        some = {key: getattr(m, key)[first:] for key in ("tendon_positions", "tendon_stamps", "tendon_logged")}
        none = {key: getattr(m, key)[:0] for key in ("commands", "command_stamps", "command_logged")}
        return replace(m, **some, **none)

    one_trial(tmp_path, late, motion_truth())
    path = tmp_path / "session.yaml"
    path.write_text(path.read_text().replace("commands: /tendon_commands, ", ""))
    warnings = [line for record in checked(tmp_path).findings for line in record.warnings]
    (line,) = [line for line in warnings if "the first comes" in line]
    assert line.startswith("tendon positions: the first comes 1.")
    assert "no log tells what was wound before: expected one from before the motion" in line


def test_bodies_that_each_arrive_late_by_themselves_make_whole_frames():
    rng, frames, bodies = np.random.default_rng(0), 120, 5
    arrived = np.arange(frames)[:, None] * 20_000_000 + rng.exponential(6e6, (frames, bodies)).astype(np.int64)
    order = np.argsort(arrived, axis=None, kind="stable")
    stamps = 1_760_000_000_000_000_000 + arrived.ravel()[order]
    body = np.tile(np.arange(bodies), frames)[order]
    samples = PoseSamples(
        stamps, stamps, body.astype(str), np.full(len(body), ""), np.zeros((len(body), 3)), np.zeros((len(body), 4))
    )
    frame, first = samples.frames(body)
    assert len(first) <= frames * 1.02
    assert np.mean(np.bincount(frame) == bodies) > 0.95


def test_poses_published_again_with_the_other_sign_of_quaternions_count_once(tmp_path):
    def again(m):
        twice = {key: np.repeat(getattr(m, key), 2, axis=0) for key in PER_FRAME}
        twice["quaternions"][::2] *= -1
        later = np.tile([0, 4_166_666], len(m.stamps))
        return replace(m, **twice | {key: twice[key] + later for key in ("stamps", "logged")})

    right, _ = one_trial(tmp_path, lambda m: None)
    one_trial(tmp_path, again)
    edit_session(tmp_path, "clock: frame", "clock: stamp")
    ((raw, _),) = taken(tmp_path)
    assert len(raw.time) == len(right.time)


def test_monitored_logs_are_compared_with_the_arm(tmp_path):
    record(tmp_path, FREE, replace(quiet(), up=(0.0, 0.0, 1.0)))
    files = {f"{truth.name}.mcap" for truth in FREE}
    assert load_logs(tmp_path, files, ROOT, ARM).refused == {}
    longer = {name: 3 * place for name, place in ARM.items()}
    with pytest.raises(InputError, match=r"unit: bodies are 0.333 times as far apart as on the arm"):
        load_logs(tmp_path, files, ROOT, longer)


def test_inspect_counts_missing_frames_by_their_numbers_alone(tmp_path):
    def late(m):
        delays = np.random.default_rng(0).exponential(3e6, len(m.stamps)).astype(np.int64)
        m.stamps[:] = np.maximum.accumulate(m.stamps + delays)
        keep = np.arange(len(m.stamps)) % 50 != 49
        return replace(m, **{key: getattr(m, key)[keep] for key in PER_FRAME})

    one_trial(tmp_path, late)
    (log,) = tmp_path.glob("*.mcap")
    lost = int(np.sum(np.diff(open_log(log, read_session(tmp_path)).poses.frames) - 1))
    assert any(f"; {lost} frames missing in between;" in line for line in describe(survey(log)))
