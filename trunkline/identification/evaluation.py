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
from trunkline.trials.splits import SPLITS

STRUCTURE = "jnt_stiffness"  # any field: a population of one is the model itself


@dataclass
class Replay:
    """One model's simulation of every experiment, in their order.

    positions: of the segments, m. Each (T, S, 3). length: of the model's straight arm, from the mount to the tip, m.
    tip: which segment is the farthest from the base along the chain.
    """

    positions: list[np.ndarray]
    length: float
    tip: int

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
    tip = int(np.argmax([model.site_bodyid[model.site(f"{name}_center").id] for name in segments]))
    return Replay([positions[0] for positions in simulated.positions], length, tip)


def scores(
    replayed: Replay, experiments: list[Experiment], loss: str | None = None, weights: LossWeights | None = None
) -> dict[str, dict]:
    """By split the loss, if one is asked for, and the errors, each the mean over `trials` trials, some `_worst` too.

    `by_experiment` has the same for every kind; `without_repaired` where `ingest` repaired some of the split's trials,
    `repaired` of them. Where a simulation diverged, its segments count as the arm's length away along every axis.
    """
    rows = [
        (e, errors_of(positions, e, replayed, loss, weights))
        for positions, e in zip(replayed.positions, experiments, strict=True)
    ]
    table: dict[str, dict] = {}
    for split in SPLITS:
        own = [(e, row) for e, row in rows if e.split == split]
        if not own:
            continue
        kinds = sorted({e.kind for e, _ in own})
        whole = [row for e, row in own if not e.repaired]
        table[split] = _mean([row for _, row in own])
        table[split]["by_experiment"] = {kind: _mean([row for e, row in own if e.kind == kind]) for kind in kinds}
        table[split]["repaired"] = len(own) - len(whole)
        if 0 < len(whole) < len(own):
            table[split]["without_repaired"] = _mean(whole)
    return table


def errors_of(
    positions: np.ndarray, experiment: Experiment, replayed: Replay, loss: str | None, weights: LossWeights | None
) -> dict[str, float]:
    """Loss and errors of one trial, simulated as `positions` (T, S, 3), m."""
    real, measured, length, tip = experiment.positions, experiment.measured, replayed.length, replayed.tip
    positions = np.nan_to_num(positions, nan=length, posinf=length, neginf=-length)
    found = {
        "e_internal": float(internal_error(positions, real, measured)),
        "e_position": float(position_error(positions, real, measured)),
    }
    if measured[:, tip].any():
        one = slice(tip, tip + 1)
        found["e_tip"] = float(position_error(positions[:, one], real[:, one], measured[:, one]))
    row = {f"{name}_mm": error * 1e3 for name, error in found.items()}
    row |= {f"{name}_pct": error / length * 100 for name, error in found.items()}
    if loss is not None and weights is not None:
        row["loss"] = float(loss_of(RESIDUALS[loss](positions[None], real, measured, weights))[0])
    if experiment.frames > 1:
        row["e_velocity_mm_s"] = float(velocity_error(positions, real, measured, 1 / experiment.frame_step)) * 1e3
    return row


def _mean(rows: list[dict[str, float]]) -> dict[str, float]:
    """Of each error over the trials that have it: the arm has a velocity in moving ones alone. And of the worst."""
    errors = dict.fromkeys(key for row in rows for key in row)
    means = {key: float(np.mean([row[key] for row in rows if key in row])) for key in errors}
    worst = {f"{name}_worst_mm": max(row[f"{name}_mm"] for row in rows if f"{name}_mm" in row)
             for name in ("e_position", "e_tip") if f"{name}_mm" in errors}  # fmt: skip
    return means | worst | {"trials": len(rows)}
