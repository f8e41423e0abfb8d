"""All candidates times all trials as one batch of simulations."""

import copy
from dataclasses import dataclass
from itertools import pairwise

import mujoco
import numpy as np
from mujoco.batch import Batch

from trunkline.elements import SLIDER, all_elements, arm_hinges, cables, give_way, let_hang, let_slide, segment_sites
from trunkline.identification.at_rest import shapes_at_rest
from trunkline.identification.experiment import Experiment
from trunkline.identification.parameters import Fields
from trunkline.identification.winding import wound_by_each
from trunkline.simulation.load import hang
from trunkline.simulation.motion import batch_of, hold, move
from trunkline.simulation.winch import Winches
from trunkline.trials.experiments import is_static


@dataclass
class Simulated:
    """Segment positions of every trial, in the order of the experiments.

    positions: per trial (C, T, S, 3), m; not finite from where a candidate diverged.
    diverged: which candidates left the physics in any trial, or made MuJoCo warn. Shape (C,).
    steps: simulation steps taken, of trials at rest iterations of Newton's method.
    rests: per trial angles of the arm's hinges where the first candidate rests, rad; NaN for trials in motion. Each
        (T, n).
    """

    positions: list[np.ndarray]
    diverged: np.ndarray
    steps: int
    rests: list[np.ndarray]


