"""What the network is worth: the tip error after forward kinematics of the commands it gives, and far-off targets."""

from dataclasses import dataclass, replace

import numpy as np

from trunkline.errors import InputError
from trunkline.frames import downwards
from trunkline.kinematics.ik.inputs import gravity_of, position_of, quaternion_of
from trunkline.kinematics.residual.residual_map import ResidualMap, moved
from trunkline.model.statics.chain import FORCE_ROUNDING, Chain
from trunkline.model.statics.equilibria import Equilibrium, actuated, forward


@dataclass
class TipErrors:
    """N targets; NaN where the forward kinematics did not converge.

    Attributes:
        position: distance from the target, m. Shape (N,).
        orientation: angle from the target, rad. Shape (N,).
        beyond_force: where lengths ask for more pull than the motors have; None if not looked at. Shape (N,).
    """

    position: np.ndarray
    orientation: np.ndarray
    beyond_force: np.ndarray | None = None

    def metrics(self, length: float) -> dict:
        """Summary in mm and degrees; a target without an answer counts as missed.

        Args:
            length: of the arm, m.
        """
        missed = ~np.isfinite(self.position)
        position = np.where(missed, length, self.position)
        orientation = np.where(missed, np.pi, self.orientation)
        force = {} if self.beyond_force is None else {"beyond_force": float(np.mean(self.beyond_force))}
        return force | {
            "position_error_mm": {
                "median": np.median(position) * 1e3,
                "p95": np.quantile(position, 0.95) * 1e3,
                "max": position.max() * 1e3,
            },
            "within_1pct": np.mean(position <= 0.01 * length),
            "within_0p1pct": np.mean(position <= 0.001 * length),
            "orientation_error_deg": {
                "median": np.degrees(np.median(orientation)),
                "p95": np.degrees(np.quantile(orientation, 0.95)),
            },
            "targets": len(position),
            "failed": int(missed.sum()),
        }


def tip_errors(
    chain: Chain, inputs: np.ndarray, commands: np.ndarray, learnt: ResidualMap | None = None
) -> TipErrors:
    """Errors of predicted commands (N, K), m, for targets `inputs` (N, 7, 8 or 10), of the twin's tip, moved by a
    residual map if there is one."""
    gravity = gravity_of(inputs)
    return _errors(moved(actuated(chain, commands, gravity), chain, gravity, learnt), inputs)


def length_errors(chain: Chain, inputs: np.ndarray, lengths: np.ndarray) -> TipErrors:
    """Errors of predicted path lengths (N, K), m, held by cables whatever it takes, for targets as in `tip_errors`."""
    rest = forward(chain, lengths, gravity_of(inputs))
    beyond = rest.converged & (rest.tensions > (1 + FORCE_ROUNDING) * chain.max_tension).any(axis=1)
    return replace(_errors(rest, inputs), beyond_force=beyond)


def _errors(rest: Equilibrium, inputs: np.ndarray) -> TipErrors:
    position = np.linalg.norm(rest.position - position_of(inputs), axis=1)
    overlap = np.abs(np.einsum("ni,ni->n", rest.quaternion, quaternion_of(inputs)))
    orientation = 2 * np.arccos(np.clip(overlap, 0, 1))
    position[~rest.converged], orientation[~rest.converged] = np.nan, np.nan
    return TipErrors(position, orientation)


def outside_targets(count: int, length: float, rng: np.random.Generator, columns: int) -> np.ndarray:
    """Poses that have nothing to do with the arm: any orientation, any gravity angle up to π, positions in a box
    of four arm `length`s (m) around the base, gravity in `columns` columns, 0, 1 or 3. Shape (count, columns + 7)."""
    angles = rng.uniform(0, np.pi, count)
    quaternions = rng.normal(size=(count, 4))
    gravity = downwards(angles, rng.uniform(0, 2 * np.pi, count)) if columns == 3 else angles[:, None]
    return np.column_stack([
        gravity[:, :columns],
        rng.uniform(-2 * length, 2 * length, (count, 3)),
        quaternions / np.linalg.norm(quaternions, axis=1, keepdims=True),
    ])


def beyond_range(commands: np.ndarray, sampled: np.ndarray) -> float:
    """How far any of `commands` (N, K) lies beyond the shortest and longest of `sampled` (M, K), m; zero if none does.

    Raises:
        InputError: an answer is not finite.
    """
    _check_finite(commands)
    low, high = sampled.min(axis=0), sampled.max(axis=0)
    return float(max(0.0, (low - commands).max(), (commands - high).max()))


def largest_difference(lengths: np.ndarray, others: np.ndarray) -> float:
    """Between the answers of two forms of one network, m. Shapes (N, K).

    Raises:
        InputError: an answer is not finite, so that no difference says anything.
    """
    _check_finite(lengths)
    _check_finite(others)
    return float(np.abs(lengths - others).max())


def _check_finite(lengths: np.ndarray) -> None:
    """Raise InputError if the network has no finite answer for some target: `max` would pass over a NaN in silence."""
    bad = int((~np.isfinite(lengths)).any(axis=1).sum())
    if bad:
        raise InputError(
            f"train_ik: found {bad} of {len(lengths)} answers of the network that are not finite, expected lengths in m"
        )
