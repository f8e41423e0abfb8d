"""(5) What each term of the model costs a simulation step, and what half the step changes with it.

Terms of the joints are timed on releases, in which all cables hang slack and cost nothing; those of cables and motors
on curls, as they do nothing in a release.
"""

from dataclasses import dataclass, field, replace
from functools import partial

import mujoco
import numpy as np

from benchmarks.identification.case import ReadCase, Size
from benchmarks.identification.timing import alternate
from stages.build_mjcf import Config, cad_arm
from trunkline.identification.simulate.experiment import Experiment
from trunkline.identification.simulate.population import Population
from trunkline.model.arm.guide_holes import GuideHoles
from trunkline.model.arm.joints import JenkinsElement, Joints, MaxwellElement
from trunkline.pipeline.config import load_config

CANDIDATES = 4
BRANCHES = [MaxwellElement(0.3, 0.5), MaxwellElement(0.2, 2.0)]
SLIDERS = [JenkinsElement(0.2, 0.02), JenkinsElement(0.1, 0.05), JenkinsElement(0.1, 0.1)]
HOLES = GuideHoles(0.2, 8)
DEAD_TIME, RATE_LIMIT, BACKLASH = 0.02, 0.25, 3e-4  # s, m/s, m


@dataclass
class Terms:
    """What a row's model has beside springs, dampers and motors with a lag; s, m/s and m."""

    joints: Joints = field(default_factory=Joints)
    holes: GuideHoles = field(default_factory=GuideHoles)
    dead_time: float = 0.0
    rate_limit: float = 0.0
    backlash: float = 0.0


NONE = "springs, dampers, lag"
OF_JOINTS = {
    NONE: Terms(),
    "a Maxwell branch": Terms(Joints(BRANCHES[:1])),
    "two Maxwell branches": Terms(Joints(BRANCHES)),
    "a Jenkins element": Terms(Joints(sliders=SLIDERS[:1])),
    "three Jenkins elements": Terms(Joints(sliders=SLIDERS)),
    "round joints": Terms(Joints(round=True)),
    "all of these": Terms(Joints(BRANCHES, SLIDERS, round=True)),
}
OF_CABLES = {
    NONE: Terms(),
    "motors with a dead time": Terms(dead_time=DEAD_TIME),
    "winches: rate and backlash": Terms(rate_limit=RATE_LIMIT, backlash=BACKLASH),
    "capstan friction": Terms(holes=HOLES),
    "all, those of joints too": Terms(Joints(BRANCHES, SLIDERS, round=True), HOLES, DEAD_TIME, RATE_LIMIT, BACKLASH),
}
ON = {"release": ("identify_damping", OF_JOINTS), "curl": ("identify_control", OF_CABLES)}  # by kind of trial


def report(read_case: ReadCase, size: Size) -> None:
    print(f"(5) {'terms':26s} {'on':8s} CPU us/step   of the first   largest change by half the step (mm)")
    for kind, (stage, terms) in ON.items():
        case = read_case(stage, replace(size, trials=99, frames=size.rate_frames))
        experiments = [e for e in case.experiments if e.kind == kind]
        models = {name: model_with(own) for name, own in terms.items()}
        rivals = {name: partial(steps, model, experiments, case.fit.segments) for name, model in models.items()}
        times = alternate(rivals, size.repeats)
        for name, spent in times.items():
            change, ratio = halved(models[name], experiments, case.fit.segments), spent.cpu / times[NONE].cpu
            print(f"    {name:26s} {kind:8s} {1e6 * spent.cpu:11.1f} {ratio:14.2f} {1e3 * change:20.2f}")
        print(f"    {kind}: {CANDIDATES} candidates x {len(experiments)} trials of {size.rate_frames} frames")


def model_with(terms: Terms) -> mujoco.MjModel:
    """The CAD model of the pipeline's settings, with these terms and no others."""
    config = load_config(Config, "build_mjcf")
    config.joints, config.holes = terms.joints, terms.holes
    motors = {name: getattr(terms, name) for name in ("dead_time", "rate_limit", "backlash")}
    config.actuation = replace(config.actuation, **motors)
    return cad_arm(config).spec.compile()


def steps(model: mujoco.MjModel, experiments: list[Experiment], segments: tuple[str, ...]) -> int:
    fields = {"jnt_stiffness": np.repeat(model.jnt_stiffness[None], CANDIDATES, axis=0)}
    return Population(model, experiments, segments).simulate(fields).steps


def halved(model: mujoco.MjModel, experiments: list[Experiment], segments: tuple[str, ...]) -> float:
    """Largest distance between a segment and itself, simulated at half the step, m."""
    fields = {"jnt_stiffness": model.jnt_stiffness[None]}
    whole, half = (Population(model, experiments, segments, factor).simulate(fields).positions for factor in (1.0, 0.5))
    return max(float(np.linalg.norm(a - b, axis=-1).max()) for a, b in zip(whole, half, strict=True))
