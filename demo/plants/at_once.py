"""Commands sent at once to the arm on the bench, which hangs at rest and then moves by itself until it rests again."""

import numpy as np

from demo.plants.bench import COMMAND_RATE, LOOSE, Bench, Plant
from demo.plants.choice import ArmChoice
from demo.plants.slowly import tips_of
from trunkline.model.arm.spiral import spiral_chain

WAITS = (8.0, 16.0)  # s after the command, the longer one for arms that still swing; cables wind for 1 to 2 s of it
LOOK = 1.0  # s at the end in which the tip is looked at, more than one of its swings at 1.3 Hz
STILL = 2e-3  # m, across all that the tip moves meanwhile: it swings by 0.2 % of the arm's length to each side at most


def tips_at_once(plant: Plant, drawn: ArmChoice, pulls: np.ndarray, gravity: np.ndarray) -> np.ndarray:
    """Where the tip rests, m, in the frame of the base marker; NaN where it still moves after the longest wait. (N, 3).

    The mount is tilted while all cables are loose. The arm hangs at rest then; its friction is of that way.

    Args:
        pulls: commands as they are sent, m, also to motors that pay out. Shape (N, K).
        gravity: m/s², in the frame of the base marker. Shape (N, 3).
    """
    unit = spiral_chain(drawn.length, drawn.base_width, drawn.tip_width, drawn.units).lengths[-1]
    tips = np.full((len(pulls), 3), np.nan)
    for wait in WAITS:
        moving = np.flatnonzero(np.isnan(tips).any(axis=1))
        if not len(moving):
            break
        commands = np.repeat(pulls[moving, None].astype(float), round(wait * COMMAND_RATE), axis=1)
        commands[:, 0] = -LOOSE
        bench = Bench(
            gravity[moving], commands, np.zeros_like(commands), np.zeros(len(moving)), hanging=True, since=wait - LOOK
        )
        tips[moving] = rested(tips_of(plant.run("drives", bench, [drawn.units - 1]), unit))
    return tips


def rested(ways: np.ndarray) -> np.ndarray:
    """The middle of each way (N, F, 3), m; NaN where it extends further than STILL along any axis. Shape (N, 3)."""
    still = np.ptp(ways, axis=1).max(axis=1) <= STILL
    return np.where(still[:, None], ways.mean(axis=1), np.nan)
