"""The paper's losses and error measures, for a whole population at once.

Shapes: C candidates, T frames, S tracked segments without the base. Distances are from the base frame's origin,
positions in the base frame, all in metres. `measured` (T, S) is False where there is nothing to compare with.
"""

from dataclasses import dataclass

import numpy as np


@dataclass
class LossWeights:
    """Numbers of the loss.

    delta_position, delta_velocity: Huber thresholds δ of the relative residuals.
    epsilon: m, keeps relative residuals finite near the base. epsilon_velocity: m a frame, likewise.
    weight_position, weight_velocity: w_pos and w_vel.
    """

    delta_position: float
    delta_velocity: float
    epsilon: float
    epsilon_velocity: float
    weight_position: float
    weight_velocity: float


def huber(residual: np.ndarray, delta: float) -> np.ndarray:
    """½ r² up to |r| = δ, and the line δ (|r| - ½ δ) beyond."""
    size = np.abs(residual)
    return np.where(size <= delta, 0.5 * size**2, delta * (size - 0.5 * delta))


def distances(positions: np.ndarray) -> np.ndarray:
    """d_i, the distance of each segment from the base: (..., S, 3) → (..., S)."""
    return np.linalg.norm(positions, axis=-1)


def distance_loss(simulated: np.ndarray, real: np.ndarray, measured: np.ndarray, weights: LossWeights) -> np.ndarray:
    """The paper's L_sum: relative Huber losses of distances and of their change from frame to frame.

    For one frame it is the static loss L, times w_pos.

    Args:
        simulated: (C, T, S, 3). real: (T, S, 3).

    Returns:
        The mean over frames of w_pos L_pos,t + w_vel L_vel,t, where L_vel of the first frame is 0. Shape (C,).
    """
    d_sim, d_real = distances(simulated), distances(real)
    position = huber((d_sim - d_real) / (np.abs(d_real) + weights.epsilon), weights.delta_position)
    step_sim, step_real = np.diff(d_sim, axis=-2), np.diff(d_real, axis=-2)
    velocity = huber((step_sim - step_real) / (np.abs(step_real) + weights.epsilon_velocity), weights.delta_velocity)
    return _weigh(position, velocity, measured, weights)


def position_loss(simulated: np.ndarray, real: np.ndarray, measured: np.ndarray, weights: LossWeights) -> np.ndarray:
    """As `distance_loss`, with vectors in the base frame in place of distances from the base.

    Distances hardly change while an arm swings gently to and fro; positions do.
    """
    offset = np.linalg.norm(simulated - real, axis=-1)
    position = huber(offset / (distances(real) + weights.epsilon), weights.delta_position)
    step_real = np.diff(real, axis=-3)
    step_offset = np.linalg.norm(np.diff(simulated, axis=-3) - step_real, axis=-1)
    relative = step_offset / (np.linalg.norm(step_real, axis=-1) + weights.epsilon_velocity)
    return _weigh(position, huber(relative, weights.delta_velocity), measured, weights)


LOSSES = {"distances": distance_loss, "positions": position_loss}


def _weigh(position: np.ndarray, velocity: np.ndarray, measured: np.ndarray, weights: LossWeights) -> np.ndarray:
    """Mean over the measured segments of each frame, then over the T frames (those with any segment)."""
    loss = weights.weight_position * _frame_means(position, measured).mean(axis=-1)
    if velocity.shape[-2]:
        pairs = measured[1:] & measured[:-1]
        total = _frame_means(velocity, pairs).sum(axis=-1)
        loss = loss + weights.weight_velocity * total / position.shape[-2]
    return loss


def _frame_means(values: np.ndarray, measured: np.ndarray) -> np.ndarray:
    """Mean over the segments measured in each frame: (C, T, S) → (C, T'), frames with none left out."""
    frames = measured.any(axis=-1)
    values, measured = values[:, frames], measured[frames]
    return (values * measured).sum(axis=-1) / measured.sum(axis=-1)


def internal_error(simulated: np.ndarray, real: np.ndarray, measured: np.ndarray) -> np.ndarray:
    """E_internal, the mean absolute error of the distances from the base, in m. (..., T, S, 3) → (...)."""
    return np.abs(distances(simulated) - distances(real))[..., measured].mean(axis=-1)


def position_error(simulated: np.ndarray, real: np.ndarray, measured: np.ndarray) -> np.ndarray:
    """Mean distance between simulated and measured segments in the base frame, in m. (..., T, S, 3) → (...)."""
    return np.linalg.norm(simulated - real, axis=-1)[..., measured].mean(axis=-1)


def velocity_error(simulated: np.ndarray, real: np.ndarray, measured: np.ndarray, rate: float) -> np.ndarray:
    """Mean absolute error of the rate of change of the distances, in m/s, at `rate` frames a second."""
    difference = np.diff(distances(simulated) - distances(real), axis=-2) * rate
    return np.abs(difference)[..., measured[1:] & measured[:-1]].mean(axis=-1)
