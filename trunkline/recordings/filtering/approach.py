"""From which side motors brought the arm to where they hold it at rest: friction holds it on that side.

While a motor draws its cable in, the cable slides over its holes towards the motor, and loses tension on the way to the
tip. While the motor pays out, the cable slides the other way, and tension rises towards the tip (see
`trunkline/model/statics/capstan.py`).
"""

import numpy as np

from trunkline.recordings.trials.raw_trial import RawTrial
from trunkline.recordings.trials.recording import PULLED


def approach_of(raw: RawTrial) -> int:
    """1 if all motors that pull at last drew their cables in, -1 if all at last paid out, 0 if neither is known: where
    they differ, or the commands do not go back to before the arm was at rest."""
    before = raw.command_time + raw.clock_offset <= 0.5 * raw.time[-1]
    if not before.any():
        return 0
    motions = last_motions(raw.commands[before], PULLED[raw.command_unit])
    ways = set(motions[raw.commands[before][-1] > 0].tolist())
    return ways.pop() if len(ways) == 1 else 0


def last_motions(commands: np.ndarray, least: float) -> np.ndarray:
    """Of every motor the sign of its last motion by more than `least`, 0 where there is none. Shape (K,).

    Args:
        commands: of pull. Shape (T, K). least: several times the sliding within which friction turns round.
    """
    way = commands[-1] - commands
    moved = np.abs(way) > least
    last = len(commands) - 1 - np.argmax(moved[::-1], axis=0)
    signs = np.sign(np.take_along_axis(way, last[None], axis=0)[0])
    return np.where(moved.any(axis=0), signs, 0).astype(int)
