"""QTM as a source of poses, against a stand-in of its real-time server."""

import re
import struct
import threading
import time
from contextlib import contextmanager
from types import SimpleNamespace

import numpy as np
import pytest
from scipy.spatial.transform import Rotation

from tests.ar.tracking.qtm_stand_in import LOOPBACK, frame, packet, qtm
from tests.support.waiting import until
from trunkline.ar.tracking import qualisys
from trunkline.ar.tracking.qualisys import QualisysSettings, QualisysSource, QualisysTracker
from trunkline.ar.tracking.stream_checks import StreamLimits
from trunkline.ar.tracking.tracker import ExpectedBodies
from trunkline.errors import InputError

NAMES, STREAMED = ("base", "tip"), ("other", "tip", "base")
TURN = Rotation.from_rotvec([0.3, -0.5, 0.9])
PLACES = np.array([[9.0, 9.0, 9.0], [0.1, 0.2, 0.3], [1.0, 2.0, 3.0]])
PATIENT = StreamLimits(silence=10.0, age=10.0)  # a busy machine is no lie


def bodies(noise=0.0, lost=()):
    rows = [((place + noise).tolist(), TURN.as_matrix().tolist()) for place in PLACES]
    return [None if name in lost else row for name, row in zip(STREAMED, rows, strict=True)]


@contextmanager
def streaming(server, fault=""):
    """Frames at the pace of cameras once they are asked for; the fault begins by the list that is yielded."""
    ends, begins = threading.Event(), []

    def run():
        number, rng = 0, np.random.default_rng(0)
        while not ends.is_set():
            number += 1
            faulty = fault if begins else ""
            stamp = 5.0 if faulty == "old" else 100.0 + number / 120
            content = bodies(0.0 if faulty == "frozen" else 3e-4 * rng.standard_normal())
            if server.streams.is_set():
                data = frame(number, stamp, content)
                try:
                    server.send(packet(3, b"\1" * 17) if faulty == "garbage" else data)
                except OSError:
                    server.streams.clear()
            time.sleep(1 / 120)

    thread = threading.Thread(target=run, daemon=True)
    thread.start()
    try:
        yield begins
    finally:
        ends.set()
        thread.join()


def send_soon(server, *frames):
    """What a client is waiting for: the first frame answers its command."""

    def run():
        server.streams.wait(10.0)
        for some in frames:
            server.send(some)

    threading.Thread(target=run, daemon=True).start()


def test_a_source_receives_the_named_bodies_in_m_and_turned_as_qtm_has_them():
    with qtm(STREAMED) as server:
        send_soon(server, frame(8, 12.5, bodies()), frame(9, 12.51, bodies(lost=("tip",))))
        source = QualisysSource(QualisysSettings(LOOPBACK, server.port), NAMES)
        try:
            first, second = source.receive(5.0), source.receive(5.0)
            assert source.receive(0.01) is None
        finally:
            source.close()
    assert server.heard == ["version 1.25", "getparameters 6d", "streamframes allframes 6d"]
    assert (first.number, first.stamp, first.sent) == (8, 12.5, 12.5)
    np.testing.assert_allclose(first.positions, PLACES[[2, 1]], rtol=1e-6)
    expected = TURN.as_quat(scalar_first=True)
    np.testing.assert_allclose(first.quaternions, [expected, expected], atol=1e-6)
    assert first.tracked.tolist() == [True, True]
    assert (second.number, second.tracked.tolist()) == (9, [True, False])


def test_a_body_that_qtm_does_not_track_no_measurement_and_a_mute_or_absent_server_are_refused(monkeypatch):
    monkeypatch.setattr(qualisys, "ANSWERS", 1.0)
    with qtm(STREAMED) as server:
        settings = QualisysSettings(LOOPBACK, server.port)
        with pytest.raises(InputError) as error:
            QualisysSource(settings, ("base", "tp"))
        reason = "found the 6D bodies other, tip, base, expected 'tp' once, did you mean 'tip'?"
        assert str(error.value) == f"QTM at 127.0.0.1: {reason}"
        with pytest.raises(InputError) as error:
            QualisysSource(settings, NAMES)
        assert str(error.value) == "QTM at 127.0.0.1: found no frame, expected a measurement or a preview to run"
        server.answers = False
        silent = f"found no answer at port {server.port}, expected QTM's real-time server"
        with pytest.raises(InputError) as error:
            QualisysSource(settings, NAMES)
        assert str(error.value) == f"QTM at 127.0.0.1: {silent}"
    with pytest.raises(InputError) as error:
        QualisysSource(settings, NAMES)
    assert str(error.value) == f"QTM at 127.0.0.1: {silent}"


def test_a_frame_that_is_cut_short_is_named_and_a_matrix_that_turns_nothing_is_no_rotation():
    source = QualisysSource.__new__(QualisysSource)
    source._rows, source._bodies = [0, 1], 2
    cut = SimpleNamespace(get_6d=lambda: struct.unpack("<d", b"1234"))
    with pytest.raises(ValueError, match="found a frame of another layout .*, expected 6D bodies"):
        source._frame(cut)
    matrices = [SimpleNamespace(matrix=size * np.eye(3).ravel()) for size in (1.0, 2.0)]
    packet = SimpleNamespace(get_6d=lambda: (None, [((0.0, 0.0, 0.0), matrix) for matrix in matrices]),
                             timestamp=1, framenumber=1)  # fmt: skip
    assert np.isnan(source._frame(packet).quaternions[:, 0]).tolist() == [False, True]


def test_a_frame_of_other_bodies_and_the_end_of_the_connection_are_named():
    with qtm(STREAMED) as server:
        send_soon(server, frame(8, 12.5, bodies()[:2]))
        source = QualisysSource(QualisysSettings(LOOPBACK, server.port), NAMES)
        try:
            with pytest.raises(ValueError, match="found 2 of the 6D bodies in a frame, expected all 3"):
                source.receive(5.0)
            server.client.shutdown(2)
            with pytest.raises(ValueError, match="QTM has ended the connection"):
                source.receive(5.0)
        finally:
            source.close()


@pytest.mark.realtime
@pytest.mark.parametrize(
    ("fault", "line"),
    [
        ("old", "expected both to grow"),
        ("frozen", "only repeat the one before|to the last bit"),
        ("garbage", "QTM has ended the connection"),
    ],
)
def test_a_tracker_says_the_newest_and_names_what_is_untrue(fault, line):
    with qtm(STREAMED) as server, streaming(server, fault) as begins:
        tracker = QualisysTracker(QualisysSettings(LOOPBACK, server.port), ExpectedBodies(NAMES, True), PATIENT)
        try:
            tracker.connect()
            poses = tracker.latest()
            assert poses.sound
            np.testing.assert_allclose(poses.positions, PLACES[[2, 1]], atol=3e-3)
            begins.append(True)
            until(lambda: not tracker.latest().sound, seconds=30.0)
            assert re.search(line, tracker.latest().fault), tracker.latest().fault
        finally:
            tracker.stop()
