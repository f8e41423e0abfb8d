"""Labels for the rigid map: can inverse kinematics bring the mount to a point, straight down?

The map comes from forward kinematics of exact samples; the labels come from a damped least-squares solver
that knows nothing of them, and is not told what the map says: every point that the first starts do not reach gets
the same further ones, but for points that the links' lengths rule out. Both stand on the same kinematics, limits and
collisions; docs/measurements/kinematics.md compares them with another solver on another Panda.
"""

from typing import NamedTuple

import numpy as np

from trunkline.compute.scheduler import spread_rows
from trunkline.errors import InputError
from trunkline.kinematics.panda.inverse import solve
from trunkline.kinematics.panda.kinematics import DH_A, DH_D, FLANGE

LEAST = 100  # points that are worth being sent to another machine


class Agreement(NamedTuple):
    """How a map agrees with labels: shares of all points, of reachable ones, of unreachable ones, and counts."""

    accuracy: float
    tpr: float
    fpr: float
    reachable: int
    unreachable: int


def draw_points(lower: np.ndarray, upper: np.ndarray, count: int, seed: int) -> np.ndarray:
    """`count` points (count, 3), uniform in a box, in m."""
    return np.random.default_rng(seed).uniform(lower, upper, size=(count, 3))


def beyond_links(points: np.ndarray, mount_offset: float) -> np.ndarray:
    """Points (N,) that no joint angles can reach, by the triangle inequality alone.

    Pointing down, the wrist is `FLANGE + mount_offset` above the mount and a_7 beside it, and no further from the
    shoulder than both link lengths.
    """
    upper_arm, forearm = np.hypot(DH_D[2], DH_A[3]), np.hypot(DH_D[4], DH_A[4])
    beside = np.maximum(np.hypot(points[:, 0], points[:, 1]) - DH_A[6], 0.0)
    above = points[:, 2] + FLANGE + mount_offset - DH_D[0]
    return np.hypot(beside, above) > upper_arm + forearm


def label(
    points: np.ndarray,
    *,
    seed: int,
    starts: int,
    starts_in_doubt: int,
    mount_offset: float,
    avoid_collisions: bool,
) -> np.ndarray:
    """Whether the solver reaches each of `points` (N, 3) with the end effector straight down. Shape (N,).

    Args:
        points: in m.
        seed: of the random starts.
        starts: most starts for every point.
        starts_in_doubt: most further starts for every point that those do not reach.
        mount_offset: from the flange to the mount, in m.
        avoid_collisions: whether solutions in which the arm touches itself count.
    """
    reached = np.zeros(len(points), dtype=bool)
    todo = np.flatnonzero(~beyond_links(points, mount_offset))
    for round_seed, round_starts in ((seed, starts), (seed + 1, starts_in_doubt)):
        how = {"seed": round_seed, "starts": round_starts, "mount_offset": mount_offset,
               "avoid_collisions": avoid_collisions}
        (success,) = spread_rows(_reached, (np.arange(len(todo)),), (points[todo], how), LEAST)
        reached[todo] = success
        todo = todo[~success]
    return reached


def _reached(fixed: tuple[np.ndarray, dict], rows: tuple[np.ndarray]) -> tuple[np.ndarray]:
    """Whether the solver reaches some of the points (N, 3), those with the numbers (n,) in `rows`. Shape (n,)."""
    (points, how), (numbers,) = fixed, rows
    return (solve(points, only=numbers, **how).success[numbers],)


def agreement(claimed: np.ndarray, reachable: np.ndarray) -> Agreement:
    """Accuracy, true and false positive rates of `claimed` (N,) against labels `reachable` (N,).

    Raises:
        InputError: if all labels are the same, so that a rate would have nothing to stand on.
    """
    yes, no = int(reachable.sum()), int((~reachable).sum())
    if not yes or not no:
        raise InputError(f"params.yaml: reachability.labels: found {yes} reachable and {no} unreachable points, "
                         "expected some of both; a larger `count` or `margin` gives them")
    return Agreement(float((claimed == reachable).mean()), float(claimed[reachable].mean()),
                     float(claimed[~reachable].mean()), yes, no)
