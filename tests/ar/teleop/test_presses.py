"""Where a press puts the target, by a hand whose ray is kicked by it: the core itself, with its settings.

Assumed of the hand, about both axes across the ray: tremor of an amplitude of 0.05° at 8 to 12 Hz, noise of 0.02°; the
trigger turns the ray by 0.6 ± 0.25° over the last 60 to 110 ms. A hand that moves has turned by 30° in 0.6 s, and
arrived 0.15 to 0.5 s before it presses. The goals are those of docs/protocol.md.
"""

from dataclasses import replace

import numpy as np
import pytest
from scipy.spatial.transform import Rotation

from tests.support.operator import Operator, config
from trunkline.ar.teleop.minimum_jerk import minimum_jerk
from trunkline.frames import rotation_from_wxyz, wxyz_from_rotation

PRESSES, HZ, LENGTH = 100, 72.0, 1.0  # Hz of inputs; m from the hand to the target
TREMOR, TREMBLES, NOISE = 0.05, (8.0, 12.0), 0.02  # °, Hz, °
KICK, KICKS = (0.6, 0.25), (0.06, 0.11)  # °, mean and standard deviation; s before the press in which it comes
TURN, TAKES, RESTS = 30.0, 0.6, (0.15, 0.5)  # °, s, s
HELD = 1.5  # s for which the grips are held


@pytest.mark.parametrize(("moving", "goal"), [(False, 1.5e-3), (True, 2e-3)])
def test_a_press_under_a_kick_puts_the_target_where_it_was_meant(moving, goal):
    """The 95th percentile, m; and at least five times nearer than by the pose at the press."""
    rng = np.random.default_rng(0)
    taken, pressed = np.quantile([press(rng, moving) for _ in range(PRESSES)], 0.95, axis=0)
    assert taken <= goal
    assert pressed >= 5 * taken


def press(rng: np.random.Generator, moving: bool) -> tuple[float, float]:
    """How far the target that the core takes is from the one that was meant, and by the pose at the press, m."""
    operator = Operator(rays=replace(config().core.rays, start=LENGTH))
    operator.dt = 1 / HZ
    times = np.arange(-round(HELD * HZ), 1) / HZ
    turns = _hand(rng, times, moving)
    quaternions = list(map(tuple, wxyz_from_rotation(turns).tolist()))
    operator.wait(0.5, left={"quaternion": quaternions[0]})
    for time, quaternion in zip(times, quaternions, strict=True):
        pose = {"quaternion": quaternion, "grip": True, "trigger": bool(time == 0)}
        intent = operator.step(left=pose, right={"grip": True})
    assert intent.request is not None
    reference = operator.message.alignment
    assert reference is not None
    into = rotation_from_wxyz(np.array(reference.quaternion))
    start = np.array(reference.position) + into.apply(operator.message.left.position)
    meant, last = (start + into.apply(LENGTH * turn.apply([0.0, 0.0, -1.0])) for turn in (_meant(moving), turns[-1]))
    taken = np.array(intent.request.targets.rigid.position)
    return float(np.linalg.norm(taken - meant)), float(np.linalg.norm(last - meant))


def _meant(moving: bool) -> Rotation:
    return Rotation.from_euler("y", TURN if moving else 0.0, degrees=True)


def _hand(rng: np.random.Generator, times: np.ndarray, moving: bool) -> Rotation:
    """How the ray is turned at `times`, s, of which the last is the press."""
    rates, phases = rng.uniform(*TREMBLES, 2), rng.uniform(0, 2 * np.pi, 2)
    off = TREMOR * np.sin(2 * np.pi * rates * times[:, None] + phases) + rng.normal(scale=NOISE, size=(len(times), 2))
    off[:, 0] += rng.normal(*KICK) * np.clip(1 + times / rng.uniform(*KICKS), 0, 1)
    share = np.clip((times + rng.uniform(*RESTS) + TAKES) / TAKES, 0, 1)
    along = minimum_jerk(share, TURN) if moving else np.zeros(len(times))
    away = Rotation.from_rotvec(np.column_stack([off, np.zeros(len(times))]), degrees=True)
    return Rotation.from_euler("y", along[:, None], degrees=True) * away
