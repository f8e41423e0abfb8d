"""Trials at rest: where candidates of a model have their markers, by the statics."""

import copy
from typing import NamedTuple

import mujoco
import numpy as np

from trunkline.identification.parameters.parameter import Fields
from trunkline.identification.parameters.parameters import set_fields
from trunkline.identification.parameters.spool_scale import wound
from trunkline.identification.simulate.experiment import Experiment
from trunkline.model.arm_model import ArmModel
from trunkline.model.simulation.shortening import shorten
from trunkline.model.simulation.winch import wind
from trunkline.model.statics.chain import read_chain
from trunkline.model.statics.equilibria import actuated
from trunkline.model.statics.restart import actuated_from


class Shapes(NamedTuple):
    """Of every trial its markers for C candidates, m, NaN where one finds no rest. Each (C, T, S, 3).

    angles: of the arm's hinges for the first candidate, rad, NaN likewise. Each (T, n). iterations: of Newton's method.
    """

    positions: list[np.ndarray]
    angles: list[np.ndarray]
    iterations: int


def shapes_at_rest(
    model: mujoco.MjModel, fields: Fields, experiments: list[Experiment], sites: np.ndarray,
    near: list[np.ndarray] | None,
) -> Shapes:  # fmt: skip
    """The stable equilibrium of every candidate to which Newton's method comes from where the trial was measured, or
    from `near`, as `Shapes.angles` has it; where it comes to none, and where every frame is a shape of its own, the one
    that is reached from the arm without pull, or from its neighbours on the path. Cables rub as the trial's approach
    has it; where that cannot be told they do not: rest is in the middle of what friction can hold.

    Args:
        fields: of the candidates, as `parameters.candidate_fields`.
        sites: numbers of the markers' sites. Shape (S,).
    """
    arm, count = ArmModel(model), len(next(iter(fields.values())))
    candidate_model, data = copy.copy(model), mujoco.MjData(model)
    soft = len(arm.axial_stiffness) > 0
    pressed = copy.copy(model) if soft else candidate_model  # as short as the tendons of some rows make it
    trial = np.repeat(np.arange(len(experiments)), [e.frames for e in experiments])  # of each of R rows
    starts = np.concatenate([_starts(e) for e in experiments])
    if near is not None:
        nearby = np.concatenate(near)
        starts = np.where(np.isfinite(nearby), nearby, starts)
    gravity, loads, approaches = (
        np.array([getattr(e, name) for e in experiments])[trial] for name in ("gravity", "load", "approach")
    )
    places = np.full((count, len(trial), len(sites), 3), np.nan)
    angles, iterations = np.full((len(trial), arm.hinge_count), np.nan), 0
    for candidate in range(count):
        set_fields(candidate_model, fields, candidate, data)
        chain = read_chain(candidate_model)
        mujoco.mj_kinematics(candidate_model, data)
        turned = gravity @ data.xmat[arm.base_body].reshape(3, 3)  # into the mount's frame, which may be tilted
        sent = np.concatenate([_sent(candidate_model, e) for e in experiments])
        qpos = np.full(angles.shape, np.nan)
        if soft:
            set_fields(pressed, fields, candidate, data)
        alike = np.column_stack([loads, approaches, sent if soft else np.zeros((len(sent), 0))])
        groups = np.unique(alike, axis=0)
        for load, approach, *tensions in np.tile(groups, (2 if soft else 1, 1)):  # again by neighbours that came later
            chosen = np.flatnonzero((alike == [load, approach, *tensions]).all(axis=1) & np.isnan(qpos[:, 0]))
            if not len(chosen):
                continue
            if soft:
                shorten(pressed, candidate_model, np.array(tensions))
                chain = read_chain(pressed)
            loaded = chain._replace(capstan=approach * chain.capstan).loaded(load)
            guessed = chosen[np.isfinite(starts[chosen]).all(axis=1)]
            solved = actuated_from(loaded, starts[guessed], sent[guessed], turned[guessed])
            qpos[guessed[solved.converged]] = solved.qpos[solved.converged]
            left = chosen[np.isnan(qpos[chosen, 0])]
            followed = actuated(loaded, sent[left], turned[left])
            qpos[left[followed.converged]] = followed.qpos[followed.converged]
            iterations += int(solved.iterations.sum() + followed.iterations.sum())
            for aside in (1, -1):  # of a path, from the shape before, or after
                beside = (chosen - aside) % len(trial)
                lost = np.isnan(qpos[chosen, 0]) & np.isfinite(qpos[beside, 0]) & (trial[chosen] == trial[beside])
                again = actuated_from(loaded, qpos[beside[lost]], sent[chosen[lost]], turned[chosen[lost]])
                qpos[chosen[lost][again.converged]] = again.qpos[again.converged]
                iterations += int(again.iterations.sum())
            for row in chosen[np.isfinite(qpos[chosen, 0])]:
                data.qpos[: qpos.shape[1]] = qpos[row]
                mujoco.mj_kinematics(pressed, data)
                places[candidate, row] = data.site_xpos[sites]
        if candidate == 0:
            angles = qpos
    edges = np.cumsum([e.frames for e in experiments])[:-1]
    return Shapes(np.split(places, edges, axis=1), np.split(angles, edges), iterations)


def _starts(experiment: Experiment) -> np.ndarray:
    """Where to begin looking, rad, NaN where that is not known. Shape (T, n)."""
    start = experiment.start if experiment.frames == 1 else np.full(len(experiment.start), np.nan)
    return np.tile(start, (experiment.frames, 1))


def _sent(model: mujoco.MjModel, experiment: Experiment) -> np.ndarray:
    """Lengths of cable at which the motors of `model` stand, m, or their tensions, N. What winches with backlash have
    delivered by each frame, of a trial that has several. Shape (T, K)."""
    arm = ArmModel(model)
    controls, play = wound(model, experiment.controls)[:, arm.actuators], arm.backlash
    if play and experiment.frames > 1:
        first = controls[:1].copy()
        controls = wind(controls[None], first, first.copy(), np.array([np.inf]), np.array([play]))[0]
    return controls
