"""What the Panda is sent: it follows setpoints, and brakes within its limits where they end or ask for too much."""

import contextlib
import itertools
import math
import socket

import numpy as np
import pytest

from trunkline.ar.drivers.driver_frames import DriverState, FrameSocket, Setpoint
from trunkline.ar.drivers.setpoint_filter import LIMITS, SetpointFilter

READY = np.array([0.0, -0.4, 0.0, -2.2, 0.0, 1.8, 0.785])
DT, LEAD, BEGINS, SECONDS = 0.001, 0.03, 0.1, 2.0
PANDA, FOURTH = LIMITS["panda"], np.arange(7) == 3


def way(time, turn=0.5):
    """From rest to rest, all joints by `turn` rad, with the least jerk."""
    share = min(max(time - BEGINS, 0.0) / SECONDS, 1.0)
    return READY + turn * share**3 * (10 - 15 * share + 6 * share**2)


def play(seconds, heard=lambda now: True, at=way, dt=lambda now: DT, robot=PANDA, stream=None):
    """Setpoints every ms, stamped LEAD ahead, those for which `heard`; what the robot was sent, (T, 7)."""
    stream, sent, now = stream or SetpointFilter(READY, robot), [], 0.0
    for step in range(round(seconds / DT)):
        now = step * DT
        if heard(now):
            stream.hear(Setpoint(now + LEAD, tuple(at(now + LEAD))), now)
        sent.append(stream.cycle(now, dt(now)))
    return stream, np.array(sent)


def shares(sent, robot=PANDA):
    """Largest velocity, acceleration and jerk, as shares of the robot's."""
    played, rates = [], sent
    for most in (robot.velocity, robot.acceleration, robot.jerk):
        rates = np.diff(rates, axis=0) / DT
        played.append(float((np.abs(rates) / most).max()))
    return played


def test_setpoints_are_followed_when_they_are_due():
    stream, sent = play(2.5)
    assert stream.fault == ""
    np.testing.assert_allclose(sent, [way(n * DT) for n in range(2500)], atol=1e-9)


def test_a_robot_whose_time_is_too_slow_is_a_fault_once_it_moves():
    """At half its pace it rests for as long as it likes, and what it did not do meanwhile is not made up for."""
    stream, sent = play(BEGINS + 0.05, dt=lambda now: DT / 2)
    assert stream.fault == ""
    stream, sent = play(3.0, at=lambda time: way(time - 1.0), dt=lambda now: DT / 2)
    assert stream.fault.startswith("its cycles are too few: setpoints are played 30")
    moved = np.flatnonzero(np.abs(np.diff(sent, axis=0)).max(axis=1) > 1e-6)[0]
    assert moved * DT == pytest.approx(1.0 + BEGINS, abs=0.1)
    assert not np.diff(sent[-5:], axis=0).any()


def test_setpoints_that_come_late_but_before_they_are_due_change_nothing():
    """As a busy machine sends them: nothing for 20 ms, then all at once."""
    stream, waiting, sent = SetpointFilter(READY, PANDA), [], []
    for step in range(2500):
        now = step * DT
        waiting.append(Setpoint(now + LEAD, tuple(way(now + LEAD))))
        if step % 20 == 0:
            for setpoint in waiting:
                stream.hear(setpoint, now)
            waiting = []
        sent.append(stream.cycle(now, DT))
    assert stream.fault == ""
    np.testing.assert_allclose(sent, [way(n * DT) for n in range(2500)], atol=1e-9)


@pytest.mark.parametrize("cut", [0.11, 0.3, 0.7, 1.1, 1.8])
@pytest.mark.parametrize("robot", ["panda", "fr3"])
def test_where_setpoints_end_it_brakes_within_its_limits_and_holds(cut, robot):
    stream, sent = play(3.0, heard=lambda now: now < cut, robot=LIMITS[robot])
    assert stream.fault.startswith("setpoints have run out, the last came ")
    assert stream.resting
    assert max(shares(sent, LIMITS[robot])) < 0.6
    np.testing.assert_array_equal(sent[-1], sent[-500])
    moved = np.abs(sent[round((cut + 0.05) / DT) :] - way(cut + LEAD)).max()
    assert moved < 0.06  # rad from where they ended
    begun = int(np.flatnonzero(np.abs(np.diff(sent, axis=0)).max(axis=1) > 0)[-1]) * DT
    assert begun - cut < LEAD + 0.25  # s until it rests


def test_setpoints_that_come_again_do_not_move_it():
    stream, sent = play(3.0, heard=lambda now: not 0.7 < now < 0.8)
    assert stream.resting
    np.testing.assert_array_equal(sent[-1], sent[-1500])


def test_before_the_first_setpoint_it_holds():
    stream, sent = play(1.0, heard=lambda now: False)
    assert stream.fault == ""
    np.testing.assert_array_equal(sent, np.tile(READY, (1000, 1)))


def jumping(by):
    return lambda time: way(time) + (by if time > 1.0 else 0.0)


