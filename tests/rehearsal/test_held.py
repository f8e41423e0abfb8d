"""Who is said to have grasped, and to have handed over; and whether the preview had said so."""

from types import SimpleNamespace

import numpy as np
import pytest

from rehearsal import settings
from rehearsal.experiments.bench import executed
from rehearsal.experiments.grasp import TABLE, agreed, failure, in_arm, tell, tip_difference
from rehearsal.experiments.handle import BORNE, STILL, why_not
from rehearsal.experiments.result import Result
from rehearsal.first_grasp import LIFT, SLIP, holds
from rehearsal.operator.scripts import Ending
from rehearsal.robot.scene import LabScene, SceneObject
from tests.rehearsal.frames import FORCE, UNITS, frame
from trunkline.ar.hybrid.worlds import SupportSurface
from trunkline.frames import STANDARD_GRAVITY

S = settings.grasped()
DONE = Ending(True)
HOLD = {2: FORCE}  # the unit that holds
NAN = (np.nan, 0.0, 0.0)
LIFTED = "slip: it was lifted by {:.0f} mm"
MOVED = "slip: it moved by {:.0f} mm in the arm as it was held"
MORE = "slip: it touched more than the arm as it was held"


def run(
    lifted=2 * S.lifted, moved=0.0, touched=HOLD, grasped=HOLD, hanging=False, lies=((), (), ()), carried=0.0, low=0.0
):
    """Frames of a grasp: before it, at its end, and some later, in which the object has `moved` in the arm, which has
    `carried` it somewhere. `low`: its height at first, m."""
    arm = np.zeros((UNITS, 3))
    up, off, away = np.array([0.0, 0.0, low + lifted]), np.array([moved, 0.0, 0.0]), np.array([0.0, carried, 0.0])
    return [
        frame(0.0, "execute", touched, place=(0.0, 0.0, low)),
        frame(1.0, "aim", grasped, lies=lies[0], place=up, units=arm, hanging=hanging),
        frame(2.0, "aim", grasped, lies=lies[1], place=up, units=arm),
        frame(3.0, "aim", grasped, lies=lies[2], place=up + off + away, units=arm + away),
    ]


def lying(force=FORCE) -> tuple:
    return ((0.0, 0.0, 0.0), force)


@pytest.mark.parametrize(("ending", "frames", "cause"), [
    (DONE, run(), ""),
    # the operator gave up
    (Ending(False, "aim: no preview was sure enough to hold"), run(), "aim: no preview was sure enough to hold"),
    (Ending(False, "out of reach: rigid target outside"), [], "out of reach: rigid target outside"),
    (Ending(False, "stopped: fault"), run(), "stopped: fault"),
    (Ending(False, "slip: it was not lifted"), run(), "slip: it was not lifted"),
    (Ending(False, "no path"), [], "plan refused: no path"),
    (Ending(False, ""), run(), "plan refused: "),
    # nothing was run to its end
    (DONE, [], "stopped: no plan was run to its end"),
    (DONE, [frame(0.0, "execute", HOLD)], "stopped: no plan was run to its end"),
    (DONE, [frame(0.0, "aim", HOLD)] * 2, "stopped: no plan was run to its end"),
    # lifted, from both sides of the border; it hangs
    (DONE, run(lifted=S.lifted), ""),
    (DONE, run(lifted=np.nextafter(S.lifted, 0)), LIFTED.format(1e3 * S.lifted)),
    (DONE, run(lifted=0.0), LIFTED.format(0)),
    *((DONE, run(lifted=S.lifted + 1e-3, low=low), "") for low in (-0.4, 0.7)),
    *((DONE, run(lifted=S.lifted - 1e-3, low=low), LIFTED.format(1e3 * S.lifted - 1)) for low in (-0.4, 0.7)),
    (DONE, run(lifted=np.nan), "slip: it was lifted by nan mm"),
    (DONE, run(hanging=True), LIFTED.format(2e3 * S.lifted) + ", and hangs"),
    (DONE, run(lifted=0.0, hanging=True), LIFTED.format(0) + ", and hangs"),
    # the arm never touched it
    (DONE, run(lifted=0.0, touched={}, grasped={}), "aim: the arm never touched it"),
    (DONE, run(hanging=True, touched={}, grasped={}), "aim: the arm never touched it"),
    (DONE, run(lifted=0.0, touched=HOLD, grasped={}), LIFTED.format(0)),
    (DONE, run(lifted=0.0, touched={}, grasped=HOLD), LIFTED.format(0)),
    # it touches more than the arm, in any frame from the end of the plan on
    (DONE, run(lies=(lying(), (), ())), MORE),
    (DONE, run(lies=((), lying(), ())), MORE),
    (DONE, run(lies=((), (), lying())), MORE),
    (DONE, run(lies=((), (), lying(NAN))), MORE),
    # it moves in the arm, from both sides of the border; with the arm it may
    (DONE, run(moved=np.nextafter(S.slip, 0)), ""),
    (DONE, run(moved=S.slip), MOVED.format(1e3 * S.slip)),
    (DONE, run(moved=10 * S.slip), MOVED.format(1e4 * S.slip)),
    (DONE, run(carried=10 * S.slip), ""),
    (DONE, run(moved=np.nan), "slip: it moved by nan mm in the arm as it was held"),
    (DONE, run(grasped={}), "slip: it moved by inf mm in the arm as it was held"),
    # which comes first
    (DONE, run(lifted=0.0, lies=(lying(),) * 3, moved=1.0), LIFTED.format(0)),
    (DONE, run(lies=(lying(),) * 3, moved=1.0), MORE),
])  # fmt: skip
def test_a_grasp_is_lifted_and_held_by_the_arm_alone_without_slip(ending, frames, cause):
    assert failure(ending, frames, S) == cause


