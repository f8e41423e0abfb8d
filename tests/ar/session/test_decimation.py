"""A robot at rest is told of seldom, and what a log leaves out can be had from what it keeps."""

import numpy as np
import pytest

from tests.ar.session.written import SUBJECT, Written
from tests.ar.teleop.test_plan import START, STRAIGHT
from trunkline.ar.session.decimation import AFTER, BEFORE, SELDOM, STILL, LogDecimation
from trunkline.ar.session.log_format import JOINTS_SENT, POSES
from trunkline.ar.session.robot_process import RobotState
from trunkline.recordings.logs.joint_stream import joint_stream
from trunkline.recordings.logs.mcap_log import read_log

RATE, MOVES, STOPS, LASTS = 72.0, 20.0, 21.0, 60.0  # Hz, s
TIMES = np.arange(round(RATE * LASTS)) / RATE
NOTHING = np.full(7, np.nan)


def at(time, noise, speed):
    """It rests but for noise, moves at once at `speed`, m/s, and rests again."""
    poses = np.tile([0.0, 2.0, 3.0, 1.0, 0.0, 0.0, 0.0], (3, 1))
    poses[:, 0] = speed * np.clip(time - MOVES, 0.0, STOPS - MOVES)
    poses[0] = np.nan  # an object that is not there
    return RobotState(time, 0.0, START, STRAIGHT, NOTHING, poses + noise, NOTHING, None)


def moving_states(speed):
    noises = 1e-8 * np.random.default_rng(0).standard_normal((len(TIMES), 3, 7))
    return [at(time, noise, speed) for time, noise in zip(TIMES, noises, strict=True)]


def retained(robot_states):
    resting = LogDecimation()
    rows = [row for robot in robot_states for row in resting.take(robot, robot.time + 1.0)]
    return rows + resting.rest()


@pytest.mark.parametrize("speed", [0.5, 2e-3, 1e-3, 2e-4])
def test_what_is_left_out_lies_between_what_is_kept(speed):
    robot_states = moving_states(speed)
    rows = retained(robot_states)
    times = np.array([robot.time for robot, _ in rows])
    assert (np.diff(times) > 0).all()
    assert np.diff(times).max() < SELDOM + 1.5 / RATE
    assert [late - robot.time for robot, late in rows] == pytest.approx([1.0] * len(rows))
    for axis in range(7):
        between = np.interp(TIMES, times, [robot.bodies[1, axis] for robot, _ in rows])
        assert np.abs(between - [robot.bodies[1, axis] for robot in robot_states]).max() <= STILL


def test_a_motion_is_kept_whole_with_the_rest_around_it_and_later_rest_seldom():
    times = np.array([robot.time for robot, _ in retained(moving_states(0.5))])
    whole = (TIMES > MOVES - BEFORE + 1.5 / RATE) & (TIMES < STOPS + AFTER - 1.5 / RATE)
    assert np.isin(TIMES[whole], times).all()
    later = times[times > STOPS + AFTER + 1 / RATE]
    assert len(later) < (LASTS - STOPS - AFTER) / SELDOM + RATE * BEFORE + 2


def test_what_is_sent_moves_a_robot_however_little_and_what_appears_does():
    rests = moving_states(0.0)[: round(RATE * MOVES)]
    for change in ({"joints": START + 1e-12}, {"commands": STRAIGHT - 1e-12}, {"measured": START},
                   {"bodies": np.nan_to_num(rests[0].bodies)}, {}):  # fmt: skip
        resting = LogDecimation()
        for robot in rests:
            resting.take(robot, robot.time)
        last = rests[-1]
        fields = {name: getattr(last, name) for name in ("joints", "commands", "object", "bodies", "measured")} | change
        rows = resting.take(RobotState(MOVES, 0.0, **fields), MOVES)
        assert bool(rows and rows[-1][0].time == MOVES) == bool(change), change


def test_a_log_of_a_robot_at_rest_has_few_of_its_poses_and_its_last_ones(tmp_path):
    log_writer = Written(tmp_path / "run.mcap", SUBJECT)
    for robot in moving_states(0.0):
        log_writer.robot_state(robot)
    log_writer.close()
    log = read_log(tmp_path / "run.mcap")
    for topic in (POSES, JOINTS_SENT):
        assert len(log.topics[topic].messages) < RATE * AFTER + (LASTS - AFTER) / SELDOM + RATE * BEFORE + 2
    stream = joint_stream(log.topics[JOINTS_SENT])
    assert np.ptp(stream.stamps) == pytest.approx(1e9 * TIMES[-1], abs=1e4)
