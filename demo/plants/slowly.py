"""The arm on the bench brought slowly to poses, as the session's pulls and tilts are, and looked at where it rests."""

from dataclasses import dataclass

import numpy as np

from demo.plants.bench import COMMAND_RATE, LOOSE, Bench, Plant, PlantMotion
from demo.plants.choice import ArmChoice
from trunkline.model.arm.spiral import spiral_chain

LOOK = 0.1  # s, for which the arm is looked at
SWINGING = 0.05  # m/s of the tip, from which on an arm does not rest: at its 1.3 Hz it swings by 6 mm to each side


@dataclass
class Slow:
    """How a pose is reached, as the lab's settings of its slow pulls and tilts: s, and times the pull or damping."""

    settle: float
    steady_factor: float
    pull_ramp: float
    pull_beyond: float
    pull_turn: float
    pull_back: float
    pull_settle: float


def slow_tips(
    plant: Plant, drawn: ArmChoice, slow: Slow, pulls: np.ndarray, gravity: np.ndarray, back: np.ndarray
) -> np.ndarray:
    """Where the tip rests, m, in the frame of the base marker; NaN where the arm still swings. Shape (N, 3).

    Args:
        pulls: of the motors, m, not more than 0 where one is loose. Shape (N, K).
        gravity: m/s², in the frame of the base marker. Shape (N, 3).
        back: whether a pull comes from beyond. Shape (N,).
    """
    last = spiral_chain(drawn.length, drawn.base_width, drawn.tip_width, drawn.units).lengths[-1]
    tips = np.empty((len(pulls), 3))
    for pulled in (True, False):  # an arm that only hangs is steadied by a hand, as the lab does it
        chosen = np.flatnonzero((pulls > 0).any(axis=1) == pulled)
        if not len(chosen):
            continue
        moved = np.cumsum([0, slow.pull_ramp, slow.pull_turn, slow.pull_back]) * pulled
        rest = moved[-1] + (slow.pull_settle if pulled else slow.settle)
        time = np.arange(round((rest + LOOK) * COMMAND_RATE)) / COMMAND_RATE
        beyond = np.where(back[chosen], slow.pull_beyond, 1.0)
        profiles = np.array([np.interp(time, moved, [0, far, far, 1]) for far in beyond])
        sent = pulls[chosen, None]
        commands = np.where(sent > 0, profiles[..., None] * sent, -LOOSE)
        bench = Bench(
            gravity[chosen], commands, np.zeros_like(commands), np.zeros(len(chosen)),
            steady=0.0 if pulled else slow.settle, steady_factor=slow.steady_factor, since=rest,
        )  # fmt: skip
        motion = plant.run("poses", bench, [drawn.units - 1])
        tips[chosen] = rested(tips_of(motion, last))
    return tips


def tips_of(motion: PlantMotion, unit: float) -> np.ndarray:
    """Of a motion of the last unit, whose length is `unit`, m: its lower end, m. Shape (n, F, 3)."""
    return motion.positions[:, :, 0] + motion.rotations[:, :, 0] @ np.array([0.0, 0.0, -unit / 2])


def rested(ways: np.ndarray) -> np.ndarray:
    """The last point of each way (N, F, 3), m, that was looked at for `LOOK` s; NaN where it still moves. (N, 3)."""
    speed = np.linalg.norm(ways[:, -1] - ways[:, 0], axis=1) / LOOK
    return np.where((speed < SWINGING)[:, None], ways[:, -1], np.nan)
