"""All candidates times all trials as one batch of simulations."""

from dataclasses import dataclass
from itertools import pairwise

import mujoco
import numpy as np
from mujoco.batch import Batch

from trunkline.elements import BRANCH, SLIDER, all_elements
from trunkline.identification.experiment import Experiment
from trunkline.identification.parameters import Fields
from trunkline.simulation.load import hang, slowing
from trunkline.simulation.motion import batch_of, hold, move
from trunkline.simulation.rest import come_to_rest, creep_to_rest, relax
from trunkline.trials.experiments import EXPERIMENTS, is_static

SETTLE_TIME = 10.0  # s, the most; a shape that does not rest by then counts as diverged
CREEP_TIME = 30.0  # s more for trials with pulls or a load, which may press on the arm
REST_SPEED = 2e-5  # rad/s of the fastest hinge: some 1e-5 rad are left then
CREEP_SPEED = 1e-3  # rad/s, with which a pressed arm may still creep after that: less than any trial at rest shows


@dataclass
class Simulated:
    """Segment positions of every trial, in the order of the experiments.

    positions: per trial (C, T, S, 3), m; not finite from where a candidate diverged.
    diverged: which candidates left the physics in any trial, or made MuJoCo warn. Shape (C,).
    steps: simulation steps taken.
    """

    positions: list[np.ndarray]
    diverged: np.ndarray
    steps: int


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
        self._segments = segments
        self._static = [i for i, e in enumerate(experiments) if is_static(e.kind)]
        # longest first, so that those still running are a prefix of each candidate's trials
        self._dynamic = sorted(
            (i for i, e in enumerate(experiments) if not is_static(e.kind)), key=lambda i: -experiments[i].frames
        )
        self._experiments = experiments
        self._step_factor = step_factor
        self._batches: dict[tuple[str, int], Batch] = {}

    def simulate(self, fields: Fields) -> Simulated:
        """Run every candidate (the first axis of `fields`) through every experiment."""
        count = len(next(iter(fields.values())))
        positions: list = [None] * len(self._experiments)
        steps = 0
        for chosen, run in ((self._static, self._settle), (self._dynamic, self._run)):
            if chosen:
                results, taken = run([self._experiments[i] for i in chosen], fields, count)
                steps += taken
                for index, result in zip(chosen, results, strict=True):
                    positions[index] = result
        diverged = np.zeros(count, dtype=bool)
        for result in positions:
            diverged |= ~np.isfinite(result).all(axis=(1, 2, 3))
        return Simulated(positions, diverged, steps)

    def _batch(self, kind: str, experiments: list[Experiment], fields: Fields, count: int) -> Batch:
        """A batch whose simulation t·C + c is candidate c in trial t, at the trial's start."""
        key = (kind, count)
        if key not in self._batches:
            self._batches = {key: batch_of(self._model, count * len(experiments))}
        batch = self._batches[key]
        batch.reset(stage=mujoco.mjtStage.mjSTAGE_NONE)
        for name, values in fields.items():
            batch.expand(name)[:] = np.tile(values, (len(experiments),) + (1,) * (values.ndim - 1))
        batch.expand("opt.gravity")[:] = np.repeat([e.gravity for e in experiments], count, axis=0)
        loads = np.repeat([e.load for e in experiments], count)
        if loads.any():
            hang(batch, self._model, loads, tuple(fields))
        arm = len(experiments[0].start)
        batch.bind("qpos")[:, :arm] = np.repeat([e.start for e in experiments], count, axis=0)
        batch.bind("qvel")[:, :arm] = np.repeat([e.velocity for e in experiments], count, axis=0)
        self._remember(batch)
        if self._model.nu:
            hold(batch, self._model, np.repeat([e.controls[0] for e in experiments], count, axis=0))
        return batch

    def _remember(self, batch: Batch) -> None:
        """Joints' branches and sliders as long after a straight arm was bent into the start pose."""
        angles = batch.bind("qpos")
        for one in all_elements(self._model, BRANCH):
            angles[:, one.own] = angles[:, one.hinge]
        for one in all_elements(self._model, SLIDER):
            bend, give = angles[:, one.hinge], batch.expand("tendon_springyield")[:, one.tendon]
            place = self._model.tendon_plasticadr[one.tendon]
            for end in (0, 1):  # of the spring's length at rest
                batch.bind("plastic")[:, place + end] = bend - np.clip(bend, -give, give)

    def _sites(self) -> list[int]:
        return [self._model.site(f"{name}_center").id for name in self._segments]

    def _settle(self, experiments: list[Experiment], fields: Fields, count: int) -> tuple[list[np.ndarray], int]:
        """Static shapes: from the measured pose, friction off, heavily damped, until each is at rest."""
        batch = self._batch("static", experiments, fields, count)
        timestep = relax(batch, self._model, self._step_factor)
        loads = np.array([e.load for e in experiments])
        if loads.any():
            batch.expand("dof_damping")[:] *= np.repeat(slowing(self._model, loads), count)[:, None]
        seen, speed = batch.bind("site_xpos"), batch.bind("qvel")
        moving, steps = come_to_rest(batch, timestep, SETTLE_TIME, REST_SPEED)
        pressed = [EXPERIMENTS[e.kind].needs_motors or e.load > 0 for e in experiments]
        creeping = moving[np.repeat(pressed, count)[moving]]
        if len(creeping):
            left, more = creep_to_rest(batch, timestep, creeping, CREEP_TIME, REST_SPEED)
            steps += more
            fast = left[~(np.abs(speed[left]).max(axis=1) < CREEP_SPEED)]
            moving = np.union1d(np.setdiff1d(moving, creeping), fast)
        shapes = seen[:, None, self._sites()]
        shapes[moving] = np.nan
        shapes[batch.warning.any(axis=(1, 2))] = np.nan
        return list(shapes.reshape(len(experiments), count, *shapes.shape[1:])), steps

    def _run(self, experiments: list[Experiment], fields: Fields, count: int) -> tuple[list[np.ndarray], int]:
        """Trials in motion: from the start to the first frame, then frame by frame."""
        batch = self._batch("dynamic", experiments, fields, count)
        frame_step, sites = experiments[0].frame_step, self._sites()
        substeps = max(1, round(frame_step / (self._model.opt.timestep * self._step_factor)))
        timestep = batch.expand("opt.timestep")
        timestep[:] = np.repeat([e.lead / substeps for e in experiments], count)
        first = np.repeat([e.controls[0] for e in experiments], count, axis=0)
        move(batch, np.repeat(first[:, None], substeps, axis=1), ())
        timestep[:] = frame_step / substeps
        lengths = [e.frames for e in experiments]
        results = [np.empty((count, frames, len(sites), 3)) for frames in lengths]
        for start, end in pairwise(sorted({1, *lengths})):  # trials that are over stay behind
            running = [e for e in experiments if e.frames >= end]
            controls = np.repeat([e.controls[start:end] for e in running], count, axis=0)
            ids = np.arange(len(controls), dtype=np.int32)
            # a step sees the sites where they are before it: the first of a frame, where the last frame ended
            seen = move(batch, np.repeat(controls, substeps, axis=1), ("site_xpos",), every=substeps, ids=ids)
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
