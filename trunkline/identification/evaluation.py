"""How far a model is from the measurements, per split, and over time for the figures."""

from dataclasses import dataclass

import mujoco
import numpy as np

from trunkline.identification.experiment import Experiment
from trunkline.identification.loss import (
    RESIDUALS,
    LossWeights,
    internal_error,
    loss_of,
    position_error,
    velocity_error,
)
from trunkline.identification.population import Population

STRUCTURE = "jnt_stiffness"  # any field: a population of one is the model itself


@dataclass
class Replay:
    """One model's simulation of every experiment, in their order.

    positions: of the segments, m. Each (T, S, 3). length: of the model's straight arm, from the mount to the tip, m.
    """

    positions: list[np.ndarray]
    length: float

    @property
    def diverged(self) -> int:
        """How many of the trials it does not survive; in every error they count as the arm's length away."""
        return sum(not np.isfinite(positions).all() for positions in self.positions)


def replay(
    model: mujoco.MjModel, experiments: list[Experiment], segments: tuple[str, ...], step_factor: float = 1.0
) -> Replay:
    """Simulate `experiments` with `model` as it is, its time step (times a factor) fitted to divide a frame evenly."""
    fields = {STRUCTURE: np.array(getattr(model, STRUCTURE))[None]}
    simulated = Population(model, experiments, segments, step_factor).simulate(fields)
    data = mujoco.MjData(model)
    mujoco.mj_kinematics(model, data)
    length = float(np.linalg.norm(data.site("tip").xpos - data.site("base_center").xpos))
    return Replay([positions[0] for positions in simulated.positions], length)


def scores(
    replayed: Replay, experiments: list[Experiment], loss: str, weights: LossWeights
) -> dict[str, dict[str, float]]:
    """Per split the loss and the errors, each the mean over trials; `by_experiment` splits them further.

    Where a simulation diverged, its segments count as the arm's length away along every axis.
    """
    table: dict[str, dict] = {}
    for split in ("identify", "validate"):
        rows = [
            (e.kind, _score(p, e, loss, weights, replayed.length))
            for p, e in zip(replayed.positions, experiments, strict=True)
            if e.split == split
        ]
        if rows:
            table[split] = _mean([row for _, row in rows])
            kinds = sorted({kind for kind, _ in rows})
            if len(kinds) > 1:
                table[split]["by_experiment"] = {
                    kind: _mean([row for k, row in rows if k == kind]) for kind in kinds
                }
    return table


def _score(positions, experiment: Experiment, loss: str, weights: LossWeights, length: float) -> dict[str, float]:
    real, measured = experiment.positions, experiment.measured
    positions = np.nan_to_num(positions, nan=length, posinf=length, neginf=-length)
    internal = float(internal_error(positions, real, measured))
    row = {
        "loss": float(loss_of(RESIDUALS[loss](positions[None], real, measured, weights))[0]),
        "e_internal_mm": internal * 1e3,
        "e_internal_pct": internal / length * 100,
        "e_position_mm": float(position_error(positions, real, measured)) * 1e3,
        "e_position_pct": float(position_error(positions, real, measured)) / length * 100,
    }
    if experiment.frames > 1:
        row["e_velocity_mm_s"] = float(velocity_error(positions, real, measured, 1 / experiment.frame_step)) * 1e3
    return row


def _mean(rows: list[dict[str, float]]) -> dict[str, float]:
    """Of each error over the trials that have it: the arm has a velocity in moving ones alone."""
    errors = dict.fromkeys(key for row in rows for key in row)
    return {key: float(np.mean([row[key] for row in rows if key in row])) for key in errors}
