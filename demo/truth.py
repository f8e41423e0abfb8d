"""What the plant did in one trial, exact and in the world frame: the instruments see it, identification never does."""

from dataclasses import dataclass

import numpy as np

from trunkline.recordings.trials.recording import TrialRecording


@dataclass(kw_only=True)
class Truth(TrialRecording):
    """One trial of T instants, S markers, K tendons and Tc commands. The world is z-up, in metres.

    time: (T,) s, uniform at 480 Hz or more, from 0.
    begin: s, when the arm is let go or the first command leaves; 0 for a static trial.
    base_position (3,), base_quaternion (4,) wxyz: pose of the base in the world, constant in a trial.
    positions (T, S, 3), quaternions (T, S, 4) wxyz: the markers in the world.
    command_time (Tc,) s, below 0 for what brought the arm to rest, commands (Tc, K): m of pull, as sent.
    tendon_positions (T, K): m of pull, as wound.
    """

    begin: float = 0.0
    base_position: np.ndarray
    base_quaternion: np.ndarray
    command_time: np.ndarray
