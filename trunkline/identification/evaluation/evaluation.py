"""How far a model is from the measurements, per split and of every trial."""

from collections.abc import Callable
from dataclasses import dataclass, replace

import mujoco
import numpy as np

from trunkline.identification.simulate.experiment import Experiment, weights_for
from trunkline.identification.simulate.loss import (
    LOSSES,
    LossWeights,
    internal_error,
    loss_of,
    position_error,
    velocity_error,
)
from trunkline.identification.simulate.resting import LAST, STILL
from trunkline.identification.simulate.simulated_sessions import Sessions
from trunkline.model.arm_model import ArmModel
from trunkline.recordings.trials.experiments import EXPERIMENTS, is_static, is_stepwise
from trunkline.recordings.trials.splits import SPLITS

SPECTRUM = 16  # times as many points as samples, so that a parabola through three of them finds a peak
LATE = (1.0, 2.0)  # s from the first frame, when a swing has nearly died away
STRUCTURE = "jnt_stiffness"  # any field: a population of one is the model itself


@dataclass
class Replay:
    """One model's simulation of every experiment, in their order.

    positions: of the markers, m. Each (T, S, 3). length: of the model's straight arm, from the mount to the tip, m.
    tip: which marker is the farthest from the base along the chain.
    straight: where that straight arm has its markers, m. Shape (S, 3).
    """

    positions: list[np.ndarray]
    length: float
    tip: int
    straight: np.ndarray

    @property
    def diverged(self) -> int:
        """How many of the trials it does not survive; in every error they count as the arm's length away."""
        return sum(not np.isfinite(positions).all() for positions in self.positions)


@dataclass
class Prediction:
    """What a model, or none, says of some experiments: `replay` has the positions of each, in their order."""

    replay: Replay
    experiments: list[Experiment]

    def of(self, chosen: Callable[[Experiment], bool]) -> "Prediction":
        """That of some of the experiments alone."""
        indices = [i for i, experiment in enumerate(self.experiments) if chosen(experiment)]
        positions = [self.replay.positions[i] for i in indices]
        return Prediction(replace(self.replay, positions=positions), [self.experiments[i] for i in indices])

    def scores(self, loss: str | None = None, weights: LossWeights | None = None) -> dict[str, dict]:
        """As the function `scores`."""
        return scores(self.replay, self.experiments, loss, weights)

    def overall(self) -> dict:
        """As `scores` for a split, over the trials of all of them."""
        return _summary(trial_errors(self))


def replay(
    model: mujoco.MjModel, experiments: list[Experiment], markers: tuple[str, ...], step_factor: float = 1.0
) -> Replay:
    """Simulate `experiments` with `model` as it is, its time step (times a factor) fitted to divide a frame evenly."""
    simulated = Sessions(model, experiments, markers, step_factor).simulate(
        lambda _, variant: {STRUCTURE: np.array(getattr(variant, STRUCTURE))[None]}
    )
    data = mujoco.MjData(model)
    mujoco.mj_kinematics(model, data)
    length = float(np.linalg.norm(data.site("tip").xpos - data.site("base_center").xpos))
    tip = int(np.argmax(model.site_bodyid[ArmModel(model).marker_sites(markers)]))
    straight = marker_positions(model, markers, model.qpos0)
    return Replay([positions[0] for positions in simulated.positions], length, tip, straight)


def marker_positions(model: mujoco.MjModel, markers: tuple[str, ...], qpos: np.ndarray) -> np.ndarray:
    """Where `model` has its markers at angles `qpos` (n,) of its first hinges, the arm's, m. Shape (S, 3)."""
    data = mujoco.MjData(model)
    data.qpos[: len(qpos)] = qpos
    mujoco.mj_kinematics(model, data)
    return data.site_xpos[ArmModel(model).marker_sites(markers)]


