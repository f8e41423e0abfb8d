"""What a session's trials at rest went up to."""

from dataclasses import dataclass

import numpy as np

from trunkline.frames import tilt_of_gravity
from trunkline.recordings.trials.experiments import is_static
from trunkline.recordings.trials.trial import Trial

PULLED = 1e-3  # m, from which on a tendon counts as pulled


@dataclass
class Conditions:
    """Of the session's trials at rest, none of the split test: what they went up to.

    tilt_deg: of the mount. pulled_tilt_deg: of the mount while a motor pulled. pull: of one motor, m. pulls: of all
    motors together, m.
    """

    tilt_deg: float
    pulled_tilt_deg: float
    pull: float
    pulls: float


def conditions_of(trials: list[Trial]) -> Conditions:
    """What the trials at rest without a load among `trials` went up to."""
    rested = [trial for trial in trials if is_static(trial.experiment) and not trial.load]
    tilts = [(float(np.degrees(tilt_of_gravity(t.gravity))) if t.gravity.any() else 0.0, _pulls(t)) for t in rested]
    return Conditions(
        tilt_deg=max((tilt for tilt, _ in tilts), default=0.0),
        pulled_tilt_deg=max((tilt for tilt, pulls in tilts if pulls.max(initial=0) > PULLED), default=0.0),
        pull=max((float(pulls.max(initial=0)) for _, pulls in tilts), default=0.0),
        pulls=max((float(pulls.sum(axis=1).max()) for _, pulls in tilts), default=0.0),
    )


def _pulls(trial: Trial) -> np.ndarray:
    """What each motor draws in, m. Shape (T, K)."""
    return np.maximum(trial.commands, 0) if trial.commands.size else np.zeros((1, 0))
