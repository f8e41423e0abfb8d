"""What each part of the model is worth on real releases: `python -m benchmarks.real_arm`

Identifies the example examples/asl_trunk again and again, each time without one thing that its model has or with one
that it has not, and prints the mean position error on the validate releases. Run its stages up to filter first.
"""

import sys
from collections.abc import Callable
from dataclasses import replace
from pathlib import Path

import mujoco
import numpy as np

from stages.build_mjcf import Config, initial_spec
from trunkline.config import load_config
from trunkline.errors import InputError
from trunkline.identification.evaluation import replay, scores
from trunkline.identification.experiment import prepare
from trunkline.identification.identify import Method, identify
from trunkline.identification.loss import LossWeights
from trunkline.identification.problem import Bounds
from trunkline.identification.resting import resting_shape
from trunkline.identification.search import LeastSquares
from trunkline.recording.filtering import Filter, filter_take
from trunkline.recording.take import Take, read_takes

EXAMPLE = Path("examples/asl_trunk")
FILTER = Filter(120.0, 20.0, 4, 0.06, 8.0, "free")
FRAMES = 437
WEIGHTS = LossWeights(0.2, 2.0, 0.02, 0.002, 1.0, 0.01)
METHOD = Method(LeastSquares(11, 2, 6, 1e-2), 1.0, 240, 4, 10, 1e-5, LeastSquares(0, 1, 8, 1e-3), 0.5, 1)
RANGES = {"stiffness": Bounds(0.3, 30.0), "damping": Bounds(0.01, 5.0)}


def arm(**changes) -> mujoco.MjModel:
    """The example's initial arm, with other numbers."""
    config = load_config(Config, "build_mjcf", EXAMPLE)
    return initial_spec(replace(config, arm=replace(config.arm, **changes)))[0].compile()


def as_stamped(take: Take) -> Take:
    """A take without the time of its lost frames."""
    return replace(take, time=np.arange(len(take.time)) * np.median(np.diff(take.time)))


def error(
    takes: list[Take],
    model: mujoco.MjModel,
    ranges: dict[str, Bounds],
    filtered: Filter = FILTER,
    straight: bool = False,
    per_joint: tuple[str, ...] = (),
) -> tuple[float, float]:
    """Mean position error on the identify and on the validate releases after identification, mm."""
    experiments = [prepare(filter_take(take, filtered)[0], model, FRAMES) for take in takes]
    segments = takes[0].segments
    rest = None if straight else resting_shape(model, experiments, segments)
    found = identify("", model, experiments, segments, ranges, per_joint, "positions", WEIGHTS, METHOD, rest)
    table = scores(replay(found.models["identified"], experiments, segments), experiments, "positions", WEIGHTS)
    return table["identify"]["e_position_mm"], table["validate"]["e_position_mm"]


def damped(model: mujoco.MjModel, share: float) -> mujoco.MjModel:
    """With a damping that grows with speed v (rad/s) as D (1 + `share` v)."""
    model.dof_dampingpoly[:, 0] = share * model.dof_damping
    return model


def cases(takes: list[Take]) -> dict[str, Callable[[], tuple[float, float]]]:
    """What is tried, by what it is called."""
    mass = load_config(Config, "build_mjcf", EXAMPLE).arm.unit_masses[0]
    return {
        "as in the example": lambda: error(takes, arm(), RANGES),
        "started at rest when the arm begins to move": lambda: error(
            takes, arm(), RANGES, replace(FILTER, release="onset")
        ),
        "straight at rest": lambda: error(takes, arm(), RANGES, straight=True),
        "lost frames left lost": lambda: error([as_stamped(take) for take in takes], arm(), RANGES),
        "with hardening": lambda: error(takes, arm(), RANGES | {"hardening": Bounds(0.02, 50.0)}),
        "with joint friction": lambda: error(takes, arm(), RANGES | {"joint_friction": Bounds(1e-4, 0.1)}),
        "with quadratic damping": lambda: error(takes, damped(arm(), 1.0), RANGES),
        "with factors of every joint's stiffness": lambda: error(takes, arm(), RANGES, per_joint=("stiffness",)),
        "hose half as heavy": lambda: error(takes, arm(unit_masses=[mass / 2]), RANGES),
        "hose twice as heavy": lambda: error(takes, arm(unit_masses=[2 * mass]), RANGES),
        "6 units": lambda: error(takes, arm(units=6), RANGES),
        "12 units": lambda: error(takes, arm(units=12), RANGES),
    }


def main() -> int:
    try:
        takes = read_takes(EXAMPLE / "data/processed/ingest")
    except InputError as problem:
        print(f"error: {problem}", file=sys.stderr)
        return 1
    length = load_config(Config, "build_mjcf", EXAMPLE).arm.length
    print(f"{'':45}  identify  validate: mean position error, and of the length")
    for name, run in cases(takes).items():
        identify_mm, validate_mm = run()
        print(f"{name:45}  {identify_mm:5.2f} mm  {validate_mm:5.2f} mm  {validate_mm / length / 10:.2f} %", flush=True)
    return 0


if __name__ == "__main__":
    sys.exit(main())
