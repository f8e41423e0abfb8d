"""How well the arm repeats itself: the part of every error that no model of it can take away.

Trials that end alike, under the same gravity, load and pull, should end in the same shape. Friction and creep leave the
arm elsewhere each time; how far is what a prediction of the mean shape, the best one, would be off.
"""

import numpy as np

from trunkline.identification.simulate.resting import LAST, STILL
from trunkline.recordings.trials.experiments import is_static, is_stepwise
from trunkline.recordings.trials.recording import PULLED
from trunkline.recordings.trials.trial import Trial

SAME_GRAVITY = 0.035  # m/s², 0.2° of tilt: an arm held level sags by half a millimetre more or less then
SAME_LOAD = 1e-3  # kg
FEWEST = 3  # trials that end alike, below which they say nothing


def repeatability(trials: list[Trial], tip: int) -> dict[str, dict]:
    """The scatter of the shapes in which trials of a kind end at rest, by kind; without a kind that never repeats.

    A trial's distance is that of its markers from their mean place over the trials that end alike, enlarged by
    √(n / (n - 1)), as the mean is drawn towards each of the n.

    Args:
        trials: that track the same markers. tip: which of these is the farthest from the base along the chain.

    Returns:
        `mean_mm` over markers and trials, `tip_mm` of the tip alone, `tip_worst_mm` of the worst trial, `trials`
        that end alike with others, `groups` of them.
    """
    table = {}
    for kind in sorted({trial.experiment for trial in trials}):
        ends = [(trial, end_shape(trial)) for trial in trials if trial.experiment == kind]
        groups = _alike([(trial, shape) for trial, shape in ends if shape is not None])
        distances = [_scatter(np.array(shapes)) for shapes in groups if len(shapes) >= FEWEST]
        if distances:
            rows = np.concatenate(distances) * 1e3
            table[kind] = {
                "mean_mm": float(np.nanmean(rows)),
                "tip_mm": float(np.nanmean(rows[:, tip])),
                "tip_worst_mm": float(np.nanmax(rows[:, tip])),
                "trials": len(rows),
                "groups": len(distances),
            }
    return table


def end_shape(trial: Trial) -> np.ndarray | None:
    """The mean shape of a trial's last half second, m, nan where not measured; None if it still moves, or rests in many
    shapes. Shape (S, 3)."""
    if is_stepwise(trial.experiment):
        return None
    if is_static(trial.experiment):
        return np.where(trial.measured[0][:, None], trial.positions[0], np.nan)
    last = trial.time >= trial.time[-1] - LAST
    count = trial.measured[last].sum(axis=0)[:, None]
    valid = trial.measured[last][..., None]
    low, high = (np.where(valid, trial.positions[last], end).T for end in (np.inf, -np.inf))
    if (high.max(axis=2) - low.min(axis=2)).max() >= STILL or trial.time[-1] - trial.start < LAST:
        return None
    return np.where(valid, trial.positions[last], 0).sum(axis=0) / np.where(count, count, np.nan)


def _alike(ends: list[tuple[Trial, np.ndarray]]) -> list[list[np.ndarray]]:
    """Shapes by what acts on the arm at the end: those of a group are like its first."""
    groups: list[tuple[Trial, list[np.ndarray]]] = []
    for trial, shape in ends:
        for first, shapes in groups:
            if _same(first, trial):
                shapes.append(shape)
                break
        else:
            groups.append((trial, [shape]))
    return [shapes for _, shapes in groups]


def _same(first: Trial, second: Trial) -> bool:
    if first.session != second.session:
        return False
    if np.abs(first.gravity - second.gravity).max() > SAME_GRAVITY or abs(first.load - second.load) > SAME_LOAD:
        return False
    if first.tendons != second.tendons or not first.tendons:
        return first.tendons == second.tendons
    pulls = [np.maximum(trial.commands[-1], 0) for trial in (first, second)]  # slack is slack, by however much
    return bool(np.abs(pulls[0] - pulls[1]).max() < PULLED[first.command_unit])


def _scatter(shapes: np.ndarray) -> np.ndarray:
    """Distances (n, S) of n shapes (n, S, 3) from their mean."""
    count = len(shapes)
    return np.linalg.norm(shapes - np.nanmean(shapes, axis=0), axis=-1) * np.sqrt(count / (count - 1))
