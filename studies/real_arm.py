"""What each part of the model is worth on real releases: `python -m studies.real_arm`

Identifies the example examples/asl_trunk again and again, as its stage identify_stiffness does, each time without one
thing that its model has or with one that it has not, and prints the mean position error on the validate releases. Run
its stages up to filter first.
"""

import contextlib
import io
import sys
from dataclasses import dataclass, field, replace
from pathlib import Path

import mujoco
import numpy as np

from stages import build_mjcf, filter, identify_stiffness
from trunkline.errors import in_one_line
from trunkline.identification.evaluation.evaluation import replay, scores
from trunkline.identification.fit.identify import identify
from trunkline.identification.fit.problem import Bounds
from trunkline.identification.fit.setup import set_up
from trunkline.model.arm.joints import JenkinsElement
from trunkline.model.arm.uniform import Uniform
from trunkline.pipeline.config import load_config
from trunkline.recordings.filtering.filter import filter_raw_trial
from trunkline.recordings.trials.raw_trial import RawTrial, read_raw_trials
from trunkline.recordings.trials.splits import DECIDING, IDENTIFY, VALIDATE
from upkeep.results import recorded

EXAMPLE = Path("examples/asl_trunk")
# they slip one after the other
SLIDERS = [JenkinsElement(2.0, 0.002), JenkinsElement(0.7, 0.015), JenkinsElement(0.3, 0.06)]


@dataclass
class Case:
    """What is changed: numbers of the arm, what is fitted in addition, other settings of filter and identification.

    sliders: Jenkins elements of every joint, as a search begins with them. quadratic_damping: share by which damping
        grows with speed v (rad/s), D (1 + share v). as_stamped: without the time of lost frames.
    """

    arm: dict = field(default_factory=dict)
    parameters: dict[str, Bounds] = field(default_factory=dict)
    filtered: dict = field(default_factory=dict)
    settings: dict = field(default_factory=dict)
    sliders: list[JenkinsElement] = field(default_factory=list)
    quadratic_damping: float = 0.0
    as_stamped: bool = False


def slid(count: int) -> dict[str, Bounds]:
    """Of the first `count` elements, what is fitted."""
    numbers = ["", *(f"_{number}" for number in range(2, count + 1))]
    shares = {f"hysteresis{number}": Bounds(low=0.01, high=20.0) for number in numbers}
    return shares | {f"yield_bend{number}": Bounds(low=2e-4, high=0.5) for number in numbers}


def cases() -> dict[str, Case]:
    mass = cad_settings()[1].unit_masses[0]
    return {
        "as in the example": Case(),
        "started at rest when the arm begins to move": Case(filtered={"release": "onset"}),
        "straight at rest": Case(settings={"rest_shape": "unchanged"}),
        "lost frames left lost": Case(as_stamped=True),
        "with hardening": Case(parameters={"hardening": Bounds(low=0.02, high=50.0)}),
        "with joint friction": Case(parameters={"joint_friction": Bounds(low=1e-4, high=0.1)}),
        "with quadratic damping": Case(quadratic_damping=1.0),
        "with a Jenkins element": Case(sliders=SLIDERS[:1], parameters=slid(1)),
        "with three": Case(sliders=SLIDERS, parameters=slid(3)),
        "with factors of every joint's stiffness": Case(settings={"per_joint": ["stiffness"]}),
        "with markers where they were measured": Case(settings={"markers": "measured"}),
        "hose half as heavy": Case(arm={"unit_masses": [mass / 2]}),
        "hose twice as heavy": Case(arm={"unit_masses": [2 * mass]}),
        "6 units": Case(arm={"units": 6}),
        "12 units": Case(arm={"units": 12}),
    }


def error(case: Case, raw_trials: list[RawTrial]) -> tuple[float, float, float, float]:
    """Mean position error on the identify and on the validate releases, mm, and of the latter also the tip error, mm
    and % of the arm's length."""
    chosen = replace(load_config(filter.Config, "filter", EXAMPLE), **case.filtered)
    trials = [filter_raw_trial(as_stamped(raw) if case.as_stamped else raw, chosen)[0] for raw in raw_trials]
    config = load_config(identify_stiffness.Config, "identify_stiffness", EXAMPLE)
    config = replace(config, parameters=config.parameters | case.parameters, **case.settings)
    model, experiments, fit = set_up(config, trials, arm(case))
    with contextlib.redirect_stdout(io.StringIO()):
        found = identify("", model, experiments, fit)
    table = scores(replay(found.models["identified"], experiments, fit.markers), experiments, fit.loss, fit.weights)
    unseen = table[VALIDATE]
    return table[IDENTIFY]["e_position_mm"], unseen["e_position_mm"], unseen["e_tip_mm"], unseen["e_tip_pct"]


def cad_settings() -> tuple[build_mjcf.Config, Uniform]:
    """Of the example's CAD model, and of its arm."""
    config = load_config(build_mjcf.Config, "build_mjcf", EXAMPLE)
    assert isinstance(config.arm, Uniform)
    return config, config.arm


def arm(case: Case) -> mujoco.MjModel:
    """The example's CAD model, changed."""
    config, hose = cad_settings()
    config = replace(config, arm=replace(hose, **case.arm), joints=replace(config.joints, sliders=case.sliders))
    model = build_mjcf.cad_arm(config).spec.compile()
    model.dof_dampingpoly[:, 0] = case.quadratic_damping * model.dof_damping
    return model


def as_stamped(raw: RawTrial) -> RawTrial:
    """A raw trial without the time of its lost frames."""
    return replace(raw, time=np.arange(len(raw.time)) * np.median(np.diff(raw.time)))


@in_one_line
@recorded("real_arm")
def main() -> int:
    raw_trials = read_raw_trials(EXAMPLE / "data/processed/ingest", DECIDING)
    print(f"{'':45}  identify  validate: mean position error, tip error, and that of the length")
    for name, case in cases().items():
        identify_mm, validate_mm, tip_mm, share = error(case, raw_trials)
        print(f"{name:45}  {identify_mm:5.2f} mm  {validate_mm:5.2f} mm  {tip_mm:5.2f} mm  {share:.2f} %", flush=True)
    return 0


if __name__ == "__main__":
    sys.exit(main())
