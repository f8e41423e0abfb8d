"""How often the true tip lies inside the radius that the certificate states: `python -m studies.certificate`

The stand-in lab's arm is brought to poses that no trial of its session has, within what the certificate says it is for,
as slowly as in the session's pulls, half of them from straight and half from beyond, and left to creep to rest. Where
its tip then is, the lab knows; it is held against the twin's tip and the radius that the certificate has for that pose.
Poses that are done are kept in docs/results/certificate.csv, as they take half an hour; the budget is made anew.
"""

import argparse
import sys
from contextlib import redirect_stdout
from dataclasses import dataclass
from pathlib import Path

import numpy as np

from demo.plants.bench import COMMAND_RATE, LOOSE, Bench, Plant
from demo.plants.choice import plant_of
from demo.rig import ROOT, Config
from studies.rows import Rows, digest
from trunkline.certificate.poses import PULLED, Poses, conditions_of, draw_poses
from trunkline.errors import in_one_line
from trunkline.pipeline.config import load_config
from trunkline.pipeline.inputs import read_model
from trunkline.statics.chain import read_chain
from trunkline.trials.splits import DECIDING
from trunkline.trials.trial import read_trials

MODEL, TRIALS = Path("artifacts/identify_control/arm.xml"), Path("data/processed/filter")
COUNT, SEED, BATCH = 500, 20, 20


@dataclass
class Slow:
    """How a pose is reached, as the lab's settings of its slow pulls: s, and times the pull."""

    pull_ramp: float
    pull_beyond: float
    pull_turn: float
    pull_back: float
    pull_settle: float


def true_tips(plant: Plant, tip: np.ndarray, slow: Slow, poses: Poses, pulls: np.ndarray, back: np.ndarray):
    """Where the tip of the lab's arm rests, m, in the frame of its base. Shape (N, 3).

    Args:
        tip: from the centre of the last unit, in its frame, m. Shape (3,).
        pulls: of the motors, m. Shape (N, K). back: whether they come from beyond. Shape (N,).
    """
    ends = np.cumsum([0, slow.pull_ramp, slow.pull_turn, slow.pull_back])
    time = np.arange(round((ends[-1] + slow.pull_settle + 0.1) * COMMAND_RATE)) / COMMAND_RATE
    beyond = np.where(back, slow.pull_beyond, 1.0)
    profiles = np.array([np.interp(time, ends, [0, far, far, 1]) for far in beyond])
    commands = np.where(pulls[:, None] > PULLED, profiles[..., None] * pulls[:, None], -LOOSE)
    loads = np.zeros(len(poses))
    bench = Bench(poses.gravity, commands, np.zeros_like(commands), loads, since=ends[-1] + slow.pull_settle)
    seen = plant.run("poses", bench, [plant.chain.units - 1])
    return seen.positions[:, -1, 0] + seen.rotations[:, -1, 0] @ tip


@in_one_line
def main() -> int:
    parser = argparse.ArgumentParser(prog="studies.certificate", description=__doc__)
    parser.add_argument("--poses", type=int, default=COUNT)
    arguments = parser.parse_args()
    chain = read_chain(read_model(MODEL))
    settings = load_config(Config, "record", ROOT)
    slow = Slow(**{name: settings.experiments[name] for name in Slow.__annotations__})
    plant = plant_of(settings)
    tip = np.array([0.0, 0.0, -plant.chain.lengths[-1] / 2])
    conditions = conditions_of(read_trials(TRIALS, DECIDING))
    rng = np.random.default_rng(SEED)
    poses = draw_poses(chain, conditions, COUNT, rng)
    pulls, back = chain.straight_lengths - poses.commands, rng.random(COUNT) < 0.5
    rows = Rows("certificate", digest((SEED, conditions), Path("demo/plants"), ROOT / "conf"), "pose")
    done = len(rows.read())
    with redirect_stdout(sys.stderr):
        for first in range(done, arguments.poses, BATCH):
            chosen = slice(first, first + BATCH)
            tips = true_tips(plant, tip, slow, poses[chosen], pulls[chosen], back[chosen])
            for index, place in enumerate(tips.tolist(), start=first):
                rows.add(str(index), **dict(zip("xyz", place, strict=True)))
    return 0


if __name__ == "__main__":
    sys.exit(main())
