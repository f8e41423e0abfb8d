"""Trackers in processes of their own: simulated cameras, and Motive's stand-in, unicast and multicast."""

import multiprocessing
import os
import signal
import threading
import time
from dataclasses import replace
from functools import partial
from types import SimpleNamespace

import numpy as np
import pytest

from tests.ar.tracking import motive_stand_in as stand_in
from tests.ar.tracking.motive_stand_in import GROUP, LOOPBACK, motive
from tests.support.waiting import until
from trunkline.ar.tracking import natnet, tracking_process
from trunkline.ar.tracking.natnet import NatNetSettings, NatNetSource, NatNetTracker
from trunkline.ar.tracking.pose_channel import PoseChannel
from trunkline.ar.tracking.simulated_cameras import EPOCH, CameraSettings, SimulatedCameras, SimulatedTracker
from trunkline.ar.tracking.stream_checks import StreamLimits
from trunkline.ar.tracking.tracker import ExpectedBodies
from trunkline.errors import InputError

NAMES = ("base", "tip")
BODIES = {"other": 1, "tip": 7, "base": 4}
EXPECTED = ExpectedBodies(NAMES, True)
PATIENT = StreamLimits(silence=10.0, age=10.0)  # a busy machine is no lie
TURNED = (0.5, 0.5, -0.5, 0.5)


def frame(version, number, noise=0.0):
    at = 100.0 + number / 120
    bodies = [
        stand_in.rigid_body(7, (0.1 + noise, 0.2, 0.3), TURNED),
        stand_in.rigid_body(1, (9, 9, 9), (1, 0, 0, 0)),
        stand_in.rigid_body(4, (1.0 + noise, 2.0, 3.0), (1, 0, 0, 0), flags=0 if number % 10 == 9 else 1),
    ]
    return stand_in.frame(version, number, at, at + 0.005, bodies)


class Streaming:
    """Frames of a stand-in, at the pace of cameras, until it ends."""

    def __init__(self, server):
        self._server, self._ends, self.holds = server, False, False
        self._thread = threading.Thread(target=self._run, daemon=True)

    def _run(self):
        number, rng = 0, np.random.default_rng(0)
        while not self._ends:
            number += 1
            if not self.holds:
                self._server.send(frame(self._server.version, number, 3e-4 * rng.standard_normal()))
            time.sleep(1 / 120)

    def __enter__(self):
        self._thread.start()
        return self

    def __exit__(self, *_):
        self._ends = True
        self._thread.join()


@pytest.mark.parametrize("group", [None, GROUP])
@pytest.mark.parametrize("version", [(3, 1), (4, 1)])
def test_a_source_receives_the_named_bodies_of_both_versions(version, group):
    with motive(version, BODIES, group) as server:
        source = NatNetSource(NatNetSettings(LOOPBACK, LOOPBACK, server.port), NAMES)
        try:
            server.send(frame(version, 8))
            first = source.receive(5.0)
            server.send(frame(version, 9))
            second = source.receive(5.0)
            assert source.receive(0.01) is None
        finally:
            source.close()
        assert (first.number, first.stamp, first.sent) == (
            8,
            pytest.approx(100 + 8 / 120),
            pytest.approx(100.005 + 8 / 120),
        )
        np.testing.assert_allclose(first.positions, [[1, 2, 3], [0.1, 0.2, 0.3]], rtol=1e-6)
        assert first.quaternions.tolist() == [[1, 0, 0, 0], list(TURNED)]
        assert first.tracked.tolist() == [True, True]
        assert second.tracked.tolist() == [False, True]
        until(lambda: (9 in server.heard) == (group is None))  # a unicast client says that it goes


def test_a_unicast_server_hears_signs_of_life_and_nothing_of_others_is_taken(monkeypatch):
    monkeypatch.setattr(natnet, "ALIVE", 0.01)
    with motive((3, 1), BODIES) as server:
        source = NatNetSource(NatNetSettings(LOOPBACK, LOOPBACK, server.port), NAMES)
        until(lambda: 10 in server.heard or source.receive(0.02) is not None)
        source._server = ("127.0.0.2", server.port)  # what comes is now another's
        server.send(frame((3, 1), 8))
        assert source.receive(0.1) is None
        source.close()


