"""Trials in motion: where candidates of a model have their markers, all candidates times all trials as one batch."""

import copy
from itertools import pairwise

import mujoco
import numpy as np
from mujoco.batch import Batch

from trunkline.identification.parameters.parameter import Fields
from trunkline.identification.parameters.parameters import DERIVED_FROM
from trunkline.identification.parameters.spool_scale import wound_by_each
from trunkline.identification.simulate.experiment import Experiment
from trunkline.model.arm_model import CAPSTAN_FRICTION, ArmModel
from trunkline.model.simulation.load import hang
from trunkline.model.simulation.motion import batch_of, by_warp, hold, move
from trunkline.model.simulation.winch import Winches


class InMotion:
    """Simulates candidates in trials, all of them at once or some: the bits are the same, as what trials share is taken
    from all.

    Args:
        trials: by their numbers, longest first, so that those still running are a prefix.
        slack: whether all cables are slack in all of them, or in none: the former are cheaper.
        sites: numbers of the markers' sites. Shape (S,).
        step_factor: as `Population`.
    """

    def __init__(
        self, model: mujoco.MjModel, trials: dict[int, Experiment], slack: bool, sites: np.ndarray, step_factor: float
    ) -> None:
        self.trials = trials
        self._model, self._slack, self._sites = model, slack, sites
        every = list(trials.values())
        self._frame_step = every[0].frame_step
        self._longest = max(e.lead for e in every)  # s, from any start to the first frame
        self._ends = sorted({1, *(e.frames for e in every)})  # frames
        self._loaded = any(e.load for e in every)
        self._step_factor = step_factor
        self._batches: dict[tuple[int, ...], tuple[set[str], Batch]] = {}  # with the fields that its simulations have

    def __getstate__(self) -> dict:
        return self.__dict__ | {"_batches": {}}  # a worker makes its own

    def shapes(self, fields: Fields, numbers: list[int], rough: bool = False) -> tuple[list[np.ndarray], int]:
        """Positions of C candidates' markers in trials `numbers`, in the order of `trials`, m, NaN where a candidate
        makes MuJoCo warn; and how many steps that took.

        First from each trial's start to its first frame, then frame by frame. Each (C, T, S, 3).

        Args:
            rough: as `batch_of` has it.
        """
        experiments, count = [self.trials[i] for i in numbers], len(next(iter(fields.values())))
        batch, frame_step, sites = self._batch(fields, numbers, rough), self._frame_step, self._sites
        substeps = max(1, round(frame_step / (self._model.opt.timestep * self._step_factor)))
        timestep = batch.expand("opt.timestep")
        timestep[:] = np.repeat([e.lead / substeps for e in experiments], count)
        first = wound_by_each(self._model, fields, np.array([e.controls[:1] for e in experiments]))[:, 0]
        if self._model.nu:
            hold(batch, self._model, first)
        winches = Winches(batch, first)
        move(batch, np.repeat(first[:, None], substeps, axis=1), (), longest=self._longest / substeps)
        timestep[:] = frame_step / substeps
        lengths = [e.frames for e in experiments]
        results = [np.empty((count, frames, len(sites), 3)) for frames in lengths]
        for start, end in pairwise(self._ends):  # trials that are over stay behind
            running = [e for e in experiments if e.frames >= end]
            if not running:
                break
            controls = wound_by_each(self._model, fields, np.array([e.controls[start:end] for e in running]))
            ids = np.arange(len(controls), dtype=np.int32)
            rows = winches.deliver(np.repeat(controls, substeps, axis=1), ids)
            # a step sees the sites where they are before it: the first of a frame, where the last frame ended
            sites_moved = move(batch, rows, ("site_xpos",), every=substeps, ids=ids)
            positions = sites_moved["site_xpos"][:, :, sites].reshape(len(running), count, end - start, len(sites), 3)
            for result, part in zip(results, positions, strict=False):
                result[:, start - 1 : end - 1] = part
        last = batch.bind("site_xpos")
        batch.forward(stage=mujoco.mjtStage.mjSTAGE_POS)
        warned = batch.warning.any(axis=(1, 2)).reshape(len(experiments), count)
        for t, result in enumerate(results):
            result[:, -1] = last[t * count : (t + 1) * count, sites]
            result[warned[t]] = np.nan
        return results, substeps * sum(lengths) * count

    def _batch(self, fields: Fields, numbers: list[int], rough: bool = False) -> Batch:
        """A batch whose simulation t·C + c is candidate c in trial t, at the trial's start, motors yet to be set."""
        experiments, count = [self.trials[i] for i in numbers], len(next(iter(fields.values())))
        names, batch = self._batches.get((*numbers, rough), (set(), None))
        if batch is None or batch.nsim != count * len(experiments) or names != fields.keys():
            whole = by_warp(count * len(experiments), rough)  # Warp fails with cables that are cut down
            model = _without_idle(self._model, self._slack, fields, whole)
            self._batches.pop((*numbers, not rough), None)
            batch = batch_of(model, count * len(experiments), rough)
            self._batches[*numbers, rough] = set(fields), batch
        if self._slack:  # cables do not rub, winches do not wind
            fields = {name: values for name, values in fields.items() if name != "numeric_data"}
        batch.reset(stage=mujoco.mjtStage.mjSTAGE_NONE)
        for name, values in fields.items():
            batch.expand(name)[:] = np.tile(values, (len(experiments),) + (1,) * (values.ndim - 1))
        batch.expand("opt.gravity")[:] = np.repeat([e.gravity for e in experiments], count, axis=0)
        loads = np.repeat([e.load for e in experiments], count)
        if self._loaded:
            hang(batch, batch.model, loads, tuple(fields))
        elif DERIVED_FROM & fields.keys():  # what softens joint limits follows, as when such a model is compiled
            batch.set_const()
        arm = len(experiments[0].start)
        batch.bind("qpos")[:, :arm] = np.repeat([e.start for e in experiments], count, axis=0)
        batch.bind("qvel")[:, :arm] = np.repeat([e.velocity for e in experiments], count, axis=0)
        self._remember(batch)
        return batch

    def _remember(self, batch: Batch) -> None:
        """Joints' branches and sliders as long after a straight arm was bent into the start pose."""
        angles = batch.bind("qpos")
        arm = ArmModel(self._model)
        arm.unload_branches(angles)
        for element in arm.sliders:
            bend, give = angles[:, element.hinge], batch.expand("tendon_springyield")[:, element.tendon]
            place = self._model.tendon_plasticadr[element.tendon]
            for end in (0, 1):  # of the spring's length at rest
                batch.bind("plastic")[:, place + end] = bend - np.clip(bend, -give, give)


def _without_idle(model: mujoco.MjModel, slack: bool, fields: Fields, whole: bool = False) -> mujoco.MjModel:
    """A copy of the model without what moves nothing where all cables are slack and takes most of a step: their
    friction on the holes, and, but for `whole`, the cables themselves."""
    arm = ArmModel(copy.copy(model))
    parts = (model.tendon_frictionloss, model.tendon_stiffness, model.tendon_damping)
    bare = "tendon_frictionloss" not in fields and not any(values[arm.cables].any() for values in parts)
    if slack and bare and not whole:
        arm.switch_off_cables()
    elif slack:
        arm.switch_off(CAPSTAN_FRICTION)
    return arm.model
