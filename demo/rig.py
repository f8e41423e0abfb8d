"""The lab's arm on its rig: commands in, tips out. What `train_ik` drives to see what its network is worth outside."""

import copy
from pathlib import Path

import numpy as np

from demo.plant import build_plant
from demo.record import Config
from trunkline.arm.spiral import spiral_chain
from trunkline.pipeline.config import load_config
from trunkline.simulation.drive import drive

ROOT = Path(__file__).parent
CALM = 8.0  # times the arm's damping: it comes to rest sooner, and in the same place
SECONDS = 8.0


def reach(commands: np.ndarray, gravity: np.ndarray) -> np.ndarray:
    """Where the tip of the lab's arm comes to rest, with its friction, from straight, in the base frame, m.

    Args:
        commands: of the motors, m. Shape (N, K).
        gravity: in the base frame, m/s². Shape (N, 3).
    """
    config = load_config(Config, "record", ROOT)
    arm = config.arm
    rng, *_ = np.random.default_rng(config.seed).spawn(3)
    plant = copy.copy(
        build_plant(
            spiral_chain(arm.length, arm.base_width, arm.tip_width, arm.units), config.plant, arm.tendons, rng
        )
    )
    plant.dof_damping[:] *= CALM
    no_hand = np.zeros_like(commands)
    return drive(plant, np.concatenate([commands, no_hand], axis=1), gravity, SECONDS).end
