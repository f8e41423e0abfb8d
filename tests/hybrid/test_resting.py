"""Things that rest on a board, and things that do not."""

import numpy as np
import pytest

from trunkline.hybrid.futures import Piece
from trunkline.hybrid.resting import Resting

TIME = np.linspace(0.0, 4.0, 81)
RESTING = Resting(1.0, np.array([-0.3, -0.3, -0.13]), np.array([0.3, 0.3, -0.1]))
SET_DOWN = np.where(TIME[:, None] < 1.0, [0.1, 0.0, 0.0], [0.1, 0.0, -0.05])


def motion(path: np.ndarray, sound: bool = True) -> Piece:
    none = np.zeros((1, len(TIME), 3))
    pose = np.concatenate([path, np.tile([1.0, 0, 0, 0], (len(TIME), 1))], axis=1)[None]
    return Piece(TIME, np.zeros((1, len(TIME), 1)), none, none, pose, none, np.zeros((1, len(TIME))), np.array([sound]))


CASES = {
    "set down": (SET_DOWN, True),
    "rolls on": (SET_DOWN + 0.03 * np.outer(np.maximum(TIME - 1.0, 0), [1, 0, 0]), False),
    "beside the board": (SET_DOWN + [0.25, 0, 0], False),
    "fell off": (SET_DOWN - np.outer(TIME > 2.0, [0, 0, 0.5]), False),
    "carried off": (SET_DOWN + np.outer(TIME > 2.0, [0, 0, 0.2]), False),
    "lost": (SET_DOWN * np.nan, False),
}


@pytest.mark.parametrize("name", CASES)
def test_what_rests(name):
    path, rests = CASES[name]
    assert RESTING.holds(motion(path))[0] == rests


def test_a_future_that_is_not_sound_does_not_count():
    assert not RESTING.holds(motion(SET_DOWN, sound=False))[0]
