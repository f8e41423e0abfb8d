"""Tendon lengths made exact: Gauss-Newton on the forward kinematics, from the lengths that the network gives.

With r the pose that is missing (position in m, turn in rad times a lever) and P = ∂(pose)/∂T, C = ∂l/∂T at the
equilibrium, a step is

    min |r - P δT|²   over  0 ≤ T + δT ≤ F, no more than two tendons of a section taut,     l ← l + C δT.

Tensions say which tendons are taut, lengths are what the tip follows most evenly; so the
step is found in the first and taken in the second. Two taut tendons a section are as many as the data set has.
"""

from dataclasses import dataclass
from itertools import combinations

import numpy as np

from trunkline.frames import rotation_from_wxyz
from trunkline.kinematics.dataset.sampling import sections
from trunkline.kinematics.ik.bounded_least_squares import bounded_least_squares
from trunkline.kinematics.ik.inputs import gravity_of, position_of, quaternion_of
from trunkline.model.statics.chain import Chain
from trunkline.model.statics.equilibria import Equilibrium, actuated, forward
from trunkline.model.statics.restart import restart
from trunkline.model.statics.sensitivity import sensitivity

SPARE = 2e-3  # m that slack tendons get beyond the path foreseen, so that none pulls where the tip turns out elsewhere
SWEEPS = 12  # over the sections of an arm that has several, each solved while the others hold
NEGLIGIBLE = 1e-6  # m, pose error below which no further step is taken


@dataclass
class RefinedLengths:
    """N answers.

    Attributes:
        lengths: path length of each tendon at the equilibrium found, m. Shape (N, K).
        commands: of the position actuators, that hold it, m. Shape (N, K).
        position_error: of the tip at that equilibrium, m. Shape (N,).
        orientation_error: rad. Shape (N,).
        steps: Gauss-Newton steps taken. Shape (N,).
        converged: whether an equilibrium was found at all; errors are infinite where not. Shape (N,).
    """

    lengths: np.ndarray
    commands: np.ndarray
    position_error: np.ndarray
    orientation_error: np.ndarray
    steps: np.ndarray
    converged: np.ndarray


def refine(
    chain: Chain,
    targets: np.ndarray,
    lengths: np.ndarray,
    steps: int = 3,
    lever: float = 0.02,
    commands: np.ndarray | None = None,
) -> RefinedLengths:
    """Lengths that bring the tip nearer to its targets, never further from them.

    Args:
        targets: gravity, tip position in m and quaternion (w first) in the base frame. Shape (N, 7, 8 or 10).
        lengths: first answers, m, for instance the network's. Shape (N, K).
        steps: most Gauss-Newton steps for each target.
        lever: m; a turn of the tip by 1 rad counts as this much distance.
        commands: of the actuators, m, to begin with in place of the lengths. Of an arm of several sections these
            tell the pose better: cables at one distance from the axis, all a little too short, hold none at all.
            Shape (N, K).
    """
    gravity = gravity_of(targets)
    best = forward(chain, lengths, gravity) if commands is None else actuated(chain, commands, gravity)
    error = _missing_pose(best, targets, lever)
    size = np.where(best.converged, np.linalg.norm(error, axis=1), np.inf)
    taken = np.zeros(len(targets), int)
    going = best.converged & (size > NEGLIGIBLE)
    for _ in range(steps):
        rows = np.flatnonzero(going)
        if not len(rows):
            break
        tensions, lengths_to_hold = _step(chain, best[rows], error[rows], gravity[rows], lever)
        moved = restart(chain, best.qpos[rows], tensions, lengths_to_hold, gravity[rows])
        missing = _missing_pose(moved, targets[rows], lever)
        better = moved.converged & (np.linalg.norm(missing, axis=1) < size[rows])
        at = rows[better]
        for name, values in vars(best).items():
            values[at] = vars(moved)[name][better]
        error[at], size[at] = missing[better], np.linalg.norm(missing[better], axis=1)
        taken[rows] += 1
        going[rows] = better & (size[rows] > NEGLIGIBLE)
    return RefinedLengths(
        lengths=np.where(best.converged[:, None], best.lengths, lengths),
        commands=np.where(best.converged[:, None], best.commands, np.nan),
        position_error=np.where(best.converged, np.linalg.norm(error[:, :3], axis=1), np.inf),
        orientation_error=np.where(best.converged, np.linalg.norm(error[:, 3:], axis=1) / lever, np.inf),
        steps=taken,
        converged=best.converged,
    )