@pytest.mark.parametrize(
    ("at", "reason"),
    [
        (jumping(0.02), "setpoint: joint 1 asks for 20"),
        (jumping(1e-4), "setpoint: joint 2 asks for"),
        (lambda time: way(time, 3.0), "setpoint: joint 1 asks for 2.22 rad/s, expected at most 2.17"),
        (lambda time: np.where(FOURTH, way(time, 2.2), READY), "setpoint: joint 4 leaves its range at -0.06"),
        (lambda time: way(time) + (math.nan if time > 1.0 else 0.0), "setpoint: found values that are not finite"),
        (lambda time: READY + 0.01, "setpoint: starts 0.01 rad from where the robot is"),
    ],
)  # fmt: skip
def test_what_asks_for_too_much_is_refused_by_name_and_braked_for(at, reason):
    stream, sent = play(3.5, at=at)
    assert stream.fault.startswith(reason)
    assert stream.resting
    assert max(shares(sent)) < 1.03
    np.testing.assert_array_equal(sent[-1], sent[-200])


def test_a_robot_whose_clock_runs_slower_is_kept_up_with():
    """As a simulator that falls behind: 0.8 s of its time in a second."""
    stream, sent = play(4.0, dt=lambda now: 0.8 * DT)
    assert stream.fault == ""
    late = [np.abs(sent[n] - way(n * DT - 0.06)).max() for n in range(500, 4000)]
    assert max(late) < 0.02
    np.testing.assert_allclose(sent[-1], way(4.0), atol=1e-6)


class LossyRobot:
    """What does not reach it, it makes up: its last acceleration, integrated (libfranka, "Packet handling")."""

    SHARE, LONGEST = 0.1, 12  # of cycles at which commands begin to be lost, and how many in a row

    def __init__(self):
        self.random, self.left = np.random.default_rng(3), 0
        self.place, self.speed, self.gain = READY.copy(), np.zeros(7), np.zeros(7)

    def loses(self):
        if not self.left and self.random.random() < self.SHARE:
            self.left = int(self.random.integers(1, self.LONGEST + 1))
        self.left = max(self.left - 1, 0)
        return self.left > 0

    def hear(self, place):
        speed = (place - self.place) / DT
        self.place, self.speed, self.gain = place, speed, (speed - self.speed) / DT

    def guess(self):
        self.speed = self.speed + DT * self.gain
        self.place = self.place + DT * self.speed


def lossy(tells, at=way):
    """Where an FR3 went that lost commands, (T, 7), and the stream; `tells`: where it went meanwhile."""
    stream, made, went, missed = SetpointFilter(READY, LIMITS["fr3"]), LossyRobot(), [], 0
    for step in range(3000):
        now = step * DT
        stream.hear(Setpoint(now + LEAD, tuple(at(now + LEAD))), now)
        if made.loses():
            made.guess()
            missed += 1
        else:
            if tells:
                stream.synchronize(made.place, made.speed, made.gain)
            made.hear(stream.cycle(now, (1 + missed) * DT))
            missed = 0
        went.append(made.place)
    return np.array(went), stream


def test_lost_commands_are_bridged_within_the_robots_limits():
    went, stream = lossy(tells=True)
    assert stream.fault == ""
    assert max(shares(went, LIMITS["fr3"])) < 1.0
    wanted = np.array([way(n * DT) for n in range(3000)])
    assert np.abs(went - wanted).max() < 2e-3
    np.testing.assert_allclose(went[-1], way(3.0), atol=1e-6)
    assert max(shares(lossy(tells=False)[0], LIMITS["fr3"])) > 1.0


def test_it_brakes_from_where_lost_commands_left_it():
    """Setpoints ask for too much while commands are lost."""
    went, stream = lossy(tells=True, at=jumping(0.02))
    assert stream.fault.startswith("setpoint: joint ")
    assert stream.resting
    assert max(shares(went, LIMITS["fr3"])) < 1.0


def test_frames_come_back():
    setpoint = Setpoint(12.5, tuple(READY))
    assert Setpoint.unpack(setpoint.pack()) == setpoint
    state = DriverState(1.0, tuple(READY), tuple(READY + 1), "reflex: é")
    assert DriverState.unpack(state.pack()) == state
    assert len(DriverState(1.0, (0.0,) * 3, (0.0,) * 3, "é" * 200).pack()) == DriverState.size(3)


@pytest.fixture
def line():
    ours, theirs = socket.socketpair()
    theirs.settimeout(5.0)
    yield FrameSocket(ours, Setpoint.size(7)), theirs
    ours.close()
    theirs.close()


def test_frames_are_cut_however_they_come(line):
    ours, theirs = line
    data, frames = b"".join(Setpoint(n, tuple(READY)).pack() for n in range(9)), []
    for begin in range(0, len(data), 50):
        theirs.send(data[begin : begin + 50])
        frames += ours.received()
    assert [Setpoint.unpack(frame).due for frame in frames] == list(range(9))
    assert ours.open
    theirs.close()
    assert ours.received() == []
    assert not ours.open


def test_frames_that_are_missed_are_missed_whole(line):
    ours, theirs = line
    frames = (bytes([n % 256]) * 3000 for n in itertools.count())
    with contextlib.suppress(BlockingIOError):
        while True:
            ours.send(next(frames))
    got = b""
    for _ in range(300):  # as there is room again
        got += theirs.recv(3000)
        with contextlib.suppress(BlockingIOError):
            ours.send(next(frames))
    blocks = {bytes(got[n : n + 3000]) for n in range(0, len(got) - 2999, 3000)}
    assert all(len(set(frame)) == 1 for frame in blocks)