class Population:
    """Simulates candidates of one model on a fixed list of experiments of the same segments.

    Args:
        model: the model that candidates start from. Its step is fitted to divide a frame evenly.
        step_factor: how much coarser than the model's own step to simulate, 1 for reported numbers.
    """

    def __init__(
        self, model: mujoco.MjModel, experiments: list[Experiment], segments: tuple[str, ...], step_factor: float = 1.0
    ):
        self._model = model
        self._sites = segment_sites(model, segments)
        # longest first, so that those still running are a prefix of each candidate's trials
        order = sorted(range(len(experiments)), key=lambda i: -experiments[i].frames)
        self._at_rest = [i for i in order if is_static(experiments[i].kind)]
        moving = [i for i in order if not is_static(experiments[i].kind)]
        # those in which all cables are slack are cheaper, and simulated by themselves
        slack = {i: experiments[i].slack(model) for i in moving}
        self._moving = {group: [i for i in moving if slack[i] == group] for group in sorted(set(slack.values()))}
        self._experiments = experiments
        self._step_factor = step_factor
        self._batches: dict[bool, Batch] = {}

    def simulate(self, fields: Fields, rests: list[np.ndarray] | None = None) -> Simulated:
        """Run every candidate (the first axis of `fields`) through every experiment.

        Args:
            rests: near which all of them rest, as `Simulated.rests` has it of another candidate.
        """
        count = len(next(iter(fields.values())))
        positions: list = [None] * len(self._experiments)
        found = [np.full((1, arm_hinges(self._model)), np.nan)] * len(self._experiments)
        steps = 0
        if self._at_rest:
            own = [self._experiments[i] for i in self._at_rest]
            near = None if rests is None else [rests[i] for i in self._at_rest]
            results, angles, steps = shapes_at_rest(self._model, fields, own, self._sites, near)
            for index, result, angle in zip(self._at_rest, results, angles, strict=True):
                positions[index], found[index] = result, angle
        for slack, chosen in self._moving.items():
            own = [self._experiments[i] for i in chosen]
            results, taken = self._run(slack, own, fields, count)
            steps += taken
            for index, result in zip(chosen, results, strict=True):
                positions[index] = result
        diverged = np.zeros(count, dtype=bool)
        for result in positions:
            diverged |= ~np.isfinite(result).all(axis=(1, 2, 3))
        return Simulated(positions, diverged, steps, found)

    def _batch(self, slack: bool, experiments: list[Experiment], fields: Fields, count: int) -> Batch:
        """A batch whose simulation t·C + c is candidate c in trial t, at the trial's start, its motors yet to be set.
        """
        batch = self._batches.get(slack)
        if batch is None or batch.nsim != count * len(experiments):
            model = _without_idle(self._model, slack, fields)
            batch = self._batches[slack] = batch_of(model, count * len(experiments))
        if slack:  # cables do not rub, winches do not wind
            fields = {name: values for name, values in fields.items() if name != "numeric_data"}
        batch.reset(stage=mujoco.mjtStage.mjSTAGE_NONE)
        for name, values in fields.items():
            batch.expand(name)[:] = np.tile(values, (len(experiments),) + (1,) * (values.ndim - 1))
        batch.expand("opt.gravity")[:] = np.repeat([e.gravity for e in experiments], count, axis=0)
        loads = np.repeat([e.load for e in experiments], count)
        if loads.any():
            hang(batch, batch.model, loads, tuple(fields))
        elif "jnt_pos" in fields:  # what softens joint limits follows, as when such a model is compiled
            batch.set_const()
        arm = len(experiments[0].start)
        batch.bind("qpos")[:, :arm] = np.repeat([e.start for e in experiments], count, axis=0)
        batch.bind("qvel")[:, :arm] = np.repeat([e.velocity for e in experiments], count, axis=0)
        self._remember(batch)
        return batch

    def _remember(self, batch: Batch) -> None:
        """Joints' branches and sliders as long after a straight arm was bent into the start pose."""
        angles = batch.bind("qpos")
        give_way(self._model, angles)
        for one in all_elements(self._model, SLIDER):
            bend, give = angles[:, one.hinge], batch.expand("tendon_springyield")[:, one.tendon]
            place = self._model.tendon_plasticadr[one.tendon]
            for end in (0, 1):  # of the spring's length at rest
                batch.bind("plastic")[:, place + end] = bend - np.clip(bend, -give, give)

    def _run(
        self, slack: bool, experiments: list[Experiment], fields: Fields, count: int
    ) -> tuple[list[np.ndarray], int]:
        """Trials in motion, all cables slack in all of them or in none: from the start to the first frame, then frame
        by frame."""
        batch = self._batch(slack, experiments, fields, count)
        frame_step, sites = experiments[0].frame_step, self._sites
        substeps = max(1, round(frame_step / (self._model.opt.timestep * self._step_factor)))
        timestep = batch.expand("opt.timestep")
        timestep[:] = np.repeat([e.lead / substeps for e in experiments], count)
        first = wound_by_each(self._model, fields, np.array([e.controls[:1] for e in experiments]))[:, 0]
        if self._model.nu:
            hold(batch, self._model, first)
        winches = Winches(batch, first)
        move(batch, np.repeat(first[:, None], substeps, axis=1), ())
        timestep[:] = frame_step / substeps
        lengths = [e.frames for e in experiments]
        results = [np.empty((count, frames, len(sites), 3)) for frames in lengths]
        for start, end in pairwise(sorted({1, *lengths})):  # trials that are over stay behind
            running = [e for e in experiments if e.frames >= end]
            controls = wound_by_each(self._model, fields, np.array([e.controls[start:end] for e in running]))
            ids = np.arange(len(controls), dtype=np.int32)
            rows = winches.deliver(np.repeat(controls, substeps, axis=1), ids)
            # a step sees the sites where they are before it: the first of a frame, where the last frame ended
            seen = move(batch, rows, ("site_xpos",), every=substeps, ids=ids)
            positions = seen["site_xpos"][:, :, sites].reshape(len(running), count, end - start, len(sites), 3)
            for result, found in zip(results, positions, strict=False):
                result[:, start - 1 : end - 1] = found
        last = batch.bind("site_xpos")
        batch.forward(stage=mujoco.mjtStage.mjSTAGE_POS)
        warned = batch.warning.any(axis=(1, 2)).reshape(len(experiments), count)
        for t, result in enumerate(results):
            result[:, -1] = last[t * count : (t + 1) * count, sites]
            result[warned[t]] = np.nan
        return results, substeps * sum(lengths) * count


def _without_idle(model: mujoco.MjModel, slack: bool, fields: Fields) -> mujoco.MjModel:
    """A copy of the model without what moves nothing where all cables are slack and takes most of a step: their
    friction on the holes, and the cables themselves."""
    model = copy.copy(model)
    own = (model.tendon_frictionloss, model.tendon_stiffness, model.tendon_damping)
    bare = "tendon_frictionloss" not in fields and not any(values[cables(model)].any() for values in own)
    if slack and bare:
        let_hang(model)
    elif slack:
        let_slide(model)
    return model
