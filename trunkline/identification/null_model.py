"""The null model: an arm that hangs still. A model whose errors are not far below its knows nothing of forces."""

import numpy as np

from trunkline.identification.evaluation import Replay
from trunkline.identification.experiment import Experiment
from trunkline.trials.splits import IDENTIFY


def hanging_still(experiments: list[Experiment], like: Replay) -> Replay:
    """Every trial as the mean shape at rest, from the first frame to the last.

    The shape is the mean over the trials of the same kind to identify from, of where each segment was measured last:
    in a static tilt its mean place, after a release or a curl where the arm came to rest. A kind of which there is
    none to identify from takes the mean over all kinds.

    Args:
        experiments: those to identify from, and others.
        like: a model's replay of the same experiments, for the arm's length and tip.
    """
    seen = [e for e in experiments if e.split == IDENTIFY]
    positions = []
    for experiment in experiments:
        same = [e for e in seen if e.kind == experiment.kind] or seen
        shape = np.nanmean([_last_shape(e) for e in same], axis=0)
        positions.append(np.broadcast_to(shape, experiment.positions.shape))
    return Replay(positions, like.length, like.tip)


def _last_shape(experiment: Experiment) -> np.ndarray:
    """Where each segment was measured last, m; nan where it never was. Shape (S, 3)."""
    frames, segments = experiment.measured.shape
    last = frames - 1 - np.argmax(experiment.measured[::-1], axis=0)
    shape = experiment.positions[last, np.arange(segments)]
    never = ~np.logical_or.reduce(experiment.measured, axis=0)
    return np.where(never[:, None], np.nan, shape)
