"""Who is said to have reached: the first contact decides; and where the tip is said to end."""

from types import SimpleNamespace

import numpy as np
import pytest
from scipy.spatial.transform import Rotation

from rehearsal.experiments.bench import SessionFrame
from rehearsal.experiments.reach import failure, is_clean, tell_end, tips_after
from rehearsal.experiments.result import Result
from rehearsal.operator.scripts import Ending
from rehearsal.session import RehearsedSession
from tests.rehearsal.frames import FORCE, TIP, UNITS, frame
from trunkline.ar.session.messages import PredictionMessage
from trunkline.ar.teleop.messages import ExecutorReport
from trunkline.ar.teleop.plan import Plan
from trunkline.errors import InputError

RADIUS = 0.03
NAN = (np.nan, 0.0, 0.0)
FREE, TOUCHES = frame(), frame(object={TIP: FORCE})
SHAFT, WORLD = frame(object={TIP - 1: FORCE}), frame(world={UNITS - 1: FORCE})
BOTH = frame(object={TIP - 1: FORCE, TIP: FORCE})
WORLD_TOO = frame(object={TIP: FORCE}, world={0: FORCE})


def done(aimed: float = 0.0) -> Ending:
    return Ending(True, aimed=aimed)


STOPPED = Ending(False, "stopped: the robot is in fault", aimed=0.0)
NAMELESS = Ending(False, "", aimed=0.0)


@pytest.mark.parametrize(("ending", "frames", "cause"), [
    # the tip's units, each, and all of them at once
    (done(), [FREE, TOUCHES], ""),
    (done(), [TOUCHES], ""),
    (done(), [FREE, frame(object={UNITS - 1: FORCE})], ""),
    (done(), [FREE, frame(object={TIP: FORCE, UNITS - 1: FORCE})], ""),
    (done(), [FREE, frame(object={TIP: (0.0, 0.0, -1e-12)})], ""),
    (done(), [FREE, frame(object={TIP: (1e-12, 0.0, 0.0)})], ""),
    # what follows does not count
    (done(), [TOUCHES, SHAFT, WORLD], ""),
    (done(), [TOUCHES, frame(object={TIP: NAN})], ""),
    (done(aimed=1.0), [TOUCHES], ""),
    # another unit first, or at once
    (done(), [FREE, SHAFT], f"collision: unit {TIP} touched it first"),
    (done(), [SHAFT, TOUCHES], f"collision: unit {TIP} touched it first"),
    (done(), [frame(object={0: FORCE}), TOUCHES], "collision: unit 1 touched it first"),
    (done(), [BOTH], f"collision: unit {TIP} touched it first"),
    # the world first, or at once
    (done(), [FREE, WORLD], "collision: the arm touched the world"),
    (done(), [WORLD, TOUCHES], "collision: the arm touched the world"),
    (done(), [WORLD_TOO], "collision: the arm touched the world"),
    (done(), [frame(object={0: FORCE}, world={0: FORCE})], "collision: the arm touched the world"),
    # a script that ended badly
    (STOPPED, [FREE, TOUCHES], "stopped: the robot is in fault"),
    (STOPPED, [FREE], "stopped: the robot is in fault"),
    (STOPPED, [SHAFT], f"collision: unit {TIP} touched it first"),
    (STOPPED, [WORLD], "collision: the arm touched the world"),
    (NAMELESS, [TOUCHES], "stopped: the operator gave up"),
    # no contact at all: the aim, from both sides of the border
    (done(aimed=RADIUS), [FREE], "missed: the preview's tip was on the object, the robot's was not"),
    (done(aimed=0.0), [FREE], "missed: the preview's tip was on the object, the robot's was not"),
    (done(aimed=np.nextafter(RADIUS, 1)), [FREE], "aim: the tip target was beside the object"),
    (done(aimed=np.nan), [FREE], "aim: the tip target was beside the object"),
    # forces that are no numbers
    (done(), [frame(object={TIP: NAN})], "error: the force of a contact is no number"),
    (done(), [frame(object={TIP: FORCE}, world={0: NAN})], "error: the force of a contact is no number"),
    (done(), [frame(object={TIP: (np.inf, 0.0, 0.0)})], "error: the force of a contact is no number"),
    # a robot that never moved
    (Ending(False, "aim: no preview came to the object"), [], "aim: no preview came to the object"),
    (Ending(False, "out of reach: none"), [], "out of reach: none"),
    (Ending(False, "stopped: at once"), [], "stopped: at once"),
    (Ending(False, "no path"), [], "plan refused: no path"),
    (NAMELESS, [], "stopped: the operator gave up"),
    (done(), [], "stopped: the operator gave up"),
])  # fmt: skip
def test_the_first_contact_decides_who_has_reached(ending, frames, cause):
    assert failure(ending, frames, TIP, RADIUS) == cause


PLACE = np.array([0.0, 0.5, -0.25])  # of the object, m


