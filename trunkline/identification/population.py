"""All candidates times all trials as one batch of simulations."""

import copy
from dataclasses import dataclass

import mujoco
import numpy as np
from mujoco.batch import Batch

from trunkline.identification.experiment import Experiment
from trunkline.identification.parameters import Fields
from trunkline.simulation.rest import longest_step
from trunkline.threads import thread_count
from trunkline.trials.experiments import is_static

RELAXATION = 0.4  # s, damping over stiffness while a static shape settles: quick, without swinging
SETTLE_CHUNK = 0.2  # s between looks at whether a shape rests
SETTLE_TIME = 10.0  # s, the most; a shape that does not rest by then counts as diverged
REST_SPEED = 2e-5  # rad/s of the fastest hinge; with the relaxation above some 1e-5 rad are left then


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
            model = copy.copy(self._model)
            model.opt.disableflags |= mujoco.mjtDisableBit.mjDSBL_AUTORESET  # a diverged run must look like one
            self._batches = {key: Batch(model, count * len(experiments), nthread=thread_count())}
        batch = self._batches[key]
        batch.reset(stage=mujoco.mjtStage.mjSTAGE_NONE)
        for name, values in fields.items():
            batch.expand(name)[:] = np.tile(values, (len(experiments),) + (1,) * (values.ndim - 1))
        batch.expand("opt.gravity")[:] = np.repeat([e.gravity for e in experiments], count, axis=0)
        batch.bind("qpos")[:] = np.repeat([e.start for e in experiments], count, axis=0)
        batch.bind("qvel")[:] = np.repeat([e.velocity for e in experiments], count, axis=0)
        return batch

    def _sites(self) -> list[int]:
        return [self._model.site(f"{name}_center").id for name in self._segments]

    def _settle(self, experiments: list[Experiment], fields: Fields, count: int) -> tuple[list[np.ndarray], int]:
        """Static shapes: friction off, heavily damped, until each is at rest."""
        batch = self._batch("static", experiments, fields, count)
        timestep = self._step_factor * longest_step(self._model)
        chunk = round(SETTLE_CHUNK / timestep)
        batch.expand("opt.timestep")[:] = timestep
        for name in ("dof_frictionloss", "tendon_frictionloss", "dof_dampingpoly"):
            batch.expand(name)[:] = 0
        stiffness = batch.expand("jnt_stiffness")
        hinge_of_dof = self._model.dof_jntid
        batch.expand("dof_damping")[:] = RELAXATION * stiffness[:, hinge_of_dof]
        if self._model.nu:
            controls = np.repeat([e.controls[0] for e in experiments], count, axis=0)
            batch.bind("ctrl")[:] = controls
            if self._model.na:
                batch.bind("act")[:] = controls
        seen, speed = batch.bind("site_xpos"), batch.bind("qvel")
        moving, steps = np.arange(batch.nsim, dtype=np.int32), 0
        for _ in range(round(SETTLE_TIME / SETTLE_CHUNK)):
            if not len(moving):
                break
            batch.step(ids=moving, nstep=chunk, stage=mujoco.mjtStage.mjSTAGE_POS)
            steps += chunk * len(moving)
            moving = moving[~(np.abs(speed[moving]).max(axis=1) < REST_SPEED)]
        shapes = seen[:, None, self._sites()]
        shapes[moving] = np.nan
        shapes[batch.warning.any(axis=(1, 2))] = np.nan
        results = [shapes[t * count : (t + 1) * count] for t in range(len(experiments))]
        return results, steps

    def _run(self, experiments: list[Experiment], fields: Fields, count: int) -> tuple[list[np.ndarray], int]:
        """Releases and curls: from the start to the first frame, then frame by frame."""
        batch = self._batch("dynamic", experiments, fields, count)
        frame_step = experiments[0].frame_step
        substeps = max(1, round(frame_step / (self._model.opt.timestep * self._step_factor)))
        timestep = batch.expand("opt.timestep")
        timestep[:] = np.repeat([e.lead / substeps for e in experiments], count)
        sites = self._sites()
        lengths = [e.frames for e in experiments]
        results = [np.empty((count, frames, len(sites), 3)) for frames in lengths]
        seen, control = batch.bind("site_xpos"), batch.bind("ctrl")
        if self._model.na:
            batch.bind("act")[:] = np.repeat([e.controls[0] for e in experiments], count, axis=0)
        steps = 0
        for frame in range(max(lengths)):
            running = sum(frames > frame for frames in lengths)
            control[: running * count] = np.repeat([e.controls[frame] for e in experiments[:running]], count, axis=0)
            ids = np.arange(running * count, dtype=np.int32)
            batch.step(ids=ids, nstep=substeps, stage=mujoco.mjtStage.mjSTAGE_POS)
            steps += substeps * len(ids)
            timestep[:] = frame_step / substeps
            for t in range(running):
                results[t][:, frame] = seen[t * count : (t + 1) * count, sites]
        warned = batch.warning.any(axis=(1, 2)).reshape(len(experiments), count)
        for result, which in zip(results, warned, strict=True):
            result[which] = np.nan
        return results, steps
