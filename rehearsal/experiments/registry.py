"""All experiments, and the variants of each that say what a part of the system is worth."""

from collections.abc import Callable

from rehearsal.experiments.bench import Bench, Seen
from rehearsal.experiments.follow import follow
from rehearsal.experiments.reach import reach
from rehearsal.experiments.result import Result

Experiment = Callable[[Bench, int], tuple[Result, list[Seen]]]  # one run, of a seed
Change = Callable[[Bench], Bench]  # what a variant has instead

EXPERIMENTS: dict[str, Experiment] = {"reach": reach, "follow": follow}
VARIANTS: dict[str, dict[str, Change]] = {}  # experiment: name of the variant: its change
