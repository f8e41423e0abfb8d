"""Who is said to have followed, and how far the tip is told to have been from what it followed."""

from types import SimpleNamespace

import numpy as np
import pytest

from rehearsal.experiments.follow import Path, failure, interruption, tell
from rehearsal.experiments.result import Result
from rehearsal.operator.scripts import Ending
from tests.rehearsal.frames import frame
from trunkline.ar.teleop.core import STAYS

LONGEST, STEP = 1.0, 0.25  # s
BEGUN, SECONDS = 4.0, 8.0  # s; numbers of which floats have all
BEYOND = f"rigid target outside; {STAYS}"


def path() -> Path:
    made = Path(np.array([0.5, 0.0, 0.1]), 0.06, 0.12, SECONDS, np.random.default_rng(0))
    made.begin(BEGUN)
    return made


def views(notices: dict[float, str] | None = None, until: float = BEGUN + SECONDS + 2) -> list:
    """Every STEP s, with what the core notices at some times."""
    times = np.arange(0.0, until + STEP / 2, STEP)
    return [SimpleNamespace(now=now, intent=SimpleNamespace(notice=(notices or {}).get(now, ""))) for now in times]


def every(first: float, last: float) -> list[float]:
    return list(np.arange(first, last + STEP / 2, STEP))


def refused(first: float, last: float, why: str = "collision: arm") -> list[tuple[float, str]]:
    return [(now, why) for now in every(first, last)]


def noticed(first: float, last: float, notice: str = BEYOND) -> dict[float, str]:
    return dict.fromkeys(every(first, last), notice)


@pytest.mark.parametrize(("refusals", "notices", "cause"), [
    ([], {}, ""),
    # as long as it may be, and longer
    (refused(5.0, 6.0), {}, ""),
    (refused(5.0, 6.25), {}, "interrupted: collision: arm"),
    ([], noticed(5.0, 6.0), ""),
    ([], noticed(5.0, 6.25), "interrupted: out of reach"),
    # both together count as one, the last reason is told, and what is refused before what is noticed
    (refused(5.0, 5.75), noticed(6.0, 6.25), "interrupted: out of reach"),
    (refused(6.0, 6.25), noticed(5.0, 5.75), "interrupted: collision: arm"),
    (refused(5.0, 6.25), noticed(5.0, 6.25), "interrupted: collision: arm"),
    # one frame in which it moves begins anew
    (refused(5.0, 5.75) + refused(6.25, 7.0), {}, ""),
    (refused(5.0, 5.75) + refused(6.25, 7.5), {}, "interrupted: collision: arm"),
    # other notices are none
    ([], noticed(5.0, 9.0, "aim higher"), ""),
    ([], noticed(5.0, 9.0, ""), ""),
    # only while the path goes on, both ends included
    (refused(0.0, 3.75), noticed(0.0, 3.75), ""),
    (refused(12.25, 14.0), noticed(12.25, 14.0), ""),
    (refused(0.0, 5.0), {}, ""),
    (refused(0.0, 5.25), {}, "interrupted: collision: arm"),
    (refused(11.0, 14.0), {}, ""),
    (refused(10.75, 14.0), {}, "interrupted: collision: arm"),
    # the first is told
    (refused(5.0, 6.25, "first") + refused(8.0, 10.0, "second"), {}, "interrupted: first"),
])  # fmt: skip
def test_a_robot_that_stays_too_long_while_the_path_goes_on_is_interrupted(refusals, notices, cause):
    assert interruption(views(notices), refusals, path(), LONGEST) == cause


STOPPED = Ending(False, "stopped: the robot is in fault")
NEVER = "stopped: the path was never begun"


