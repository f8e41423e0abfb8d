"""All experiments. What varies them, to say what a part of the system is worth, is in ablations.py."""

from collections.abc import Callable

from rehearsal.experiments.bench import Bench, Seen
from rehearsal.experiments.follow import follow
from rehearsal.experiments.grasp import grasp
from rehearsal.experiments.handle import handle
from rehearsal.experiments.reach import reach
from rehearsal.experiments.result import Result

Experiment = Callable[[Bench, int], tuple[Result, list[Seen]]]  # one run, of a seed

EXPERIMENTS: dict[str, Experiment] = {
    "reach": reach,
    "follow": follow,
    "grasp": grasp,
    "handle": handle,
}
