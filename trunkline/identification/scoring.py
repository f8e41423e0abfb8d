"""The last step: identified models on trials that nothing has decided on."""

from dataclasses import dataclass

import mujoco
import numpy as np
import pandas as pd

from trunkline.identification.evaluation import Replay, errors_of, replay, scores
from trunkline.identification.experiment import Experiment, measured_pose, prepare, start_frames
from trunkline.identification.null_model import hanging_still
from trunkline.identification.pose_fit import fit_pose
from trunkline.identification.settings import IdentificationSettings
from trunkline.trials.experiments import is_static
from trunkline.trials.splits import TEST
from trunkline.trials.trial import Trial


@dataclass
class Compared:
    """What an identification stage compared with its model: kinds of experiment, frames of each trial at most, and
    the delay of commands, s."""

    experiments: list[str]
    frames: int
    command_delay: float

    @classmethod
    def of(cls, config: IdentificationSettings) -> "Compared":
        return cls(list(config.reported), config.frames, config.command_delay)


def score(
    models: dict[str, mujoco.MjModel], trials: list[Trial], compared: Compared, floor_poses: int
) -> tuple[dict, pd.DataFrame]:
    """Errors of `models`, one of them "identified", and of the null model, on the trials of the split test.

    Args:
        trials: of the split test, and those to identify from, which the null model needs.
        floor_poses: of each trial, at most, to take the noise floor from.

    Returns:
        For metrics.json: by model the split `test` as `scores` gives it, and the noise floor; empty without such
        trials. Of each trial, by model: columns experiment, trial, model, e_internal_mm, e_position_mm, e_tip_mm.
    """
    trials = [trial for trial in trials if trial.experiment in compared.experiments]
    tested = [trial for trial in trials if trial.split == TEST]
    if not tested:
        return {}, pd.DataFrame()
    identified, segments = models["identified"], tested[0].segments
    experiments = [prepare(trial, identified, compared.frames, compared.command_delay) for trial in trials]
    chosen = [i for i, e in enumerate(experiments) if e.split == TEST]
    unseen = [experiments[i] for i in chosen]
    replays = {name: replay(model, unseen, segments) for name, model in models.items()}
    still = hanging_still(experiments, replays["identified"])
    replays["null"] = Replay([still.positions[i] for i in chosen], still.length, still.tip)
    floors = [noise_floor(trial, identified, compared.frames, floor_poses) * 1e3 for trial in tested]
    kinds = sorted({trial.experiment for trial in tested})
    metrics: dict = {name: scores(replayed, unseen) for name, replayed in replays.items()}
    metrics |= {
        "noise_floor_mm": float(np.mean(floors)),
        "noise_floor_by_experiment_mm": {
            kind: float(np.mean([f for f, trial in zip(floors, tested, strict=True) if trial.experiment == kind]))
            for kind in kinds
        },
        "start_fit": start_fit(unseen),
    }
    return metrics, _table(unseen, replays)


def noise_floor(trial: Trial, model: mujoco.MjModel, frames: int, poses: int) -> float:
    """What noise and pose fit alone leave of a trial, m: to be compared with its position error.

    In up to `poses` of the frames that are compared, evenly spread, joint angles are fitted to the measured segments,
    as for the pose from which a simulation starts. The floor is the mean distance that remains between the model's
    segments and the measured ones: measurement noise that the low-pass left, what the smoothing of the pose fit takes
    from a sharp bend, and what no pose of this model can be. A simulation that is right in everything else is not
    expected to come nearer, though it may: the fit also weighs orientations and smoothness.
    """
    first = 0 if is_static(trial.experiment) else start_frames(trial)[0] + 1
    last = min(first + frames, len(trial.time)) - 1
    seen = [f for f in range(first, last + 1) if trial.measured[f].any()]
    places = np.linspace(0, len(seen) - 1, min(poses, len(seen))).round().astype(int)
    fits = [fit_pose(model, trial.segments, *measured_pose(trial, seen[place])) for place in places]
    return float(np.mean([np.nanmean(fit.residuals) for fit in fits]))


def start_fit(experiments: list[Experiment]) -> dict:
    """How far the poses from which simulations start are from the measured ones, over all and by kind."""
    residuals = [(e.kind, e.fit.residuals[np.isfinite(e.fit.residuals)] * 1e3) for e in experiments]

    def spread(rows: list[np.ndarray]) -> dict[str, float]:
        return {"mean_mm": float(np.mean([r.mean() for r in rows])), "max_mm": float(np.max([r.max() for r in rows]))}

    kinds = sorted({kind for kind, _ in residuals})
    return spread([r for _, r in residuals]) | {
        "unconverged": sum(not e.fit.converged for e in experiments),
        "by_experiment": {kind: spread([r for k, r in residuals if k == kind]) for kind in kinds},
    }


def _table(experiments: list[Experiment], replays: dict[str, Replay]) -> pd.DataFrame:
    rows = []
    for name, replayed in replays.items():
        for positions, experiment in zip(replayed.positions, experiments, strict=True):
            errors = errors_of(positions, experiment, replayed, None, None)
            rows.append({"experiment": experiment.kind, "trial": experiment.name, "model": name} | errors)
    return pd.DataFrame(rows)
