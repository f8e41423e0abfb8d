"""The paper's losses and error measures, for a whole population at once.

Shapes: C candidates, T frames, S markers without the base. Distances are from the base frame's origin,
positions in the base frame, all in metres. `measured` (T, S) is False where there is nothing to compare with.
"""

from dataclasses import dataclass
from typing import TYPE_CHECKING, Annotated, Literal

import numpy as np
from pydantic import Field


@dataclass
class LossWeights:
    """Numbers of the loss.

    delta_position, delta_velocity: Huber thresholds δ of the relative residuals.
    epsilon: m, keeps relative residuals finite near the base. epsilon_velocity: m a frame, likewise.
    weight_position, weight_velocity: w_pos and w_vel.
    outlying: a trial counts less from that many times the usual loss on, see `robust`.
    """

    delta_position: Annotated[float, Field(gt=0, le=1000)]
    delta_velocity: Annotated[float, Field(gt=0, le=1000)]
    epsilon: Annotated[float, Field(gt=0, le=10)]
    epsilon_velocity: Annotated[float, Field(gt=0, le=10)]
    weight_position: Annotated[float, Field(ge=0, le=1000)]
    weight_velocity: Annotated[float, Field(ge=0, le=1000)]
    outlying: Annotated[float, Field(gt=1, le=1e9)] = 4.0


def huber(residual: np.ndarray, delta: float) -> np.ndarray:
    """½ r² up to |r| = δ, and the line δ (|r| - ½ δ) beyond."""
    size = np.abs(residual)
    return np.where(size <= delta, 0.5 * size**2, delta * (size - 0.5 * delta))


def distances(positions: np.ndarray) -> np.ndarray:
    """d_i, the distance of each marker from the base: (..., S, 3) → (..., S)."""
    return np.linalg.norm(positions, axis=-1)


def distance_residuals(
    simulated: np.ndarray, real: np.ndarray, measured: np.ndarray, weights: LossWeights
) -> np.ndarray:
    """Residuals r of the paper's loss L_sum, so that L_sum = ½ Σ r².

    L_sum is the mean over frames of w_pos L_pos,t + w_vel L_vel,t, where L_pos,t is the mean over the measured
    markers of Huber((d_sim - d_real) / (|d_real| + ε)), L_vel,t the same of the change of d from frame to
    frame, and L_vel of the first frame is 0. For one frame it is the static loss L, times w_pos.

    Args:
        simulated: (C, T, S, 3). real: (T, S, 3).

    Returns:
        Shape (C, R).
    """
    real = distances(real)
    steps = np.abs(np.diff(real, axis=0))
    return _residuals(distances(simulated)[..., None], real[..., None], real, steps, measured, weights)


def position_residuals(
    simulated: np.ndarray, real: np.ndarray, measured: np.ndarray, weights: LossWeights
) -> np.ndarray:
    """As `distance_residuals`, with positions in the base frame in place of distances from the base.

    Distances hardly change while an arm swings gently to and fro; positions do. A Huber loss is then of the
    length of a vector, relative to the marker's distance from the base, or to the root mean square of its steps:
    relative to each measured step, the slowest count most, and their noise biases the motors' gains.
    """
    pairs = (measured[1:] & measured[:-1])[..., None]
    squares = np.where(pairs, np.diff(real, axis=0) ** 2, 0).sum(axis=(0, 2))
    steps = np.sqrt(squares / np.maximum(pairs.sum(axis=(0, 2)), 1))
    return _residuals(simulated, real, distances(real), steps, measured, weights)


LOSSES = {"distances": distance_residuals, "positions": position_residuals}

if TYPE_CHECKING:
    LossName = str
else:
    LossName = Literal[tuple(LOSSES)]  # so that whoever names another is told which there are


@dataclass(kw_only=True)
class Loss(LossWeights):
    """Which loss, and its numbers."""

    kind: LossName


def loss_of(residuals: np.ndarray) -> np.ndarray:
    """½ Σ r² over the last axis."""
    return 0.5 * np.einsum("...r,...r->...", residuals, residuals)


def _residuals(simulated, real, scale, step_scale, measured, weights: LossWeights) -> np.ndarray:
    """Position and velocity terms of (C, T, S, K) against (T, S, K), K = 1 for distances, 3 for positions.

    They are relative to `scale` (T, S) and to `step_scale`, (T - 1, S) or (S,). What was not measured may be NaN: of a
    path, nothing is filled in.
    """
    offset = np.where(measured[..., None], (simulated - real) / (scale + weights.epsilon)[..., None], 0.0)
    frames = measured.any(axis=-1).sum()
    shares = measured / np.maximum(measured.sum(axis=-1, keepdims=True), 1) / frames
    terms = [_whiten(offset, weights.delta_position, weights.weight_position * shares)]
    if len(real) > 1 and weights.weight_velocity > 0:
        offset = np.diff(simulated, axis=1) - np.diff(real, axis=0)
        offset /= (step_scale + weights.epsilon_velocity)[..., None]
        pairs = measured[1:] & measured[:-1]
        offset = np.where(pairs[..., None], offset, 0.0)
        shares = pairs / np.maximum(pairs.sum(axis=-1, keepdims=True), 1) / frames
        terms.append(_whiten(offset, weights.delta_velocity, weights.weight_velocity * shares))
    return np.concatenate([term.reshape(len(simulated), -1) for term in terms], axis=1)


def _whiten(offset: np.ndarray, delta: float, shares: np.ndarray) -> np.ndarray:
    """Scale vectors (C, T, S, K) so that half their squared length is `shares` (T, S) times Huber of their length."""
    length = np.linalg.norm(offset, axis=-1)
    inside = np.where(length > delta, np.sqrt(2 * huber(length, delta)) / np.maximum(length, delta), 1.0)
    return offset * (inside * np.sqrt(shares))[..., None]


def internal_error(simulated: np.ndarray, real: np.ndarray, measured: np.ndarray) -> np.ndarray:
    """E_internal, the mean absolute error of the distances from the base, in m. (..., T, S, 3) → (...)."""
    return np.abs(distances(simulated) - distances(real))[..., measured].mean(axis=-1)


def position_error(simulated: np.ndarray, real: np.ndarray, measured: np.ndarray) -> np.ndarray:
    """Mean distance between simulated and measured markers in the base frame, in m. (..., T, S, 3) → (...)."""
    return np.linalg.norm(simulated - real, axis=-1)[..., measured].mean(axis=-1)


def velocity_error(simulated: np.ndarray, real: np.ndarray, measured: np.ndarray, rate: float) -> np.ndarray:
    """Mean absolute error of the rate of change of the distances, in m/s, at `rate` frames a second."""
    difference = np.diff(distances(simulated) - distances(real), axis=-2) * rate
    return np.abs(difference)[..., measured[1:] & measured[:-1]].mean(axis=-1)
