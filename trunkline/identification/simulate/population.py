"""All candidates times all trials as one batch of simulations, or as several on the workers of a scheduler."""

from dataclasses import dataclass

import mujoco
import numpy as np

from trunkline.compute.scheduler import cuts, pieces, spread
from trunkline.identification.parameters.parameter import Fields
from trunkline.identification.simulate.at_rest import shapes_at_rest
from trunkline.identification.simulate.experiment import Experiment
from trunkline.identification.simulate.in_motion import InMotion
from trunkline.model.arm_model import ArmModel
from trunkline.recordings.trials.experiments import is_static


@dataclass
class Simulated:
    """Marker positions of every trial, in the order of the experiments.

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
class _Piece:
    """Some candidates in some trials. fields: of the former. trials: by their numbers. rests: near which to look.
    rough: as `batch_of` has it."""

    fields: Fields
    trials: list[int]
    rests: list[np.ndarray] | None
    rough: bool


@dataclass
class _PieceResult:
    """Of a piece, by the numbers of its trials: positions as in `Simulated`, and rests of those at rest; steps."""

    positions: dict[int, np.ndarray]
    rests: dict[int, np.ndarray]
    steps: int


class Population:
    """Simulates candidates of one model on a fixed list of experiments of the same markers.

    Args:
        model: the model that candidates start from. Its step is fitted to divide a frame evenly.
        step_factor: how much coarser than the model's own step to simulate, 1 for reported numbers.
    """

    def __init__(
        self, model: mujoco.MjModel, experiments: list[Experiment], markers: tuple[str, ...], step_factor: float = 1.0
    ):
        self._model = model
        self._sites = ArmModel(model).marker_sites(markers)
        self._experiments = experiments
        # longest first, as `InMotion` has them
        order = sorted(range(len(experiments)), key=lambda i: -experiments[i].frames)
        self._at_rest = [i for i in order if is_static(experiments[i].kind)]
        moving = [i for i in order if not is_static(experiments[i].kind)]
        if moving:
            ArmModel(model).require_stiff_units(f"trial {experiments[moving[0]].name}, which moves")
        slack = {i: experiments[i].slack(model) for i in moving}
        self._in_motion = [
            InMotion(model, {i: experiments[i] for i in moving if slack[i] == group}, group, self._sites, step_factor)
            for group in sorted(set(slack.values()))
        ]

    def simulate(self, fields: Fields, rests: list[np.ndarray] | None = None, rough: bool = False) -> Simulated:
        """Run every candidate (the first axis of `fields`) through every experiment.

        Args:
            rests: near which all of them rest, as `Simulated.rests` has it of another candidate.
            rough: as `batch_of` has it.
        """
        parts = self._cut(fields, rests, rough)
        results = spread(Population.run, parts, self)
        every = range(len(self._experiments))
        positions = [_joined([part.positions[i] for part in results if i in part.positions]) for i in every]
        diverged = np.zeros(len(next(iter(fields.values()))), dtype=bool)
        for result in positions:
            diverged |= ~np.isfinite(result).all(axis=(1, 2, 3))
        unknown = np.full((1, ArmModel(self._model).hinge_count), np.nan)
        angles = [results[0].rests.get(i, unknown) for i in every]
        return Simulated(positions, diverged, sum(part.steps for part in results), angles)

    def _cut(self, fields: Fields, rests: list[np.ndarray] | None, rough: bool = False) -> list[_Piece]:
        """All candidates in all trials; where there are workers, in pieces: some candidates each, and where those are
        too few, some trials each.

        Trials at rest stay together and come first, as one may be looked for beside another.
        """
        count = len(next(iter(fields.values())))
        wanted = pieces(count * len(self._experiments))
        slices = cuts(count, min(count, wanted))
        each = -(-wanted // len(slices))
        trials = [list(range(len(self._experiments)))]
        if each > 1:
            moving = [list(group.trials)[i::each] for group in self._in_motion for i in range(each)]
            trials = [numbers for numbers in (self._at_rest, *moving) if numbers]
        groups = [{name: values[some] for name, values in fields.items()} for some in slices]
        return [_Piece(candidates, numbers, rests, rough) for candidates in groups for numbers in trials]

    def run(self, piece: _Piece) -> _PieceResult:
        result = _PieceResult({}, {}, 0)
        if at_rest := [i for i in self._at_rest if i in piece.trials]:
            resting = [self._experiments[i] for i in at_rest]
            near = None if piece.rests is None else [piece.rests[i] for i in at_rest]
            results, angles, result.steps = shapes_at_rest(self._model, piece.fields, resting, self._sites, near)
            result.positions |= zip(at_rest, results, strict=True)
            result.rests |= zip(at_rest, angles, strict=True)
        for group in self._in_motion:
            if numbers := [i for i in group.trials if i in piece.trials]:
                results, steps = group.shapes(piece.fields, numbers, piece.rough)
                result.positions |= zip(numbers, results, strict=True)
                result.steps += steps
        return result


def _joined(parts: list[np.ndarray]) -> np.ndarray:
    return parts[0] if len(parts) == 1 else np.concatenate(parts)