def test_a_body_that_is_not_streamed_a_mute_server_and_a_wrong_address_are_refused(monkeypatch):
    monkeypatch.setattr(natnet, "ANSWERS", 0.3)
    with motive((4, 1), BODIES) as server:
        settings = NatNetSettings(LOOPBACK, LOOPBACK, server.port)
        with pytest.raises(InputError) as error:
            NatNetSource(settings, ("base", "tp"))
        reason = "found the rigid bodies other, tip, base, expected 'tp', did you mean 'tip'?"
        assert str(error.value) == f"NatNet at 127.0.0.1: {reason}"
        server.answers = False
        with pytest.raises(InputError) as error:
            NatNetSource(settings, NAMES)
        expected = "expected Motive's streaming engine"
        assert (
            str(error.value) == f"NatNet at 127.0.0.1: found no answer at port {server.port} within 0.3 s, {expected}"
        )
        server.version, server.answers = (2, 9), True
        with pytest.raises(
            InputError, match=r"^NatNet at 127.0.0.1: found NatNet 2.9, expected 3.0 or later, and below 5$"
        ):
            NatNetSource(settings, NAMES)
    with pytest.raises(ValueError, match="server: found 'motive.local', expected an IPv4 address"):
        NatNetSettings("motive.local")


@pytest.mark.realtime
def test_a_tracker_says_the_newest_and_when_it_stalls_or_its_process_is_gone(monkeypatch):
    monkeypatch.setattr(tracking_process, "STALE", 5.0)
    with motive((4, 1), BODIES) as server, Streaming(server) as streaming:
        limits = StreamLimits(silence=2.0, age=10.0, recovers=1.0)
        tracker = NatNetTracker(NatNetSettings(LOOPBACK, LOOPBACK, server.port), EXPECTED, limits)
        with pytest.raises(InputError, match="found no connection, expected `connect` before `latest`"):
            tracker.latest()
        try:
            tracker.connect()
            poses = tracker.latest()
            assert (poses.names, poses.sound, poses.fault) == (NAMES, True, "")
            np.testing.assert_allclose(poses.positions[1], [0.1, 0.2, 0.3], atol=5e-3)
            np.testing.assert_allclose(poses.quaternions[1], TURNED, rtol=1e-6)
            assert 0.005 <= poses.age == pytest.approx(time.monotonic() - poses.stamp, abs=0.5)
            until(lambda: tracker.latest().rate > 0)
            streaming.holds = True
            until(lambda: not tracker.latest().sound)
            assert tracker.latest().fault.startswith("found no frame for 2.")
            streaming.holds = False
            age = tracker.latest().age
            until(lambda: tracker.latest().age < age / 2)
            until(lambda: tracker.latest().sound)
            os.kill(tracker._process.pid, signal.SIGKILL)
            until(lambda: not tracker.latest().sound)
            assert tracker.latest().fault == "its process has ended, expected it to run"
            tracker.connect()
            assert tracker.latest().sound
        finally:
            tracker.stop()
            tracker.stop()


@pytest.mark.realtime
def test_a_process_that_hangs_is_named(monkeypatch):
    monkeypatch.setattr(tracking_process, "STALE", 1.0)
    tracker = SimulatedTracker(CameraSettings(), EXPECTED, replace(PATIENT, recovers=0.5))
    with pytest.raises(InputError, match="found nothing to see, expected `show` before `connect`"):
        tracker.connect()
    tracker.show(np.array([[0, 0, 0.0], [0, 0, -0.5]]), np.array([[1.0, 0, 0, 0]] * 2))
    try:
        tracker.connect()
        os.kill(tracker._process.pid, signal.SIGSTOP)
        until(lambda: not tracker.latest().sound)
        assert tracker.latest().fault.startswith("its process is silent for 1.")
        os.kill(tracker._process.pid, signal.SIGCONT)
        begin = time.monotonic()
        until(lambda: tracker.latest().sound)
        assert time.monotonic() - begin >= 0.5
    finally:
        os.kill(tracker._process.pid, signal.SIGKILL)
        tracker.stop()