@pytest.mark.parametrize(("ending", "shown", "refusals", "cause"), [
    (Ending(True), views(), [], ""),
    (Ending(True), views(), refused(5.0, 9.0), "interrupted: collision: arm"),
    (STOPPED, views(), [], "stopped: the robot is in fault"),
    (STOPPED, views(), refused(5.0, 9.0), "stopped: the robot is in fault"),
    (Ending(False, ""), views(), [], "stopped: the operator gave up"),
    (Ending(True), [], [], NEVER),
    (Ending(True), views(until=BEGUN - STEP), [], NEVER),
    (Ending(True), views(until=BEGUN), [], ""),
    # anybody who saw it, within its time
    (Ending(True), views(until=BEGUN)[-1:], [], ""),
    (Ending(True), views(until=BEGUN + SECONDS)[-1:], [], ""),
    (Ending(True), views(until=BEGUN + SECONDS + STEP)[-1:], [], NEVER),
])  # fmt: skip
def test_a_path_is_followed_where_the_script_ended_well_and_nothing_interrupted(ending, shown, refusals, cause):
    assert failure(ending, shown, refusals, path(), LONGEST) == cause


def test_a_path_that_was_never_begun_was_not_followed():
    never = Path(np.zeros(3), 0.06, 0.12, SECONDS, np.random.default_rng(0))
    assert failure(Ending(True), views(), [], never, LONGEST) == NEVER


def result_of(delay: float, lag: float, off=(0.0, 0.0, 0.0), **more) -> Result:
    """Of a tip that is `off` from where the object was `lag` s before, in frames of all times."""
    way, result = path(), Result("follow", 0, True)
    frames = [frame(now, "follow", tip=way(now - lag) + off) for now in np.arange(0.0, 20.0, 1 / 60)]
    tell(result, way, delay, more.get("frames", frames), more.get("views", []))
    return result


@pytest.mark.parametrize("delay", [0.2, 0.5, 1.0])
def test_the_tip_is_compared_with_where_the_object_was_the_delay_before(delay):
    exact, early, late = (result_of(delay, lag) for lag in (delay, 0.0, 2 * delay))
    assert max(exact.tip_mm, exact.worst_mm, exact.nearest_mm) < 1e-9
    for other in (early, late):
        assert other.tip_mm > 1.0
        assert other.worst_mm > other.tip_mm > other.nearest_mm


def test_distances_are_the_median_the_95th_percentile_and_the_least_in_mm():
    way, offs = path(), np.linspace(0.0, 0.1, 101)
    times = np.linspace(BEGUN + 0.5, BEGUN + 0.5 + SECONDS, 101)
    along = [frame(now, "follow", tip=way(now - 0.5) + [0.0, 0.0, off]) for now, off in zip(times, offs, strict=True)]
    beyond = [frame(now, "follow", tip=np.full(3, 9.0)) for now in (times[0] - 0.01, times[-1] + 0.01)]
    result = result_of(0.5, 0.5, frames=[beyond[0], *along, beyond[1]])
    np.testing.assert_allclose((result.tip_mm, result.worst_mm, result.nearest_mm), (50, 95, 0), atol=1e-6)


def test_nothing_is_told_of_a_path_that_was_never_begun():
    result = result_of(0.5, 0.5, frames=[frame(0.0, "aim")])
    assert np.isnan([result.tip_mm, result.worst_mm, result.nearest_mm, result.robot_mm]).all()


def wish(now: float, off: float | None) -> SimpleNamespace:
    """A view of a tip that is `off` m from what the rays wanted; None where nothing was followed."""
    wanted = None if off is None else SimpleNamespace(tip=SimpleNamespace(position=(0.0, 0.0, 0.0)))
    return SimpleNamespace(now=now, tip=np.array([off or 0.0, 0.0, 0.0]), intent=SimpleNamespace(follow=wanted))


@pytest.mark.parametrize(("shown", "expected"), [
    ([wish(5.0, 0.01), wish(6.0, 0.02), wish(7.0, 0.09)], 20.0),
    ([wish(4.25, 9.0), wish(4.5, 0.01)], 10.0),  # from the delay after the beginning on
    ([wish(5.0, None), wish(6.0, 0.02)], 20.0),
    ([wish(5.0, None)], np.nan),
    ([], np.nan),
])  # fmt: skip
def test_what_the_robot_leaves_is_its_distance_from_what_the_rays_wanted(shown, expected):
    np.testing.assert_allclose(result_of(0.5, 0.5, views=shown).robot_mm, expected)
