"""What counts as held, and what a preview says of its futures: every criterion decides somewhere, from both sides."""

from dataclasses import replace

import numpy as np
import pytest

from trunkline.ar.hybrid.assistant import surest
from trunkline.ar.hybrid.outcomes import Holding
from trunkline.ar.hybrid.rates import wilson
from trunkline.ar.hybrid.rollout_batch import PlanPreview, interruptible, joined, offsets_of
from trunkline.ar.hybrid.rollouts import Piece
from trunkline.ar.hybrid.tip_uncertainty import BaseAlignment, TipUncertainty
from trunkline.ar.hybrid.uncertainty import nominal_sample
from trunkline.twin.discrepancy import Discrepancy

FRAMES, SINCE = 11, 0.5
TIME = np.linspace(0.0, 1.0, FRAMES)
FIRST = 5  # the frame at SINCE
HOLDING = Holding(SINCE, sag=0.08, slip=0.02, lifted=0.05)
NEAR = 1e-6  # m, to either side of a border


def piece(tips=None, sound=(True,), **paths) -> Piece:
    """Futures that are well held and lifted by 0.1 m before SINCE, with other `paths`."""
    count = len(sound)
    nothing = np.zeros((count, FRAMES, 3))
    grip = nothing + [0.1, 0.0, -0.2]
    grip[:, FIRST:, 2] += 0.1
    rows = {"mount": nothing.copy(), "grip": grip, "away": np.full((count, FRAMES), 0.03)} | paths
    pose = np.full((count, FRAMES, 7), np.nan)
    return Piece(
        TIME, np.zeros((count, FRAMES, 1)), nothing if tips is None else tips, rows["mount"], pose, rows["grip"],
        rows["away"], np.array(sound),
    )  # fmt: skip


def changed(name: str, frame: int | slice, by) -> Piece:
    """That piece, with `by` more of what is called so in these frames."""
    made = piece()
    getattr(made, name)[:, frame] += by
    return made


def carried(by) -> Piece:
    """That piece, its mount and what the arm wraps moved alike, `by` m in the end."""
    made = changed("grip", -1, by)
    made.mount[:, -1] += by
    return made


HOLD_CASES = {
    "as it is": (piece(), True),
    "moved against the mount by less than it may": (changed("grip", -1, [HOLDING.sag - NEAR, 0, 0]), True),
    "by more": (changed("grip", -1, [HOLDING.sag + NEAR, 0, 0]), False),
    "by more, upwards": (changed("grip", -1, [0, 0, HOLDING.sag + NEAR]), False),
    "moved by more before it lost its support": (changed("grip", slice(1, FIRST), [1.0, 0, 0]), True),
    "moved by more on the way, and back": (changed("grip", slice(FIRST + 1, -1), [1.0, 0, 0]), True),
    "carried about with the mount": (carried([1.0, 0.5, 0.2]), True),
    "left behind by the mount": (changed("mount", -1, [HOLDING.sag + NEAR, 0, 0]), False),
    "slipped by less than it may": (changed("away", -1, HOLDING.slip - NEAR), True),
    "slipped by more": (changed("away", -1, HOLDING.slip + NEAR), False),
    "far from the arm already when it lost its support": (changed("away", slice(FIRST, None), 1.0), True),
    "came nearer": (changed("away", -1, -0.02), True),
    "lifted by a little more than it must": (changed("grip", slice(FIRST, None), [0, 0, -0.05 + NEAR]), True),
    "by a little less": (changed("grip", slice(FIRST, None), [0, 0, -0.05 - NEAR]), False),
    "lifted only afterwards": (changed("grip", FIRST, [0, 0, -0.06]), False),
    "lost at the end": (changed("grip", -1, np.nan), False),
    "lost when it lost its support": (changed("grip", FIRST, np.nan), False),
    "its distance lost": (changed("away", -1, np.nan), False),
    "where it began is not known": (changed("grip", 0, np.nan), False),
    "diverged": (piece(sound=(False,)), False),
}  # fmt: skip


@pytest.mark.parametrize("name", HOLD_CASES)
def test_what_counts_as_held(name):
    motion, holds = HOLD_CASES[name]
    assert HOLDING.holds(motion).tolist() == [holds]


EXACT = Holding(SINCE, sag=0.5, slip=0.25, lifted=0.125)  # numbers that are exact


@pytest.mark.parametrize(("name", "by"), [("mount", [0.5, 0, 0]), ("away", 0.25), ("grip", [0, 0, -0.125])])
def test_at_a_border_itself_nothing_is_held(name, by):
    made = piece(away=np.zeros((1, FRAMES)), grip=np.zeros((1, FRAMES, 3)))
    made.grip[:, FIRST:, 2] = 0.25
    assert EXACT.holds(made).tolist() == [True]
    getattr(made, name)[:, -1 if name != "grip" else slice(FIRST, None)] += by
    assert EXACT.holds(made).tolist() == [False]


def test_each_future_is_judged_by_itself():
    motion = piece(sound=(True, False, True, True))
    motion.away[2, -1] += 1.0
    np.testing.assert_array_equal(HOLDING.holds(motion), [True, False, False, True])


def test_what_hung_need_not_have_been_lifted():
    motion = changed("grip", slice(FIRST, None), [0, 0, -0.1])
    assert Holding(SINCE).holds(motion).tolist() == [True]
    assert Holding(SINCE, lifted=-0.01).holds(motion).tolist() == [True]
    assert Holding(SINCE, lifted=0.0).holds(motion).tolist() == [False]


