"""The last step: identified models on trials that nothing has decided on."""

import hashlib
from dataclasses import dataclass

import mujoco
import numpy as np

from trunkline.identification.evaluation import Prediction, replay
from trunkline.identification.experiment import Experiment, prepare
from trunkline.identification.null_model import references
from trunkline.identification.repeatability import repeatability
from trunkline.identification.settings import IdentificationSettings
from trunkline.trials.splits import IDENTIFY, TEST
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
    models: dict[str, mujoco.MjModel], trials: list[Trial], compared: Compared
) -> tuple[dict, dict[str, Prediction]]:
    """Errors of `models`, one of them "identified", and of what they stand beside, on the trials of the split test.

    Args:
        trials: of the split test, and those to identify from, which the null model needs.

    Returns:
        For metrics.json: by model, null model and for the noise floor the split `test` as `scores` gives it, and how
        well the arm repeats itself. What each predicts of those trials, for tables and figures. Both are empty without
        such trials.
    """
    trials = [trial for trial in trials if trial.experiment in compared.experiments]
    tested = [trial for trial in trials if trial.split == TEST]
    if not tested:
        return {}, {}
    identified, segments = models["identified"], tested[0].segments
    experiments = [prepare(trial, identified, compared.frames, compared.command_delay) for trial in trials]
    unseen = [e for e in experiments if e.split == TEST]
    predictions = {name: Prediction(replay(model, unseen, segments), unseen) for name, model in models.items()}
    like = predictions["identified"].replay
    predictions |= references(tested, unseen, identified, like, ended=experiments)
    metrics: dict = {name: prediction.scores() for name, prediction in predictions.items()}
    metrics["noise_floor_mm"] = metrics["noise_floor"][TEST]["e_position_mm"]
    metrics["start_fit"] = start_fit(unseen)
    metrics["repeatability_mm"] = repeatability(trials, like.tip)
    return metrics, predictions


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


def fingerprints(trials: list[Trial]) -> dict[str, str]:
    """Of the trials to identify from, by name, what tells them from another session's of the same name: a digest of
    the filtered positions to the micrometre."""
    return {t.name: fingerprint(t) for t in trials if t.split == IDENTIFY}


def fingerprint(trial: Trial) -> str:
    places = np.where(trial.measured[..., None], trial.positions, 0)
    return hashlib.sha256((places.round(6) + 0.0).tobytes()).hexdigest()[:16]
