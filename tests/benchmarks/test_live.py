"""The live benchmark: what is counted of frames that came, of the server's processor, of holds, and presses."""

import asyncio
import json
import struct
from types import SimpleNamespace

import numpy as np
import pytest
from aiohttp import WSMessage, WSMsgType

from benchmarks.live import Holds, Looks, halves
from benchmarks.watching import Asker, RobotFrames, Span
from trunkline.ar.session import binary
from trunkline.errors import InputError


def span(*frames):
    return Span(10.0, 12.0, tuple(np.array(rows).reshape(-1, 2) for rows in frames))


def test_the_rate_is_of_who_received_the_fewest():
    some = [(10.0, 10.1)] * 4
    assert span(some, some[:3]).rate == 1.5
    assert span(some, []).rate == 0.0


def test_ages_are_from_the_time_that_is_told_until_a_frame_has_come():
    np.testing.assert_allclose(span([(10.0, 10.003)], [(10.5, 10.507), (11.0, 11.005)]).ages, [0.003, 0.007, 0.005])
    assert halves(np.array([0.001, 0.002, 0.003])) == "2.0 / 2.9"


def test_frames_of_the_robot_alone_are_kept_with_the_time_they_tell():
    frames = RobotFrames()
    for kind in ("robot", "shell"):
        message = binary.frame(kind, set(), 0, 1, 3.25, np.empty(0))
        frames(WSMessage(WSMsgType.BINARY, message, None))
    frames(WSMessage(WSMsgType.TEXT, "{}", None))
    assert [told for told, _ in frames.rows] == [3.25]


def test_a_share_of_the_processor_is_of_the_span_alone():
    looks = Looks(SimpleNamespace())
    looks.rows = [(9.0, 5.0, {"a": 9}), (10.0, 6.0, {"a": 1}), (11.0, 6.1, {"a": 3}), (13.0, 6.5, {})]
    assert looks.share(span([])) == pytest.approx(0.15)
    assert looks.most(span([]), "a") == 3


def test_frames_that_are_held_are_those_not_acknowledged():
    box = SimpleNamespace(sent=7, received=4)
    looks = Looks(SimpleNamespace(clients={"x": SimpleNamespace(id="a", outbox=box)}))
    looks.look()
    assert looks.rows[0][2] == {"a": 3}


def test_a_stop_is_timed_to_the_hold_after_it():
    holds = Holds(SimpleNamespace(), [0.0, 1.2, 2.5])
    np.testing.assert_allclose(holds.after(np.array([1.0, 2.1, 3.0])), [0.2, 0.4])


class Deaf:
    """A client whose server answers nothing but what `sees` is given."""

    def __init__(self):
        self.told, self.triggers = {"state": {"notice": "out of reach"}}, []

    async def send(self, kind, rows, flags, count):
        self.triggers.append(struct.unpack_from("<f", rows, 4 * binary.HAND.index("trigger"))[0])


def state(mode):
    return WSMessage(WSMsgType.TEXT, json.dumps({"type": "state", "mode": mode}), None)


@pytest.mark.realtime
def test_a_press_lasts_until_the_state_shows_it(monkeypatch):
    monkeypatch.setattr("benchmarks.watching.AIMED", 0.05)

    async def asked():
        guest = Deaf()
        asker = Asker(guest, np.random.default_rng(0))
        guest.sees(state("plan"))  # of no press
        guest.sees(state("aim"))
        while not guest.triggers or not guest.triggers[-1]:
            await asker.go_on()
        await asyncio.sleep(0.03)
        guest.sees(state("aim"))
        guest.sees(state("plan"))
        return asker.took

    took = asyncio.run(asked())
    assert len(took) == 1
    assert 0.03 <= took[0] < 1.0


def test_presses_that_show_nothing_are_told_in_the_end(monkeypatch):
    for name, value in (("AIMED", 0.0), ("PATIENCE", 0.0), ("MOST_LOST", 2)):
        monkeypatch.setattr(f"benchmarks.watching.{name}", value)

    async def asked():
        asker = Asker(Deaf(), np.random.default_rng(0))
        asker.guest.sees(state("aim"))
        for _ in range(100):
            await asker.go_on()

    with pytest.raises(InputError, match="trigger: found 3 presses for which no plan is asked: .*out of reach"):
        asyncio.run(asked())
