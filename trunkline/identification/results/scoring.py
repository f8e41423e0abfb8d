"""The last step: identified models on trials that nothing has decided on."""

import hashlib
from dataclasses import dataclass

import mujoco
import numpy as np

from trunkline.identification.evaluation.baselines import FLOOR_POSES, references
from trunkline.identification.evaluation.evaluation import Prediction, replay
from trunkline.identification.evaluation.repeatability import repeatability
from trunkline.identification.fit.settings import IdentificationSettings
from trunkline.identification.simulate.experiment import Experiment, own_starts, prepare
from trunkline.recordings.trials.splits import IDENTIFY, TEST
from trunkline.recordings.trials.trial import Trial, sessions_of


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
) -> tuple[dict, dict[str, Prediction]]:
    """Errors of `models`, one of them "identified", and of what they stand beside, on the trials of the split test.

    Args:
        trials: of the split test, and those to identify from, which the null model needs.
        floor_poses: of each trial, at most, to take the noise floor from.

    Returns:
        For metrics.json: by model, null model and for the noise floor the split `test` as `scores` gives it, and how
        well the arm repeats itself. What each predicts of those trials, for tables and figures. Both are empty without
        such trials.
    """
    trials = [trial for trial in trials if trial.experiment in compared.experiments]
    tested = [trial for trial in trials if trial.split == TEST]
    if not tested:
        return {}, {}
    identified = models["identified"]
    experiments = [prepare(trial, identified, compared.frames, compared.command_delay) for trial in trials]
    unseen = [e for e in experiments if e.split == TEST]
    predictions = _predictions(models, identified, tested, unseen, experiments, floor_poses)
    metrics: dict = {name: prediction.scores() for name, prediction in predictions.items()}
    metrics["noise_floor_mm"] = metrics["noise_floor"][TEST]["e_position_mm"]
    metrics["start_fit"] = start_fit(unseen)
    metrics["repeatability_mm"] = repeatability(trials, predictions["identified"].replay.tip)
    return metrics, predictions


def evaluate(
    models: dict[str, mujoco.MjModel], trials: list[Trial], frames: int, command_delay: float
) -> tuple[dict, dict[str, Prediction]]:
    """Errors of `models`, one of them "model", on all `trials`, whatever their splits.

    Args:
        frames: compared of each trial, at most. command_delay: s, from a logged command to the motor.

    Returns:
        As `score`, over all splits at once; where trials are of several sessions, `by_session` has the same of each.
    """
    model = models["model"]
    experiments = [prepare(trial, model, frames, command_delay) for trial in trials]
    predictions = _predictions(models, model, trials, experiments, experiments)
    metrics = _evaluated(predictions, trials)
    sessions = sessions_of(trials)
    if len(sessions) > 1:
        metrics["by_session"] = {
            session: _evaluated(
                {name: p.of(lambda e, chosen=session: e.session == chosen) for name, p in predictions.items()},
                [trial for trial in trials if trial.session == session],
            )
            for session in sessions
        }
    return metrics, predictions


def _evaluated(predictions: dict[str, Prediction], trials: list[Trial]) -> dict:
    metrics: dict = {name: prediction.overall() for name, prediction in predictions.items()}
    metrics["noise_floor_mm"] = metrics["noise_floor"]["e_position_mm"]
    metrics["start_fit"] = start_fit(predictions["model"].experiments)
    metrics["repeatability_mm"] = repeatability(trials, predictions["model"].replay.tip)
    return metrics


def _predictions(
    models, model, trials: list[Trial], experiments: list[Experiment], ended, floor_poses: int = FLOOR_POSES
) -> dict[str, Prediction]:
    """Of all `models`, and what stands beside them; `model` is the one to whose markers poses are fitted."""
    predictions = predict(models, trials, experiments, model)
    like = next(iter(predictions.values())).replay
    return predictions | references(trials, experiments, model, like, ended, floor_poses)


def predict(
    models: dict[str, mujoco.MjModel], trials: list[Trial], experiments: list[Experiment], fitted: mujoco.MjModel
) -> dict[str, Prediction]:
    """What each of `models` says of `experiments`, which were prepared from `trials` with the model `fitted`; each
    starts where its own geometry puts the arm. A model under two names is simulated once."""
    predictions: dict[int, Prediction] = {}
    for model in models.values():
        if id(model) not in predictions:
            started = own_starts(experiments, trials, fitted, model)
            predictions[id(model)] = Prediction(replay(model, started, trials[0].markers), started)
    return {name: predictions[id(model)] for name, model in models.items()}


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