def of_futures(tips, sound, success=None) -> PlanPreview:
    made = piece(tips, sound)
    return PlanPreview(piece(), made, nominal_sample(), None if success is None else np.array(success))


def test_the_probability_is_the_share_of_all_futures_and_its_interval_is_wilsons():
    result = of_futures(None, (True, True, False, True), (True, False, False, True))
    assert result.probability == 0.5
    assert result.interval == wilson(2, 4)
    assert of_futures(None, (True,)).probability is None
    assert of_futures(None, (True,)).interval is None


def test_futures_that_are_not_sound_say_nothing_of_where_the_tip_comes():
    """Four around 0, one of them shown; a fifth, which diverged, is far away, and would be so of the nearest."""
    tips = np.zeros((5, FRAMES, 3))
    tips[:, :, 0] = np.array([-0.03, -0.01, 0.01, 0.02, 90.0])[:, None]
    result = of_futures(tips, (True, True, True, True, False))
    np.testing.assert_allclose(result.median[:, 0], 0.0)
    assert result.middle in (1, 2)
    np.testing.assert_allclose(result.spread, np.quantile([0.01, 0.01, 0.02, 0.03], 0.9))
    tips[4, :, 0] = 0.0
    assert of_futures(tips, (True, True, True, True, False)).middle in (1, 2)


def test_pieces_that_are_joined_are_sound_as_the_last_is():
    first, last = piece(sound=(True, True)), piece(sound=(True, False))
    assert joined([first, last]).sound.tolist() == [True, False]


class Unwanted(Exception):
    """What ends a preview from outside."""


@pytest.mark.parametrize("after", [0, 1, 2, 3])
def test_it_is_asked_before_each_piece_and_after_the_last_whether_to_go_on(after):
    taken, calls = [], []

    def go_on():
        calls.append(None)
        if len(calls) > after:
            raise Unwanted

    with pytest.raises(Unwanted):
        taken.extend(interruptible(iter("abc"), go_on))
    assert "".join(taken) == "abc"[:after]


@pytest.mark.parametrize(
    ("offsets", "shares", "order"),
    [([3, 1, 2], [0.5, 0.5, 0.5], [1, 2, 0]), ([3, 1, 2], [0.9, 0.5, 0.5], [0, 1, 2]), ([1], [0], [0]),
     ([3, 1, 2], [0.9, 0.5, 0.9], [2, 0, 1]), ([3, 1, 2, 4], [0.5, 0.25, 0.5, 0.75], [3, 2, 0, 1])],
)  # fmt: skip
def test_the_assistants_places_come_with_the_surest_first_and_of_equals_the_nearest(offsets, shares, order):
    assert surest(np.outer(offsets, [0.0, 0.01, 0.0]), np.array(shares)).tolist() == order


@pytest.mark.parametrize(
    ("name", "by", "holds"),
    [("grip", [0.079, 0, 0], True), ("grip", [0.081, 0, 0], False), ("away", 0.019, True), ("away", 0.021, False)],
)
def test_unless_it_is_said_otherwise_8_cm_against_the_mount_and_2_from_the_arm_are_held(name, by, holds):
    assert Holding(SINCE).holds(changed(name, -1, by)).tolist() == [holds]


def test_a_spread_is_about_the_median_wherever_that_is_and_so_is_what_is_shown():
    tips = np.zeros((3, FRAMES, 3)) + [5.0, -2.0, 1.0]
    tips[:, :, 0] += np.array([-0.2, 0.0, 0.1])[:, None]
    result = of_futures(tips, (True, True, True))
    assert result.middle == 1
    np.testing.assert_allclose(result.spread, np.quantile([0.2, 0.0, 0.1], 0.9))


def test_a_spread_is_stated_every_tenth_of_a_second_of_sixtieth_frames():
    stated = replace(of_futures(None, (True,)), offsets=np.zeros((1, 1, 3))).stated
    np.testing.assert_array_equal(stated.times, TIME[[0, 6]])
    assert len(stated.tips) == len(stated.radii) == 2


def test_where_what_the_model_lacks_is_unknown_no_radius_is_stated():
    stated = of_futures(None, (True,)).stated
    assert (len(stated.tips), len(stated.radii)) == (2, 0)


@pytest.mark.parametrize("offset", [0.001, 0.05])
def test_what_the_model_lacks_widens_the_radius_about_the_nominal_tip(offset):
    at = np.array([0.3, -0.2, 0.1])
    tips = np.zeros((2, FRAMES, 3)) + at + [0.01, 0.0, 0.0]
    lacking = Discrepancy(np.array([[offset, 0.0, 0.0]]), 16)
    believed = piece(np.zeros((1, FRAMES, 3)) + at, mount=np.zeros((1, FRAMES, 3)) + at + [0.0, 0.0, 0.5])
    tip = TipUncertainty(lacking, np.zeros(2), np.zeros(3), BaseAlignment(0.0, 0.0), np.eye(3))
    drawn = offsets_of(tip, believed, 2, 0)
    result = PlanPreview(believed, piece(tips, (True, True)), nominal_sample(), None, drawn)
    np.testing.assert_array_equal(result.stated.tips, [at] * len(result.stated.tips))
    expected = np.quantile(np.linalg.norm(drawn + [0.01, 0, 0], axis=2), 0.9)
    np.testing.assert_allclose(result.stated.radii, expected)
    assert expected > 1.2 * offset
    np.testing.assert_allclose(drawn[..., 2], 0.0, atol=1e-12)
