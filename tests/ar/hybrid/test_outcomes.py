"""Objects that rest on a board, and objects that do not."""

import mujoco
import numpy as np
import pytest

from trunkline.ar.hybrid.outcomes import LAST, STILL, RestCriterion
from trunkline.ar.hybrid.rollouts import Piece

TIME = np.linspace(0.0, 4.0, 81)
# an object that slides up to a unit of the arm, 0.1 m above
MODEL = mujoco.MjModel.from_xml_string("""
<mujoco><worldbody>
  <geom size="0.02" pos="0 0 0.1" contype="2" conaffinity="10"/>
  <body name="object"><joint type="slide" axis="0 0 1"/><geom size="0.02" contype="4" conaffinity="14"/></body>
</worldbody></mujoco>""")
RESTING = RestCriterion(1.0, np.array([-0.3, -0.3, -0.13]), np.array([0.3, 0.3, -0.1]), MODEL)
SET_DOWN = np.where(TIME[:, None] < 1.0, [0.1, 0.0, 0.0], [0.1, 0.0, -0.05])


def motion(path: np.ndarray, sound: bool = True) -> Piece:
    none = np.zeros((1, len(TIME), 3))
    pose = np.concatenate([path, np.tile([1.0, 0, 0, 0], (len(TIME), 1))], axis=1)[None]
    return Piece(TIME, np.zeros((1, len(TIME), 1)), none, none, pose, none, np.zeros((1, len(TIME))), np.array([sound]))


@pytest.mark.parametrize(("height", "rests"), [(0.0, True), (0.059, True), (0.061, False), (np.nan, True)])
def test_what_the_arm_still_touches_does_not_rest(height, rests):
    motion_at_rest = motion(SET_DOWN)
    motion_at_rest.qpos[:, -1] = height
    assert RESTING.holds(motion_at_rest)[0] == rests


def test_a_future_that_is_not_sound_does_not_count():
    assert not RESTING.holds(motion(SET_DOWN, sound=False))[0]


NEAR = 1e-6
LATE_FRAMES = TIME[-1] - LAST + 1e-9 < TIME  # after the frame with which the last one is compared


def shifted(by, frames=slice(None)) -> np.ndarray:
    path = SET_DOWN.copy()
    path[frames] += by
    return path


BORDERS = {
    "as it is": (SET_DOWN, True),
    "over the board's near side": (shifted([-0.4 + NEAR, 0, 0]), True),
    "beside its near side": (shifted([-0.4 - NEAR, 0, 0]), False),
    "over its far side": (shifted([0.2 - NEAR, 0, 0]), True),
    "beside its far side": (shifted([0.2 + NEAR, 0, 0]), False),
    "over its left": (shifted([0, 0.3 - NEAR, 0]), True),
    "beside its left": (shifted([0, 0.3 + NEAR, 0]), False),
    "over its right": (shifted([0, -0.3 + NEAR, 0]), True),
    "beside its right": (shifted([0, -0.3 - NEAR, 0]), False),
    "just above the board": (shifted([0, 0, -0.05 + NEAR]), True),
    "in the board": (shifted([0, 0, -0.05 - NEAR]), False),
    "higher than as it was let go by less than it may move": (shifted([0, 0, STILL - NEAR], TIME > 1.0), True),
    "higher by more": (shifted([0, 0, STILL + NEAR], TIME > 1.0), False),
    "moved by less than it may at last": (shifted([STILL - NEAR, 0, 0], LATE_FRAMES), True),
    "by more": (shifted([STILL + NEAR, 0, 0], LATE_FRAMES), False),
    "by more, downwards": (shifted([0, 0, -STILL - NEAR], LATE_FRAMES), False),
    "rolled before": (shifted([0.1, 0, 0], TIME > 2.0), True),
    "not seen at last": (shifted(np.nan, TIME > 3.9), False),
    "not seen when it was let go": (shifted(np.nan, np.abs(TIME - 1.0) < 0.01), False),
    "not seen a while before the end": (shifted(np.nan, np.abs(TIME - TIME[-1] + LAST) < 0.01), False),
}  # fmt: skip


@pytest.mark.parametrize("name", BORDERS)
def test_what_rests(name):
    path, rests = BORDERS[name]
    assert RESTING.holds(motion(path)).tolist() == [rests]


@pytest.mark.parametrize(
    ("place", "last", "rests"),
    [([0.0, 0.0, -0.05], None, True), ([-0.3, 0.3, -0.05], None, True), ([0.3, -0.3, -0.05], None, True),
     ([0.0, 0.0, -0.1], None, False), ([0.0, 0.0, -0.05], [STILL, 0.0, -0.05], False)],
)  # fmt: skip
def test_at_a_border_itself(place, last, rests):
    """Over the board's edge it rests; in its surface, or moved by just as much as it may, it does not."""
    path = np.tile(place, (len(TIME), 1))
    if last is not None:
        path[-1] = last
    assert RESTING.holds(motion(path)).tolist() == [rests]
