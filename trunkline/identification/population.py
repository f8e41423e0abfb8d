"""All candidates times all trials as one batch of simulations."""

import copy
from dataclasses import dataclass

import mujoco
import numpy as np
from mujoco.batch import Batch

from trunkline.arm.parameters import Fields
from trunkline.identification.experiment import Experiment
from trunkline.threads import thread_count

RELAXATION = 0.2  # s, damping over stiffness while a static shape settles: quick, without swinging
SETTLE_TIME = 1.6  # s, leaves 0.03 % of the distance between where a shape starts and where it rests
SETTLE_STEP = 0.002  # s


@dataclass
class Simulated:
    """Segment positions of every trial, in the order of the experiments.

    positions: per trial (C, T, S, 3), m; not finite from where a candidate diverged.
    diverged: which candidates left the physics in any trial. Shape (C,).
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
        self._static = [i for i, e in enumerate(experiments) if e.kind == "static_tilt"]
        # longest first, so that those still running are a prefix of each candidate's trials
        self._dynamic = sorted(
            (i for i, e in enumerate(experiments) if e.kind != "static_tilt"), key=lambda i: -experiments[i].frames
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
        """A batch whose simulation t·C + c is candidate c in trial t, at the trial's start and at rest."""
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
        return batch

    def _sites(self) -> list[int]:
        return [self._model.site(f"{name}_center").id for name in self._segments]

    def _settle(self, experiments: list[Experiment], fields: Fields, count: int) -> tuple[list[np.ndarray], int]:
        """Static shapes: friction off, heavily damped until at rest."""
        batch = self._batch("static", experiments, fields, count)
        batch.expand("opt.timestep")[:] = SETTLE_STEP
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
        steps, seen = round(SETTLE_TIME / SETTLE_STEP), batch.bind("site_xpos")
        batch.step(nstep=steps, stage=mujoco.mjtStage.mjSTAGE_POS)
        shapes = seen[:, None, self._sites()]
        results = [shapes[t * count : (t + 1) * count] for t in range(len(experiments))]
        return results, steps * batch.nsim

    def _run(self, experiments: list[Experiment], fields: Fields, count: int) -> tuple[list[np.ndarray], int]:
        """Releases and curls: frame by frame, commands held from one frame to the next."""
        batch = self._batch("dynamic", experiments, fields, count)
        frame_step = experiments[0].frame_step
        substeps = max(1, round(frame_step / (self._model.opt.timestep * self._step_factor)))
        batch.expand("opt.timestep")[:] = frame_step / substeps
        sites = self._sites()
        lengths = [e.frames for e in experiments]
        results = [np.empty((count, frames, len(sites), 3)) for frames in lengths]
        seen, control = batch.bind("site_xpos"), batch.bind("ctrl")
        if self._model.na:
            batch.bind("act")[:] = np.repeat([e.controls[0] for e in experiments], count, axis=0)
        batch.forward(stage=mujoco.mjtStage.mjSTAGE_POS)
        steps = 0
        for frame in range(max(lengths)):
            active = sum(frames > frame for frames in lengths)
            for t in range(active):
                block = slice(t * count, (t + 1) * count)
                results[t][:, frame] = seen[block, sites]
                control[block] = experiments[t].controls[frame]
            running = sum(frames > frame + 1 for frames in lengths)
            if running:
                ids = np.arange(running * count, dtype=np.int32)
                batch.step(ids=ids, nstep=substeps, stage=mujoco.mjtStage.mjSTAGE_POS)
                steps += substeps * len(ids)
        return results, steps