class Inline:
    """A process that has run to its end within `start`: nothing that a busy machine makes late."""

    def __init__(self, target, args, daemon, name):
        self._run = partial(target, *args)

    def start(self):
        self._run()

    def is_alive(self):
        return False

    def terminate(self):
        pass

    def join(self, seconds=None):
        pass


def test_connecting_says_why_it_fails(monkeypatch):
    monkeypatch.setattr(natnet, "ANSWERS", 0.05)
    for name in ("leave_signals_to_parent", "end_with_parent"):
        monkeypatch.setattr(tracking_process, name, lambda: None)
    monkeypatch.setattr(tracking_process.signal, "signal", lambda *_: None)
    tracker = NatNetTracker(NatNetSettings(LOOPBACK, LOOPBACK, 9), EXPECTED)
    tracker._context = SimpleNamespace(
        Process=Inline, RawArray=multiprocessing.RawArray, RawValue=multiprocessing.RawValue
    )
    with pytest.raises(InputError, match=r"^NatNet at 127.0.0.1: found no answer at port 9 within 0.05 s"):
        tracker.connect()
    with pytest.raises(InputError, match="found no connection"):
        tracker.latest()


def simulated(names, poses, **settings):
    """Frames of two seconds of simulated cameras that never wait."""

    shown = PoseChannel(multiprocessing.get_context("spawn"), 7 * len(names))
    shown.tell(poses)
    cameras = SimulatedCameras(CameraSettings(**settings), shown, names)
    cameras._begun = time.monotonic() - 2.1
    taken = []
    while len(taken) < 200 and (exposed := cameras.receive(0.0)) is not None:
        taken.append(exposed)
    return taken


def test_simulated_cameras_see_with_noise_gaps_swaps_and_delay_in_a_frame_of_their_own():
    poses = np.array([0, 0, 0.0, 0.1, 0.2, -0.5, 1, 0, 0, 0, 1, 0, 0, 0.0])
    taken = simulated(NAMES, poses, gaps=0.0, dropped=0.0, outliers=0.0)
    assert len(taken) == 200
    seen_at = np.array([exposed.positions for exposed in taken])
    there = [[0.4, 1.1, -0.3], [0.4 + 0.1, 1.1 - 0.5, -0.3 - 0.2]]  # z up has become y up
    np.testing.assert_allclose(seen_at.mean(axis=0), there, atol=2e-4)
    np.testing.assert_allclose(seen_at.std(axis=0), 3e-4, rtol=0.25)
    np.testing.assert_allclose(np.diff([exposed.stamp for exposed in taken]), 1 / 120, atol=1e-9)
    np.testing.assert_allclose([exposed.sent - exposed.stamp for exposed in taken], 0.008, atol=1e-9)
    assert abs(taken[0].stamp - EPOCH - time.monotonic()) < 60
    rough = simulated(NAMES, poses, gaps=5.0, dropped=0.1, outliers=0.05, swaps=5.0, swap=(20.0, 50.0))
    assert 0 < sum(exposed.tracked[0] for exposed in rough) < len(rough)
    assert np.diff([exposed.number for exposed in rough]).max() > 1
    at = np.array([exposed.positions[0] for exposed in rough])
    assert np.any(np.linalg.norm(at - there[1], axis=1) < 0.01)
    off = np.linalg.norm(at - there[0], axis=1)
    assert np.any((off > 0.015) & (off < 0.05))


def test_shapes_that_do_not_fit_are_refused():
    tracker = SimulatedTracker(CameraSettings(), EXPECTED)
    with pytest.raises(InputError, match=r"found shapes \(3, 3\) and \(2, 4\), expected 2 bodies"):
        tracker.show(np.zeros((3, 3)), np.zeros((2, 4)))
