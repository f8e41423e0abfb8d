"""What every form of a trial says: planned, simulated by the stand-in lab, as recorded, and as filtered."""

from dataclasses import dataclass

import numpy as np

LENGTH, FORCE = "m", "N"  # units of commands: of cable that a motor draws in, or of the tension with which it pulls
PULLED = {LENGTH: 1e-3, FORCE: 0.05}  # by unit, from which on a tendon counts as pulled


@dataclass(kw_only=True)
class PlannedTrial:
    """What the experimenter says of a trial.

    name: unique within the session. experiment: one of `experiments.EXPERIMENTS`. split: what the trial may be used
    for, one of `splits.SPLITS`. level: nominal, in the unit of its experiment; None where there is none. load: kg that
    hang at the tip in this trial, beside what hangs there always. session: to which it belongs; "" where there is one.
    """

    name: str
    experiment: str
    split: str
    level: float | None
    load: float = 0.0
    session: str = ""


@dataclass(kw_only=True)
class TrialRecording(PlannedTrial):
    """A trial of T frames, S markers and K tendons.

    time: (T,) s from the first frame. positions (T, S, 3) m, quaternions (T, S, 4) wxyz or None: of the markers.
    commands: m of pull, or N of tension, as `command_unit` says; tendon_positions: m of pull, or the commands again
    where nothing was measured; one column a tendon. What else a frame, a clock or a gap means is told by the class that
    derives from this one.
    """

    time: np.ndarray
    markers: tuple[str, ...]
    positions: np.ndarray
    quaternions: np.ndarray | None
    tendons: tuple[str, ...]
    commands: np.ndarray
    tendon_positions: np.ndarray
    command_unit: str = LENGTH
