"""(4) How time grows with the population, the trials and the arm's units."""

from dataclasses import replace

import mujoco
import numpy as np

from benchmarks.identification.case import Case, ReadCase, Size
from benchmarks.identification.timing import Spent, alternate
from stages import build_mjcf
from trunkline.frames import gravity_in_base
from trunkline.identification.simulate.experiment import SLACK, Experiment
from trunkline.identification.simulate.pose_fit import PoseFit
from trunkline.model.arm.cad import ChainArm
from trunkline.model.elements import arm_hinges, cables
from trunkline.model.statics.supported import unit_bodies
from trunkline.pipeline.config import load_config
from trunkline.recordings.trials.splits import IDENTIFY

CANDIDATES = 10
BEND = np.radians(270)  # of the whole arm


def report(read_case: ReadCase, size: Size) -> None:
    case = read_case("identify_damping", replace(size, trials=99, frames=size.growth_frames))
    trials = len(case.experiments)
    print(
        f"(4) one evaluation: {CANDIDATES} candidates x {trials} releases (units: x 1) of {size.growth_frames} frames"
    )
    for axis, times in growth(case, size).items():
        (least, first), *_, (most, last) = times.items()
        power = np.log(last.cpu / first.cpu) / np.log(most / least)
        row = ", ".join(f"{n}: {spent.wall:.2f} s (CPU {spent.cpu:.2f})" for n, spent in times.items())
        print(f"    {axis:10s} {row}; CPU time grows as {axis}^{power:.2f}")


def growth(case: Case, size: Size) -> dict[str, dict[int, Spent]]:
    """Time of one evaluation of a population, s, over its size, its trials and the arm's units."""
    base, trials = CANDIDATES, len(case.experiments)
    return {
        "candidates": {n: _evaluation_time(case, n, trials, size.repeats) for n in (5, base, 2 * base, 4 * base)},
        "trials": {n: _evaluation_time(case, base, n, size.repeats) for n in sorted({1, (trials + 1) // 2, trials})},
        "units": {n: _evaluation_time(_case_of_units(case, n), base, 1, size.repeats) for n in size.units},
    }


def _evaluation_time(case: Case, count: int, trials: int, repeats: int) -> Spent:
    problem = replace(case, experiments=case.experiments[:trials]).problem()
    own = problem.start()
    vectors = own + np.random.default_rng(0).uniform(-0.2, 0.2, (count, len(own)))
    return alternate({"": lambda: len([problem.losses(vectors)])}, repeats)[""]


def _case_of_units(case: Case, units: int) -> Case:
    first = case.experiments[0]
    config = load_config(build_mjcf.Config, "build_mjcf")
    assert isinstance(config.arm, ChainArm)
    model = build_mjcf.cad_arm(replace(config, arm=replace(config.arm, units=units))).spec.compile()
    experiment, segments = bent_release(model, first.frames, first.frame_step)
    return replace(case, model=model, experiments=[experiment], fit=replace(case.fit, segments=segments))


def bent_release(model: mujoco.MjModel, frames: int, frame_step: float) -> tuple[Experiment, tuple[str, ...]]:
    """A release that is compared with nothing, and the segments it tracks."""
    units = arm_hinges(model) // 2
    start = np.tile([0.0, BEND / units], units)
    segments = tuple(model.body(i).name for i in unit_bodies(model))
    positions = np.zeros((frames, len(segments), 3))
    experiment = Experiment(
        name="bent",
        kind="release",
        split=IDENTIFY,
        gravity=gravity_in_base(0.0),
        start=start,
        lead=frame_step,
        controls=np.tile(model.tendon_length0[cables(model)] + SLACK, (frames, 1)),
        positions=positions,
        measured=np.ones(positions.shape[:2], bool),
        frame_step=frame_step,
        velocity=np.zeros(len(start)),
        fit=PoseFit(start, np.zeros(len(segments)), 0, True),
    )
    return experiment, segments