def _missing_pose(rest: Equilibrium, targets: np.ndarray, lever: float) -> np.ndarray:
    """Position and turn from the tip to its target, m. Shape (N, 6)."""
    quaternion = np.where(rest.converged[:, None], rest.quaternion, [1.0, 0, 0, 0])
    turn = (rotation_from_wxyz(quaternion_of(targets)) * rotation_from_wxyz(quaternion).inv()).as_rotvec()
    return np.concatenate([position_of(targets) - rest.position, lever * turn], axis=1)


def _tensions_of(section, tensions, pose, error, here: Equilibrium, chain) -> np.ndarray:
    """Best `tensions` of a `section` (S,) whose every pair is tried, those of the others as they are. Shape (N, S)."""
    others = tensions.copy()
    others[:, section] = 0.0
    best, least = np.zeros((len(error), len(section))), np.full(len(error), np.inf)
    wanted = error + np.einsum("nkt,nt->nk", pose, here.tensions - others)  # pose missing if it did not pull
    for pair in combinations(range(len(section)), min(2, len(section))):
        taut, trial = section[list(pair)], np.zeros_like(best)
        trial[:, pair] = bounded_least_squares(pose[:, :, taut], wanted, chain.max_tension[taut])
        left = np.linalg.norm(wanted - np.einsum("nkt,nt->nk", pose[:, :, section], trial), axis=1)
        nearer = left < least
        best[nearer], least[nearer] = trial[nearer], left[nearer]
    return best


def _together(tensions, pose, error, here: Equilibrium, chain) -> np.ndarray:
    """`tensions` (N, K) after the last bit of the way: those between their bounds solved for at once, by least squares,
    where all of them stay there."""
    free = (tensions > 0) & (tensions < chain.max_tension)
    columns = pose * free[:, None, :]
    left = error - np.einsum("nkt,nt->nk", pose, tensions - here.tensions)
    square = np.einsum("nki,nkj->nij", columns, columns)
    ridge = 1e-12 * np.trace(square, axis1=1, axis2=2)[:, None] + ~free
    square += ridge[:, :, None] * np.eye(chain.tendons)
    moved = tensions + np.linalg.solve(square, np.einsum("nkt,nk->nt", columns, left)[:, :, None])[:, :, 0]
    inside = ((moved >= 0) & (moved <= chain.max_tension)).all(axis=1)
    return np.where(inside[:, None], moved, tensions)


def _step(chain, here: Equilibrium, error, gravity, lever) -> tuple[np.ndarray, np.ndarray]:
    """Tensions (N, K) that the step foresees, and the lengths (N, K) to hold."""
    slopes = sensitivity(chain, here.qpos, here.tensions, gravity)
    pose = np.concatenate([slopes.tip_by_tension, lever * slopes.turn_by_tension], axis=1)  # (N, 6, K)
    tensions, parts = here.tensions.copy(), sections(chain)
    for section in parts * (SWEEPS if len(parts) > 1 else 1):
        tensions[:, section] = _tensions_of(section, tensions, pose, error, here, chain)
    if len(parts) > 1:
        tensions = _together(tensions, pose, error, here, chain)
    lengths = here.lengths + np.einsum("nst,nt->ns", slopes.length_by_tension, tensions - here.tensions)
    return tensions, lengths + np.where(tensions > 0, 0.0, SPARE)
