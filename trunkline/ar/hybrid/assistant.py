"""The assistant: a few places of the mount near the user's own, tried in one batch.

Of many places tried in few futures, the best seems surer than it is. So the best few are tried once more, in futures of
their own and as many as of a plan: by these one is chosen, and these are its probability.

A mount that is elsewhere, turned alike, is an object that is elsewhere the other way. So one composed model and one
plan serve all places, each with the same futures: places differ by what they are, not by their luck.
"""

from collections.abc import Callable

import numpy as np

from trunkline.ar.hybrid.outcomes import Holding
from trunkline.ar.hybrid.rollout_batch import interruptible, joined
from trunkline.ar.hybrid.rollouts import CommandTrajectory, ComposedTwin, rollouts
from trunkline.ar.hybrid.uncertainty import GraspUncertainty, PosteriorSamples, sample


def try_places(
    twin: ComposedTwin,
    trajectory: CommandTrajectory,
    uncertainty: GraspUncertainty,
    holding: Holding,
    offsets: np.ndarray,
    count: int,
    seed: int = 0,
    go_on: Callable[[], None] = lambda: None,
) -> np.ndarray:
    """Share of `count` futures that hold the object, for each place. Shape (P,).

    Args:
        offsets: where the mount of each place is, less that of the plan, world axes, m. Shape (P, 3).
        go_on: as `preview`.
    """
    samples, places = sample(uncertainty, twin.arm, count, seed), len(offsets)
    moved = np.tile(samples.offsets, (places, 1)) - np.repeat(offsets, count, axis=0)
    values = {name: np.tile(column, places) for name, column in samples.values.items()}
    many = PosteriorSamples(values, np.tile(samples.friction, places), moved, np.tile(samples.turns, places))
    motion = joined(list(interruptible(rollouts(twin, trajectory, many), go_on)))
    return holding.holds(motion).reshape(places, count).mean(axis=1)


def surest(offsets: np.ndarray, shares: np.ndarray) -> np.ndarray:
    """The places, the surest first, the nearest to the plan's first among equals. Shape (P,)."""
    return np.lexsort((np.linalg.norm(offsets, axis=1), -shares))