def scores(
    replayed: Replay, experiments: list[Experiment], loss: str | None = None, weights: LossWeights | None = None
) -> dict[str, dict]:
    """By split the loss, if one is asked for, and the errors, each the mean over `trials` trials, some `_worst` too.

    `by_experiment` has the same for every kind; shapes at rest that follow each other have two errors of the tip more;
    `without_repaired` where `ingest` repaired some of the split's trials, `repaired` of them. Where a simulation
    diverged, its markers count as the arm's length away along every axis.
    """
    rows = trial_errors(Prediction(replayed, experiments), loss, weights)
    table: dict[str, dict] = {}
    for split in SPLITS:
        subset = [(e, row) for e, row in rows if e.split == split]
        if subset:
            table[split] = _summary(subset)
        paths = [
            (survived(positions, replayed.length), e)
            for positions, e in zip(replayed.positions, experiments, strict=True)
            if e.split == split and is_stepwise(e.kind)
        ]
        if paths:
            table[split] |= _tip_over_paths(paths, replayed.tip)
    return table


def _tip_over_paths(paths: list[tuple[np.ndarray, Experiment]], tip: int) -> dict[str, float]:
    """Root mean square of the tip's distance over all shapes of all trials, and that of what is left once the mean
    offset is taken out, as quasi-static models of continuum robots are compared. Paths: positions (T, S, 3), m."""
    off = np.concatenate([(positions - e.positions)[:, tip][e.measured[:, tip]] for positions, e in paths])
    ways = {"e_tip_rms_mm": off, "e_tip_centred_rms_mm": off - off.mean(axis=0)}
    return {name: float(np.sqrt(np.mean(np.sum(way**2, axis=1)))) * 1e3 for name, way in ways.items()}


def _summary(rows: list[tuple[Experiment, dict[str, float]]]) -> dict:
    """What `scores` says of a split, from the errors of its trials."""
    kinds = sorted({e.kind for e, _ in rows})
    whole = [row for e, row in rows if not e.repaired]
    table: dict = _mean([row for _, row in rows])
    table["by_experiment"] = {kind: _mean([row for e, row in rows if e.kind == kind]) for kind in kinds}
    table["repaired"] = len(rows) - len(whole)
    if 0 < len(whole) < len(rows):
        table["without_repaired"] = _mean(whole)
    return table


def halved_step(whole: Prediction, halved: Prediction) -> dict:
    """By which share of itself half the time step moves E_internal, per split, and the tip error (`tip`).

    Measured errors hardly change if those of the step hide beside others, hence also the largest distance between the
    two simulations of any marker, and of the tip, in mm.
    """
    before, after = whole.scores(), halved.scores()

    def change(error: str) -> dict[str, float]:
        both = {split: (before[split].get(error), after[split].get(error)) for split in before}
        return {split: abs(new - old) / old for split, (old, new) in both.items() if old and new is not None}

    pairs = zip(halved.replay.positions, whole.replay.positions, strict=True)
    furthest = np.max([np.linalg.norm(a - b, axis=-1).max(axis=0) for a, b in pairs], axis=0) * 1e3
    return change("e_internal_mm") | {
        "tip": change("e_tip_mm"),
        "max_mm": float(furthest.max()),
        "tip_max_mm": float(furthest[whole.replay.tip]),
    }


def trial_errors(
    prediction: Prediction, loss: str | None = None, weights: LossWeights | None = None
) -> list[tuple[Experiment, dict[str, float]]]:
    """Of every trial its errors, as `errors_of` gives them."""
    replayed = prediction.replay
    return [
        (e, errors_of(positions, e, replayed, loss, weights))
        for positions, e in zip(replayed.positions, prediction.experiments, strict=True)
    ]


def survived(positions: np.ndarray, length: float) -> np.ndarray:
    """Positions, m, with the arm's `length` along every axis in place of what is not finite."""
    return np.nan_to_num(positions, nan=length, posinf=length, neginf=-length)


def errors_of(
    positions: np.ndarray, experiment: Experiment, replayed: Replay, loss: str | None, weights: LossWeights | None
) -> dict[str, float]:
    """Loss and errors of one trial, simulated as `positions` (T, S, 3), m."""
    real, measured, length, tip = experiment.positions, experiment.measured, replayed.length, replayed.tip
    positions = survived(positions, length)
    errors = {
        "e_internal": float(internal_error(positions, real, measured)),
        "e_position": float(position_error(positions, real, measured)),
    }
    if measured[:, tip].any():
        tip_alone = slice(tip, tip + 1)
        errors["e_tip"] = float(position_error(positions[:, tip_alone], real[:, tip_alone], measured[:, tip_alone]))
    row = {f"{name}_mm": error * 1e3 for name, error in errors.items()}
    row |= {f"{name}_pct": error / length * 100 for name, error in errors.items()}
    in_order = experiment.frame_step > 0  # else frames taken from here and there, or shapes at rest
    if loss is not None and weights is not None and (in_order or is_static(experiment.kind)):
        weights = weights_for(experiment, weights)
        row["loss"] = float(loss_of(LOSSES[loss](positions[None], real, measured, weights))[0])
    if experiment.frames > 1 and in_order:
        row["e_velocity_mm_s"] = float(velocity_error(positions, real, measured, 1 / experiment.frame_step)) * 1e3
        swings = EXPERIMENTS[experiment.kind].hangs and np.ptp(positions[:, tip], axis=0).any()
        if swings and measured[:, tip].any():
            row["e_swing_period_pct"] = 100 * period_error(positions[:, tip], real[:, tip], measured[:, tip])
            row |= about_rest(positions, experiment, tip, length)
    return row


