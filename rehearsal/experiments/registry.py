"""All experiments. What varies them, to say what a part of the system is worth, is in ablations.py."""

from collections.abc import Callable

from rehearsal.experiments.bench import SharedRun, Staged
from rehearsal.experiments.follow import follow
from rehearsal.experiments.grasp import grasp
from rehearsal.experiments.handle import handle
from rehearsal.experiments.reach import reach

EXPERIMENTS: dict[str, Callable[[SharedRun, int], Staged]] = {  # made of a seed, to be run
    "reach": reach,
    "follow": follow,
    "grasp": grasp,
    "handle": handle,
}