def at(x: float, **touched) -> SessionFrame:
    """With the tip x m beside PLACE."""
    return frame(tip=PLACE + [x, 0.0, 0.0], **touched)


@pytest.mark.parametrize(("frames", "clean"), [
    ([at(1.0), at(0.02)], True),
    ([at(0.02), at(1.0)], True),
    ([at(0.02, object={TIP: FORCE, UNITS - 1: FORCE})], True),
    ([at(np.nextafter(0.02, 1))], False),
    ([at(1.0, object={TIP: FORCE})], False),
    ([at(np.nan)], False),
    ([], False),
    # something else, before, at and after the nearest
    ([at(1.0, object={TIP - 1: FORCE}), at(0.0)], False),
    ([at(0.0, object={0: FORCE, TIP: FORCE})], False),
    ([at(0.0), at(1.0, object={0: FORCE})], False),
    ([at(1.0, world={UNITS - 1: FORCE}), at(0.0)], False),
    ([at(0.0), at(0.0, world={0: FORCE})], False),
    ([at(0.0), at(0.0, object={0: NAN})], False),
    ([at(0.0), at(0.0, world={0: NAN})], False),
])  # fmt: skip
def test_a_clean_reach_is_near_and_touches_nothing_else(frames, clean):
    assert is_clean(frames, PLACE, TIP) is clean


def test_how_far_the_tip_ends_from_where_it_was_said_to_is_told_in_mm():
    """From where the preview has the tip at that time of a plan of 5 s; what it does not go up to, where it ends."""
    stated = PredictionMessage(
        "", None, None, None, (4.0, 6.0, 8.0), ((0.0, 0.2, 0.3), (0.2, 0.2, 0.3), (0.2, 0.2, 0.5)),
        (0.5, 0.1, 0.004), 0.9, 12,
    )  # fmt: skip
    tips = {
        "at_end": np.array([0.1, 0.2, 0.303]),
        "after_2s": np.array([0.2, 0.204, 0.403]),
        "after_10s": np.array(stated.tip[-1]),
    }
    result = Result("reach", 0, True)
    tell_end(result, stated, 5.0, tips)
    numbers = (result.radius_mm, result.at_end_mm, result.after_2s_mm, result.after_10s_mm)
    np.testing.assert_allclose(numbers, (4, 3, 5, 0), atol=1e-9)


def test_a_radius_that_is_unknown_is_no_number():
    stated = PredictionMessage("", None, None, None, (0.0,), ((0.1, 0.2, 0.3),), (), 0.9, 12, 0.0, "mount tilted")
    result = Result("reach", 0, True)
    tell_end(result, stated, 1.0, {"at_end": np.array([0.1, 0.2, 0.303])})
    np.testing.assert_allclose((result.radius_mm, result.at_end_mm), (np.nan, 3))


class Drifting:
    """A robot that runs any plan in 1 s of four frames; its tip moves on along x by 1 m/s. `permitted`: frames."""

    def __init__(self, refused: str = "", fault: str = "") -> None:
        self.x, self.refused, self.fault, self.permitted = 0.0, refused, fault, 0
        turn = Rotation.from_rotvec([0.0, 0.0, np.pi / 2])
        self.instruments = SimpleNamespace(turn=turn, shift=np.array([0.0, 0.0, 5.0]))

    def start(self, plan, digest):
        assert plan.digest() == digest
        return self.refused

    def permit(self, waits=False):
        self.permitted += 1

    def state(self):
        return ExecutorReport("done" if self.x >= 1.0 else "running", "", self.fault)

    def advance(self, dt: float = 0.25) -> None:
        assert dt >= 0
        self.x += dt

    def truth(self):
        return SimpleNamespace(tip=np.array([self.x, 0.0, 0.0]))


PLAN = Plan(0.1, np.zeros((11, 7)), np.zeros((11, 3)), (("approach", 0),), "package", "world")


def alone(robot: Drifting) -> RehearsedSession:
    session = object.__new__(RehearsedSession)
    session.robot = session.executor = robot  # type: ignore[assignment]
    return session


def test_the_tip_is_looked_at_as_long_after_the_end_as_is_said_and_as_the_client_sees_it():
    robot = Drifting()
    tips = tips_after(alone(robot), PLAN)
    assert list(tips) == ["at_end", "after_2s", "after_10s"]
    for tip, at in zip(tips.values(), (1.0, 3.0, 11.0), strict=True):
        np.testing.assert_allclose(tip, (0.0, at, 5.0), atol=1e-9)
    assert robot.permitted == 4, "of every frame, else it would come to rest"


@pytest.mark.parametrize("how", ["refused", "fault"])
def test_a_plan_that_is_not_run_again_is_an_error(how):
    robot = Drifting(**{how: "a joint leaves its range"})
    with pytest.raises(InputError, match=r"^plan: a joint leaves its range, expected what the robot has run before$"):
        tips_after(alone(robot), PLAN)
