"""The lab's arm on its rig: commands in, tips out. What `train_ik` drives to see what its network is worth outside."""

from pathlib import Path
from typing import Any

import numpy as np

from demo.plants.choice import Choice, plant_of
from trunkline.pipeline.config import load_config
from trunkline.settings import settings

ROOT = Path(__file__).parent


@settings
class Config(Choice):
    """The lab's settings. What is done with the arm, and how it is measured, is no matter here."""

    experiments: dict[str, Any]
    instruments: dict[str, Any]


def reach(pulls: np.ndarray, gravity: np.ndarray) -> np.ndarray:
    """Where the tip of the lab's arm comes to rest, with its friction, from straight, in the base frame, m.

    Args:
        pulls: commands of the motors, m of pull from the straight arm's path length. Shape (N, K).
        gravity: in the base frame, m/s². Shape (N, 3).
    """
    return plant_of(load_config(Config, "record", ROOT)).reach(pulls, gravity)