def test_what_lies_before_it_is_lifted_does_not_count():
    frames = run()
    frames[0].truth.object_world = np.array(lying())
    assert failure(DONE, frames, S) == ""


@pytest.mark.parametrize(("lifted", "slipped", "hanging", "holding"), [
    (LIFT, 0.0, False, True),
    (np.nextafter(LIFT / 2, 1), 0.0, False, True),
    (LIFT / 2, 0.0, False, False),
    (np.nan, 0.0, False, False),
    (LIFT, np.nextafter(SLIP, 0), False, True),
    (LIFT, SLIP, False, False),
    (LIFT, np.nan, False, False),
    (LIFT, np.inf, False, False),
    (LIFT, 0.0, True, False),
])  # fmt: skip
def test_the_first_grasps_hold_what_is_lifted_does_not_slip_and_does_not_hang(lifted, slipped, hanging, holding):
    assert bool(holds(lifted, slipped, hanging)) is holding


def centres(**moved) -> np.ndarray:
    places = np.zeros((UNITS, 3))
    for unit, x in moved.items():
        places[int(unit[1:]), 0] = x
    return places


@pytest.mark.parametrize(("object", "place", "units", "moved"), [
    (HOLD, (0.0, 0.0, 0.0), centres(), 0.0),
    (HOLD, (0.03, 0.0, 0.04), centres(), 0.05),
    (HOLD, (0.05, 0.0, 0.0), centres(u2=0.05), 0.0),
    (HOLD, (0.0, 0.0, 0.0), centres(u2=0.05), 0.05),
    (HOLD, (0.0, 0.0, 0.0), centres(u0=0.05, u1=0.05, u3=0.05, u4=0.05, u5=0.05), 0.0),  # these did not hold it
    ({2: FORCE, 4: FORCE}, (0.0, 0.0, 0.0), centres(u4=0.05), 0.025),  # against the middle of those that did
    ({}, (0.0, 0.0, 0.0), centres(), np.inf),
    (HOLD, (np.nan, 0.0, 0.0), centres(), np.nan),
])  # fmt: skip
def test_how_far_it_moved_in_the_arm_is_against_the_units_that_held_it_before(object, place, units, moved):
    after = frame(1.0, "aim", {0: FORCE}, place=place, units=units)  # which units touch it then does not count
    assert in_arm(frame(0.0, "aim", object), after) == pytest.approx(moved, nan_ok=True)


@pytest.mark.parametrize(("modes", "first"), [
    ("", None), ("a", None), ("e", None), ("ae", None), ("aee", None), ("ea", 1), ("aeea", 3), ("eaea", 1), ("eh", 1),
])  # fmt: skip
def test_a_grasp_is_over_in_the_first_frame_after_the_first_execution(modes, first):
    names = {"a": "aim", "e": "execute", "h": "hold"}
    frames = [frame(float(now), names[mode]) for now, mode in enumerate(modes)]
    assert executed(frames) is (None if first is None else frames[first])


