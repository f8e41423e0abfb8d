"""What the twin would do in a candidate: an experiment whose measurement is the twin's own."""

from dataclasses import replace

import mujoco
import numpy as np

from trunkline.identification.fit.fit import Fit
from trunkline.identification.simulate.experiment import Experiment
from trunkline.identification.simulate.population import Population, Simulated
from trunkline.identification.simulate.pose_fit import PoseFit
from trunkline.model.arm_model import ArmModel
from trunkline.recordings.trials.experiments import is_static
from trunkline.recordings.trials.splits import IDENTIFY
from trunkline.tools.suggest.candidates import Candidate

MOST_OF_RANGE = 0.95  # of a joint's range, up to which a hand bends it


def simulated(
    chosen: list[Candidate], model: mujoco.MjModel, fit: Fit, frame_rate: float
) -> list[tuple[Candidate, Experiment]]:
    """The candidates in which the twin comes to rest or stays in one piece, and what it then does.

    Args:
        fit: what will be identified from them; the twin is where its search would begin.
    """
    planned = [_experiment(candidate, model, len(fit.markers), frame_rate) for candidate in chosen]
    starts = _starts([e for e in planned if not is_static(e.kind)], model, fit)
    planned = [replace(e, start=starts.get(e.name, e.start)) for e in planned]
    done = []
    for static in (True, False):
        group = [(candidate, e) for candidate, e in zip(chosen, planned, strict=True) if is_static(e.kind) == static]
        if not group:
            continue
        tracks = _positions([e for _, e in group], model, fit)
        for (candidate, experiment), positions in zip(group, tracks, strict=True):
            if np.isfinite(positions).all():
                done.append((candidate, replace(experiment, positions=positions)))
    return done


def _experiment(candidate: Candidate, model: mujoco.MjModel, markers: int, frame_rate: float) -> Experiment:
    """Without what is measured."""
    static, hinges = is_static(candidate.kind), ArmModel(model).hinge_count
    start = _bent(candidate, model) if candidate.turn else np.full(hinges, np.nan if static else 0.0)
    straight = model.tendon_length0[model.actuator_trnid[:, 0]]
    step = 0.0 if static else 1 / frame_rate
    return Experiment(
        name=candidate.name, kind=candidate.kind, split=IDENTIFY, gravity=candidate.gravity, start=start,
        velocity=np.zeros(hinges), lead=step, controls=straight - candidate.pulls,
        positions=np.zeros((len(candidate.pulls), markers, 3)),
        measured=np.ones((len(candidate.pulls), markers), bool), frame_step=step,
        fit=PoseFit(start, np.zeros(markers), 0, True), load=candidate.load,
    )  # fmt: skip


def _bent(candidate: Candidate, model: mujoco.MjModel) -> np.ndarray:
    """Joint angles, rad, of an arm that is bent by `turn` towards `side`, every unit by the same. Shape (n,)."""
    hinges = ArmModel(model).hinge_count
    data = mujoco.MjData(model)
    mujoco.mj_kinematics(model, data)
    # about this axis a hanging arm swings towards the side
    axis = np.array([np.sin(candidate.side), -np.cos(candidate.side), 0.0])
    units = len(np.unique(model.jnt_bodyid[:hinges]))
    angles = candidate.turn / units * (data.xaxis[:hinges] @ axis)
    limited, span = model.jnt_limited[:hinges].astype(bool), MOST_OF_RANGE * model.jnt_range[:hinges]
    return np.where(limited, np.clip(angles, span[:, 0], span[:, 1]), angles)


def _starts(moving: list[Experiment], model: mujoco.MjModel, fit: Fit) -> dict[str, np.ndarray]:
    """By name, where arms that their motors will move rest before, rad, each (n,)."""
    driven = [e for e in moving if not e.slack(model)]
    different = {_before(e): e for e in driven}
    hanging = [
        replace(e, kind="static_pull", controls=e.controls[:1], positions=e.positions[:1], measured=e.measured[:1],
                start=np.full_like(e.start, np.nan))
        for e in different.values()
    ]  # fmt: skip
    rests = dict(zip(different, _twin(hanging, model, fit).rests, strict=True)) if hanging else {}
    starts = {e.name: rests[_before(e)][0] for e in driven}
    return {name: rest for name, rest in starts.items() if np.isfinite(rest).all()}


def _before(experiment: Experiment) -> bytes:
    """What decides where the arm rests before its motors move it."""
    return np.concatenate([experiment.gravity, experiment.controls[0], [experiment.load]]).tobytes()


def _positions(experiments: list[Experiment], model: mujoco.MjModel, fit: Fit) -> list[np.ndarray]:
    """Of the markers, m, NaN where the twin finds no rest or leaves the physics. Each (T, S, 3)."""
    return [tracks[0] for tracks in _twin(experiments, model, fit).positions]


def _twin(experiments: list[Experiment], model: mujoco.MjModel, fit: Fit) -> Simulated:
    """The one candidate from which a search begins."""
    problem = fit.problem(model, experiments)
    return Population(model, experiments, fit.markers).simulate(problem.fields(problem.start()[None]))