def about_rest(positions: np.ndarray, experiment: Experiment, tip: int, length: float) -> dict[str, float]:
    """What is left of the errors of a swing, simulated as `positions` (T, S, 3) m, once each marker is moved by where
    it rests at the end of this trial: how it swings, wherever it comes to rest. And by which share of itself the tip's
    speed is off in `LATE`, if it has any there. Nothing of a trial that does not come to rest.
    """
    real, measured, step = experiment.positions, experiment.measured, experiment.frame_step
    last = slice(-max(round(LAST / step), 1), None)
    if not measured[last].any(axis=0).all() or np.ptp(real[last, tip][measured[last, tip]], axis=0).max() > STILL:
        return {}
    valid = measured[last][..., None]
    offset = np.where(valid, positions[last] - real[last], 0).sum(axis=0) / valid.sum(axis=0)
    away = np.linalg.norm(positions - real - offset, axis=-1)
    errors = {"e_position_about_rest": float(away[measured].mean()),
             "e_tip_about_rest": float(away[:, tip][measured[:, tip]].mean())}  # fmt: skip
    row = {f"{name}_mm": 1e3 * error for name, error in errors.items()}
    row |= {f"{name}_pct": 100 * error / length for name, error in errors.items()}
    late = slice(*(round(at / step) for at in LATE))
    speeds = [np.linalg.norm(np.diff(way[late, tip], axis=0), axis=1) for way in (positions, real)]
    if speeds[1].any() and measured[late, tip].all():
        row["e_late_speed_pct"] = 100 * abs(float(speeds[0].mean() / speeds[1].mean()) - 1)
    return row


def period_error(simulated: np.ndarray, real: np.ndarray, measured: np.ndarray) -> float:
    """By which share of itself the period of a swing differs, along the line on which it is widest.

    Args:
        simulated, real: positions of one point over a swing that dies away, m. Each (T, 3).
        measured: which of the real ones count. Shape (T,).
    """
    times = np.arange(len(real))
    filled = np.stack([np.interp(times, times[measured], axis[measured]) for axis in real.T], axis=1)
    line = np.linalg.svd(filled - filled.mean(axis=0), full_matrices=False)[2][0]
    frequency, true_frequency = (_frequency(points @ line) for points in (simulated, filled))
    return abs(true_frequency / frequency - 1)


def _frequency(swing: np.ndarray) -> float:
    """Of the largest peak of the spectrum, the mean taken off, in cycles a sample."""
    spectrum = np.abs(np.fft.rfft(swing - swing.mean(), SPECTRUM * len(swing)))
    peak = int(np.clip(np.argmax(spectrum), 1, len(spectrum) - 2))
    before, at, after = spectrum[peak - 1 : peak + 2]
    offset = 0.5 * (after - before) / max(2 * at - before - after, 1e-300)  # of a parabola's top
    return (peak + offset) / (SPECTRUM * len(swing))


def _mean(rows: list[dict[str, float]]) -> dict[str, float]:
    """Of each error over the trials that have it: the arm has a velocity in moving ones alone. And of the worst."""
    errors = dict.fromkeys(key for row in rows for key in row)
    means = {key: float(np.mean([row[key] for row in rows if key in row])) for key in errors}
    worst = {f"{name}_worst_mm": max(row[f"{name}_mm"] for row in rows if f"{name}_mm" in row)
             for name in ("e_position", "e_tip") if f"{name}_mm" in errors}  # fmt: skip
    return means | worst | {"trials": len(rows)}
