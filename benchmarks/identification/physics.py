"""(5) What each term of the model costs a simulation step, and what half the step changes with it."""

from dataclasses import replace
from functools import partial

import mujoco
import numpy as np

from benchmarks.identification.case import ReadCase, Size
from benchmarks.identification.timing import alternate
from stages.build_mjcf import Config, cad_arm
from trunkline.arm.holes import Holes
from trunkline.arm.joints import Branch, Joints, Slider
from trunkline.identification.experiment import Experiment
from trunkline.identification.population import Population
from trunkline.pipeline.config import load_config

CANDIDATES = 4
BRANCHES, SLIDERS = [Branch(0.3, 0.5), Branch(0.2, 2.0)], [Slider(0.2, 0.02)]
TERMS = {
    "springs and dampers": Joints(),
    "a Maxwell branch": Joints(BRANCHES[:1]),
    "two Maxwell branches": Joints(BRANCHES),
    "a Jenkins element": Joints(sliders=SLIDERS),
    "all of these": Joints(BRANCHES, SLIDERS),
}
DEAD_TIME = 0.02  # s


def report(read_case: ReadCase, size: Size) -> None:
    case = read_case("identify_damping", replace(size, trials=99, frames=size.rate_frames))
    models = {name: model_with(joints) for name, joints in TERMS.items()}
    models["motors with a dead time"] = model_with(Joints(), DEAD_TIME)
    rivals = {name: partial(steps, model, case.experiments, case.fit.segments) for name, model in models.items()}
    times = alternate(rivals, size.repeats)
    print(f"(5) terms: {CANDIDATES} candidates x {len(case.experiments)} releases of {size.rate_frames} frames")
    print("                                CPU us/step   of the first   largest change by half the step (mm)")
    first = next(iter(times.values()))
    for name, spent in times.items():
        change = halved(models[name], case.experiments, case.fit.segments)
        print(f"    {name:25s} {1e6 * spent.cpu:13.1f} {spent.cpu / first.cpu:14.2f} {1e3 * change:20.2f}")


def model_with(joints: Joints, dead_time: float = 0.0) -> mujoco.MjModel:
    """The CAD model of the pipeline's settings, with these joints."""
    config = load_config(Config, "build_mjcf")
    config.joints, config.holes, config.actuation.dead_time = joints, Holes(), dead_time
    return cad_arm(config).spec.compile()


def steps(model: mujoco.MjModel, experiments: list[Experiment], segments: tuple[str, ...]) -> int:
    fields = {"jnt_stiffness": np.repeat(model.jnt_stiffness[None], CANDIDATES, axis=0)}
    return Population(model, experiments, segments).simulate(fields).steps


def halved(model: mujoco.MjModel, experiments: list[Experiment], segments: tuple[str, ...]) -> float:
    """Largest distance between a segment and itself, simulated at half the step, m."""
    fields = {"jnt_stiffness": model.jnt_stiffness[None]}
    whole, half = (Population(model, experiments, segments, factor).simulate(fields).positions for factor in (1.0, 0.5))
    return max(float(np.linalg.norm(a - b, axis=-1).max()) for a, b in zip(whole, half, strict=True))