MASS = 0.2
SCENE = LabScene(
    -0.75,
    SceneObject("cylinder", 0.05, 0.1, MASS, [0.5, 0.0, 0.5], hanging=True),
    {TABLE: SupportSurface([1.0, 0.0, -0.1], [0.5, 0.5, 0.03], "wood")},
    [0.5, 0.0, 0.9],
)  # its names: the floor, the table, the hook
HALF = BORNE * MASS * STANDARD_GRAVITY


def borne(by_table: float = 2 * HALF, by_floor: float = 0.0) -> tuple:
    return ((0.0, 0.0, by_floor), (0.0, 0.0, by_table), (0.0, 0.0, 0.0))


def handed(lies=None, speed=(0.0, 0.0, 0.0), object=None, over=(1.0, 0.0, 0.0), second=True):
    """Frames of a grasp and of a hand-over, `over` which the object is brought."""
    place, mode = over, "execute" if second else "aim"
    bring = [frame(3.0, mode, HOLD, lies=borne(0), place=place), frame(4.0, mode, HOLD, lies=borne(0), place=(0, 0, 0))]
    last = frame(5.0, "aim", object or {}, lies=borne() if lies is None else lies, speed=np.array(speed), place=place)
    lifted = frame(1.0, "aim", HOLD, lies=borne(0), place=(0.0, 0.0, 1.0))
    return [frame(0.0, "execute", HOLD, lies=borne(0)), lifted, *bring, last]


STAYED = "missed: it did not stay on the table"
ON_ITS_WAY = "slip: it was dropped on its way"
NOWHERE = "slip: it was dropped before it was brought anywhere"


@pytest.mark.parametrize(("ending", "frames", "cause"), [
    (DONE, handed(), ""),
    # as of a grasp
    (Ending(False, "aim: no preview was sure enough to rest"), handed(), "aim: no preview was sure enough to rest"),
    (Ending(False, "slip: it was not lifted"), handed(), "slip: it was not lifted"),
    (Ending(False, "no path"), handed(), "plan refused: no path"),
    (Ending(False, ""), handed(), "plan refused: "),
    (DONE, [], "stopped: no plan was run to its end"),
    (DONE, handed()[:1], "stopped: no plan was run to its end"),
    # borne by the table, from both sides of the border; by something else
    (DONE, handed(borne(np.nextafter(HALF, 9))), ""),
    (DONE, handed(borne(HALF)), STAYED),
    (DONE, handed(borne(0)), STAYED),
    (DONE, handed(borne(-2 * HALF)), STAYED),
    (DONE, handed(borne(0, by_floor=2 * HALF)), STAYED),
    (DONE, handed(borne(np.nan)), STAYED),
    # half its weight, and less than 3 cm in a second
    (DONE, handed(borne(0.51 * MASS * STANDARD_GRAVITY), speed=(0.029, 0.0, 0.0)), ""),
    (DONE, handed(borne(0.49 * MASS * STANDARD_GRAVITY), speed=(0.029, 0.0, 0.0)), STAYED),
    (DONE, handed(borne(0.51 * MASS * STANDARD_GRAVITY), speed=(0.031, 0.0, 0.0)), STAYED),
    # at rest, from both sides of the border
    (DONE, handed(speed=(0.0, 0.0, np.nextafter(STILL, 0))), ""),
    (DONE, handed(speed=(0.0, 0.0, STILL)), STAYED),
    (DONE, handed(speed=(-STILL, 0.0, 0.0)), STAYED),
    (DONE, handed(speed=(np.nan, 0.0, 0.0)), STAYED),
    (DONE, handed(borne(0), speed=(STILL, 0.0, 0.0)), STAYED),
    # let go
    (DONE, handed(object={5: FORCE}), "stopped: the arm still touches it"),
    (DONE, handed(object={5: NAN}), "stopped: the arm still touches it"),
    (DONE, handed(borne(0), object={5: FORCE}), STAYED),
    # dropped: before a second plan, before the table, at its edge on both sides, along each axis
    (DONE, handed(borne(0), second=False), NOWHERE),
    (DONE, handed(borne(0), over=(0.5, 0.0, 0.0)), ON_ITS_WAY),
    (DONE, handed(borne(0), over=(0.75, 0.0, 0.0)), STAYED),
    (DONE, handed(borne(0), over=(0.749, 0.0, 0.0)), ON_ITS_WAY),
    (DONE, handed(borne(0), over=(1.0, 0.25, 0.0)), STAYED),
    (DONE, handed(borne(0), over=(1.0, 0.251, 0.0)), ON_ITS_WAY),
    (DONE, handed(borne(0), over=(1.0, -0.251, 0.0)), ON_ITS_WAY),
    (DONE, handed(over=(0.5, 0.0, 0.0)), ""),  # it rests there, however it came
])  # fmt: skip
def test_a_hand_over_ends_at_rest_on_the_table_alone(ending, frames, cause):
    assert why_not(ending, frames, SCENE, S) == cause


