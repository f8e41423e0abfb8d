"""How far the twin's tip is from the measured one in the held-out trials at rest."""

import mujoco
import numpy as np

from trunkline.certificate.arms import arm_of
from trunkline.certificate.poses import posed
from trunkline.identification.evaluation import segment_positions
from trunkline.trials.experiments import is_static
from trunkline.trials.splits import VALIDATE
from trunkline.trials.trial import Trial


def at_rest(trials: list[Trial]) -> list[Trial]:
    """Of `trials` those held out, at rest, without a load, that were seen."""
    own = [t for t in trials if t.split == VALIDATE and is_static(t.experiment) and not t.load]
    return [t for t in own if t.measured[-1].any()]


def tip_residuals(model: mujoco.MjModel, trials: list[Trial], tip: int) -> np.ndarray:
    """Distances of the twin's segment of number `tip` from where `trials` at rest saw it, m, NaN where they did not.
    Shape (N,)."""
    found = arm_of(model).rest(posed(trials, model))
    lengths = []
    for trial, qpos, rested in zip(trials, found.qpos, found.converged, strict=True):
        place = segment_positions(model, trial.segments, qpos)[tip]
        seen = rested and trial.measured[-1, tip]
        lengths.append(np.linalg.norm(place - trial.positions[-1, tip]) if seen else np.nan)
    return np.array(lengths)
