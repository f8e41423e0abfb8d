"""The lab's arm on its rig: commands in, tips out. What `train_ik` drives to see what its network is worth outside, and
`report` to see how often the tip is where the certificate says."""

from pathlib import Path
from typing import Any

import numpy as np

from demo.plants.at_once import tips_at_once
from demo.plants.choice import Choice, plant_of
from demo.plants.slowly import Slow, slow_tips
from trunkline.pipeline.config import load_config
from trunkline.settings import settings

ROOT = Path(__file__).parent


@settings
class Config(Choice):
    """The lab's settings. How the arm is measured is no matter here."""

    experiments: dict[str, Any]
    instruments: dict[str, Any]


def reach(pulls: np.ndarray, gravity: np.ndarray) -> np.ndarray:
    """Where the tip of the lab's arm comes to rest by itself after commands that are sent at once, in the base frame,
    m; NaN where it does not rest. Shape (N, 3). The mount is tilted before, while the arm hangs with loose cables.

    Args:
        pulls: commands of the motors, m of pull from the straight arm's path length. Shape (N, K).
        gravity: in the base frame, m/s². Shape (N, 3).
    """
    lab = load_config(Config, "record", ROOT)
    return tips_at_once(plant_of(lab), lab.arm, pulls, gravity)


def bring(pulls: np.ndarray, gravity: np.ndarray, back: np.ndarray) -> np.ndarray:
    """Where the tip of the lab's arm rests after it was brought there as slowly as in the session's pulls, in the base
    frame, m; NaN where it does not rest. Shape (N, 3).

    Args:
        pulls, gravity: as for `reach`; a motor whose pull is not more than 0 is loose.
        back: whether a pull comes from beyond, not from straight. Shape (N,).
    """
    lab = load_config(Config, "record", ROOT)
    slow = Slow(**{name: lab.experiments[name] for name in Slow.__annotations__})
    return slow_tips(plant_of(lab), lab.arm, slow, pulls, gravity, back)
