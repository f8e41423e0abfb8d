"""All candidates times all trials as one batch of simulations, or as several on the workers of a scheduler."""

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
from trunkline.scheduler import PIECES, places, spread
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


@dataclass
class _Pace:
    """What trials in motion share that are simulated with each other, in one batch or in several.

    frame_step: s. longest: s, from any start to the first frame. lengths: at which of them end, frames. loaded: whether
    anything hangs from a tip.
    """

    frame_step: float
    longest: float
    lengths: list[int]
    loaded: bool

    @classmethod
    def of(cls, experiments: list[Experiment]) -> "_Pace":
        lengths = sorted({1, *(e.frames for e in experiments)})
        loaded = any(e.load for e in experiments)
        return cls(experiments[0].frame_step, max(e.lead for e in experiments), lengths, loaded)


@dataclass
class _Piece:
    """Some candidates in some trials. fields: of the candidates. at_rest, moving: trials, by their numbers; those in
    motion as `Population` groups them. rests: near which to look."""

    fields: Fields
    at_rest: list[int]
    moving: dict[bool, list[int]]
    rests: list[np.ndarray] | None


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
        self._paces = {group: _Pace.of([experiments[i] for i in own]) for group, own in self._moving.items()}
        self._experiments = experiments
        self._step_factor = step_factor
        self._batches: dict[tuple[int, ...], Batch] = {}

    def __getstate__(self) -> dict:
        return self.__dict__ | {"_batches": {}}  # a worker makes its own

    def simulate(self, fields: Fields, rests: list[np.ndarray] | None = None) -> Simulated:
        """Run every candidate (the first axis of `fields`) through every experiment.

        Args:
            rests: near which all of them rest, as `Simulated.rests` has it of another candidate.
        """
        count = len(next(iter(fields.values())))
        edges, rounds = self._cut(count, places())
        parts = [
            _Piece({name: values[first:last] for name, values in fields.items()}, at_rest, moving, rests)
            for first, last in pairwise(edges)
            for at_rest, moving in rounds
        ]
        found = spread(_run_piece, parts, self)
        if len(found) == 1:
            return found[0]
        blocks = [found[start : start + len(rounds)] for start in range(0, len(found), len(rounds))]
        positions = [
            np.concatenate([part.positions[i] for part in found if part.positions[i] is not None])
            for i in range(len(self._experiments))
        ]
        diverged = np.concatenate([np.any([part.diverged for part in block], axis=0) for block in blocks])
        return Simulated(positions, diverged, sum(part.steps for part in found), found[0].rests)

    def _cut(self, count: int, places: int) -> tuple[list[int], list[tuple[list[int], dict[bool, list[int]]]]]:
        """Where to cut `count` candidates, and into which trials at rest and in motion: a piece for each of either.

        Where nothing is spread, all is one piece. Trials at rest stay together, as one may be looked for beside
        another; to the first of them comes the shape near which the next evaluation looks.
        """
        pieces = PIECES * places if places > 1 else 1
        slices = min(count, pieces)
        edges = [count * i // slices for i in range(slices + 1)]
        each = -(-pieces // slices)
        rounds = [
            ([], {group: own[i::each]}) for group, own in self._moving.items() for i in range(min(each, len(own)))
        ]
        if each == 1 or not rounds:
            return edges, [(self._at_rest, self._moving)]
        return edges, ([(self._at_rest, {})] if self._at_rest else []) + rounds

    def run(self, piece: _Piece) -> Simulated:
        """A piece; of other trials there are no positions."""
        count = len(next(iter(piece.fields.values())))
        positions: list = [None] * len(self._experiments)
        found = [np.full((1, arm_hinges(self._model)), np.nan)] * len(self._experiments)
        steps = 0
        if piece.at_rest:
            own = [self._experiments[i] for i in piece.at_rest]
            near = None if piece.rests is None else [piece.rests[i] for i in piece.at_rest]
            results, angles, steps = shapes_at_rest(self._model, piece.fields, own, self._sites, near)
            for index, result, angle in zip(piece.at_rest, results, angles, strict=True):
                positions[index], found[index] = result, angle
        for slack, chosen in piece.moving.items():
            results, taken = self._run(slack, chosen, piece.fields, count)
            steps += taken
            for index, result in zip(chosen, results, strict=True):
                positions[index] = result
        diverged = np.zeros(count, dtype=bool)
        for result in positions:
            if result is not None:
                diverged |= ~np.isfinite(result).all(axis=(1, 2, 3))
        return Simulated(positions, diverged, steps, found)

    def _batch(self, slack: bool, chosen: list[int], fields: Fields, count: int) -> Batch:
        """A batch whose simulation t·C + c is candidate c in trial t, at the trial's start, its motors yet to be set.
        """
        experiments = [self._experiments[i] for i in chosen]
        batch = self._batches.get(tuple(chosen))
        if batch is None or batch.nsim != count * len(experiments):
            model = _without_idle(self._model, slack, fields)
            batch = self._batches[tuple(chosen)] = batch_of(model, count * len(experiments))
        if slack:  # cables do not rub, winches do not wind
            fields = {name: values for name, values in fields.items() if name != "numeric_data"}
        batch.reset(stage=mujoco.mjtStage.mjSTAGE_NONE)
        for name, values in fields.items():
            batch.expand(name)[:] = np.tile(values, (len(experiments),) + (1,) * (values.ndim - 1))
        batch.expand("opt.gravity")[:] = np.repeat([e.gravity for e in experiments], count, axis=0)
        loads = np.repeat([e.load for e in experiments], count)
        if self._paces[slack].loaded:
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
        self, slack: bool, chosen: list[int], fields: Fields, count: int
    ) -> tuple[list[np.ndarray], int]:
        """Trials in motion, all cables slack in all of them or in none: from the start to the first frame, then frame
        by frame."""
        experiments, pace = [self._experiments[i] for i in chosen], self._paces[slack]
        batch = self._batch(slack, chosen, fields, count)
        frame_step, sites = pace.frame_step, self._sites
        substeps = max(1, round(frame_step / (self._model.opt.timestep * self._step_factor)))
        timestep = batch.expand("opt.timestep")
        timestep[:] = np.repeat([e.lead / substeps for e in experiments], count)
        first = wound_by_each(self._model, fields, np.array([e.controls[:1] for e in experiments]))[:, 0]
        if self._model.nu:
            hold(batch, self._model, first)
        winches = Winches(batch, first)
        move(batch, np.repeat(first[:, None], substeps, axis=1), (), longest=pace.longest / substeps)
        timestep[:] = frame_step / substeps
        lengths = [e.frames for e in experiments]
        results = [np.empty((count, frames, len(sites), 3)) for frames in lengths]
        for start, end in pairwise(pace.lengths):  # trials that are over stay behind
            running = [e for e in experiments if e.frames >= end]
            if not running:
                break
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


def _run_piece(population: Population, piece: _Piece) -> Simulated:
    return population.run(piece)


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
