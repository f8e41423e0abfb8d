"""How far the twin's tip is from the measured one in the held-out trials at rest."""

import mujoco
import numpy as np

from trunkline.identification.evaluation.evaluation import marker_positions
from trunkline.identification.parameters.per_session import model_in
from trunkline.recordings.trials.experiments import is_static
from trunkline.recordings.trials.splits import VALIDATE
from trunkline.recordings.trials.trial import Trial, sessions_of
from trunkline.report.certificate.arms import arm_of
from trunkline.report.certificate.poses import posed


def at_rest(trials: list[Trial]) -> list[Trial]:
    """Of `trials` those held out, at rest, without a load, that were seen."""
    rested = [t for t in trials if t.split == VALIDATE and is_static(t.experiment) and not t.load]
    return [t for t in rested if t.measured[-1].any()]


def tip_residuals(model: mujoco.MjModel, trials: list[Trial], tip: int) -> np.ndarray:
    """Distances of the twin's marker of number `tip` from where `trials` at rest saw it, m, NaN where they did not.
    Shape (N,)."""
    lengths = np.full(len(trials), np.nan)
    for session in sessions_of(trials):
        session_model = model_in(session, model)
        places = [i for i, trial in enumerate(trials) if trial.session == session]
        equilibria = arm_of(session_model).rest(posed([trials[i] for i in places], session_model))
        for i, qpos, rested in zip(places, equilibria.qpos, equilibria.converged, strict=True):
            if rested and trials[i].measured[-1, tip]:
                place = marker_positions(session_model, trials[i].markers, qpos)[tip]
                lengths[i] = np.linalg.norm(place - trials[i].positions[-1, tip])
    return lengths