@pytest.mark.parametrize(("probability", "succeeded", "expected"), [
    (1.0, True, 1.0), (1.0, False, 0.0), (0.0, False, 1.0), (0.0, True, 0.0),
    (0.5, True, 1.0), (0.5, False, 0.0), (np.nextafter(0.5, 0), True, 0.0), (np.nextafter(0.5, 0), False, 1.0),
    (np.nan, True, np.nan), (np.nan, False, np.nan), (np.inf, True, np.nan),
])  # fmt: skip
def test_a_preview_agrees_where_the_likelier_came(probability, succeeded, expected):
    np.testing.assert_equal(agreed(probability, succeeded), expected)


TIMES = np.array([1.0, 2.0, 3.0])
SHOWN = np.array([[0.0, 0.0, 0.0], [1.0, 0.0, 0.0], [1.0, 1.0, 0.0]])


def at(time: float, *tip: float) -> tuple[float, np.ndarray]:
    return time, np.array(tip)


@pytest.mark.parametrize(("tips", "expected"), [
    ([at(1.5, 0.5, 0.0, 0.0)], 0.0),
    ([at(1.5, 0.5, 0.0, 0.02)], 0.02),
    ([at(1.0, 0.0, 0.03, 0.04), at(3.0, 1.0, 1.0, 0.05)], 0.05),  # both ends count
    ([at(0.99, 9.0, 9.0, 9.0), at(2.5, 1.0, 0.5, 0.01), at(3.01, 9.0, 9.0, 9.0)], 0.01),  # what is beyond does not
    ([at(1.5, 0.5, 0.0, z) for z in (0.01, 0.02, 0.09)], 0.02),  # the median
    ([at(1.5, np.nan, 0.0, 0.0)], np.nan),
    ([at(0.5, 0.0, 0.0, 0.0)], np.nan),
    ([], np.nan),
])  # fmt: skip
def test_paths_are_compared_at_the_same_time(tips, expected):
    assert tip_difference(tips, TIMES, SHOWN) == pytest.approx(expected, abs=1e-12, nan_ok=True)


def session(begins: float = 10.0):
    nominal = SimpleNamespace(time=TIMES, tip=SHOWN[None])
    preview = SimpleNamespace(nominal=nominal)
    package = SimpleNamespace(geometry=SimpleNamespace(length=0.4))
    foreseen = SimpleNamespace(preview=preview, begins=begins)
    return SimpleNamespace(prediction=foreseen, package=package, tips=[at(begins + 1.5, 0.5, 0.0, 0.02)])


@pytest.mark.parametrize(("probability", "foreseen", "expected"), [
    (0.75, True, (3, 0.75, 1.0, 5.0)),
    (0.25, True, (3, 0.25, 0.0, 5.0)),
    (np.nan, True, (3, np.nan, np.nan, np.nan)),
    (0.75, False, (3, 0.75, 1.0, np.nan)),
])  # fmt: skip
def test_what_was_stated_of_a_grasp_is_told_with_how_far_off_its_path_was(probability, foreseen, expected):
    result, ran = Result("grasp", 0, True), session()
    ran.prediction = ran.prediction if foreseen else None
    tell(result, Ending(True, plans=3, probability=probability), ran, True)  # type: ignore[arg-type]
    np.testing.assert_allclose((result.plans, result.probability, result.agreed, result.path_pct), expected)
