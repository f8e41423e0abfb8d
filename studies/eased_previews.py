"""What do cheaper contacts save a preview, and what do they change? Random grasps, with the contacts of the model
itself, with `trunkline.ar.hybrid.rollouts.eased` ones, and with a solver that is only more exact: so far chance goes.

    python -m studies.eased_previews [arm.xml] [--grasps 24] [--futures 3]

Grasps are those of `benchmarks.preview`, but diameter, mass and place along the arm and beside it are drawn, so widely
that about half of the grasps drop it. Each grasp is tried with all contacts in turn, so that a busy machine slows them
alike; the tip's distance is a mean over a future.
"""

import argparse
import copy
import time
from collections.abc import Callable
from dataclasses import dataclass, field
from pathlib import Path
from unittest.mock import patch

import mujoco
import numpy as np

from benchmarks.preview import LET_GO, STAGES, Placing, grasp
from trunkline.ar.hybrid import rollouts as room
from trunkline.ar.hybrid.posterior import read_posterior, sample
from trunkline.ar.hybrid.preview import Holding, joined
from trunkline.ar.hybrid.rollouts import CommandTrajectory, ComposedTwin, eased
from trunkline.model.arm.contact_geometry import read_geometry
from trunkline.pipeline.inputs import read_spec
from upkeep.results import recorded

STEP = 1 / 240  # s
MASSES = (0.05, 0.1, 0.15, 0.25, 0.4, 0.6)  # kg


def exact(model: mujoco.MjModel, hanging: bool) -> mujoco.MjModel:
    model = copy.copy(model)
    model.opt.tolerance *= 1e-2
    return model


CONTACTS: dict[str, Callable[[mujoco.MjModel, bool], mujoco.MjModel]] = {
    "the model's own": lambda model, hanging: model,
    "solved 100 times as exactly": exact,
    "eased": eased,
}


@dataclass
class Tries:
    """Of all futures so far: seconds, whether each held, and tips (F, 3) each."""

    seconds: float = 0.0
    held: list[bool] = field(default_factory=list)
    tips: list[np.ndarray] = field(default_factory=list)


@recorded("eased_previews")
def main(path: Path, grasps: int, futures: int) -> None:
    doubts = read_posterior([path.parents[1] / stage / "parameters.json" for stage in STAGES])
    found = {name: Tries() for name in CONTACTS}
    for seed in range(grasps):
        twin, way = grasp(path, placing(seed))
        draws = sample(doubts, twin.arm, futures, seed)
        for name, contacts in CONTACTS.items():
            attempt(found[name], twin.stepped(STEP), way, draws, contacts)
    first, *_ = found.values()
    length = read_geometry(read_spec(path)).length
    for name, tries in found.items():
        away = [np.linalg.norm(a - b, axis=1).mean() for a, b in zip(tries.tips, first.tips, strict=True)]
        same = sum(a == b for a, b in zip(tries.held, first.held, strict=True))
        print(
            f"{name}: {tries.seconds / first.seconds:.2f} of the seconds; held {sum(tries.held)} of {len(tries.held)}, "
            f"{same} as at first; tip {100 * np.median(away) / length:.2f} % of the length away, median"
        )


def placing(seed: int) -> Placing:
    rng = np.random.default_rng(seed)
    return Placing(
        diameter=rng.uniform(0.025, 0.065), mass=float(rng.choice(MASSES)), wrap=rng.uniform(0.35, 0.85),
        gap=rng.uniform(0.0, 0.03), beside=0.008 * rng.normal(),
    )  # fmt: skip


def attempt(tries: Tries, twin: ComposedTwin, way: CommandTrajectory, draws, contacts: Callable) -> None:
    """The futures of one grasp, added to `tries`."""
    with patch.object(room, "eased", contacts):
        began = time.process_time()
        motion = joined(list(room.rollouts(twin, way, draws)))
        tries.seconds += time.process_time() - began
    tries.held += Holding(LET_GO, sag=0.25).holds(motion).tolist()
    tries.tips += list(motion.tip)


if __name__ == "__main__":
    parser = argparse.ArgumentParser(description=__doc__)
    parser.add_argument("path", nargs="?", type=Path, default=Path("artifacts/identify_control/arm.xml"))
    parser.add_argument("--grasps", type=int, default=24)
    parser.add_argument("--futures", type=int, default=3)
    options = parser.parse_args()
    main(options.path, options.grasps, options.futures)
