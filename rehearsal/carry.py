"""Keep the runs that older code or another package made, where a sample of them, made again now, comes to the same.

    python -m rehearsal.carry [--experiments grasp handle] [--each 2] [--table artifacts/rehearse/runs.csv]

A run is drawn by its seed alone, so that what changes no result, as a name in the code or a word in the package, need
not cost hours of runs. `experiments`: to carry; a change may move some and leave others. `each`: that are made again of
each experiment, and as many of its variants.
"""

import argparse
import sys
from collections import Counter
from collections.abc import Collection
from dataclasses import replace
from pathlib import Path

import numpy as np

from rehearsal.experiments.registry import EXPERIMENTS
from rehearsal.experiments.result import Result, as_row, read_results, rewrite_results
from rehearsal.rehearse import OUT
from rehearsal.runs import Source, performed, run_of, source_of
from trunkline.errors import InputError, in_one_line
from trunkline.foresight.package import only_package
from trunkline.pipeline.checkout import require_checkout
from trunkline.threads import thread_count

OF_SOURCE = ("package", "code")  # columns


def carry(
    table: Path, package: Path, source: Source, each: int, workers: int, experiments: Collection[str] = ()
) -> tuple[int, int]:
    """How many runs of `experiments`, none for all, were made again, and how many became runs of `source`.

    Raises:
        InputError: there is none to carry, or one came to something else; the table is as it was.
    """
    results = read_results(table)
    asked = [one for one in results if not experiments or one.experiment in experiments]
    older = Counter(Source(one.package, one.code) for one in asked if Source(one.package, one.code) != source)
    if not older:
        told = f" of {' or '.join(experiments)}" if experiments else ""
        raise InputError(f"{table}: found no runs{told} by other code or of another package, expected those to carry")
    ((chosen, _),) = older.most_common(1)
    have = {run_of(one) for one in source.of(results)}
    rows = {run_of(one): one for one in chosen.of(asked) if run_of(one) not in have}
    sample = _sample(list(rows.values()), each)
    for result, _ in performed([run_of(one) for one in sample], package, workers):
        run = run_of(result)
        before, now = ({k: v for k, v in as_row(one).items() if k not in OF_SOURCE} for one in (rows[run], result))
        told = f"{run.experiment}{run.variant and ', '}{run.variant} {run.seed}"
        if differing := [name for name in now if now[name] != before[name]]:
            name = differing[0]
            raise InputError(f"{table}: {told}: found {name} {now[name]}, expected {before[name]}; none carried")
        print(f"{told}: the same", flush=True)
    carried = [replace(one, package=source.package, code=source.code) for one in rows.values()]
    others = [one for one in results if not (Source(one.package, one.code) == chosen and run_of(one) in rows)]
    rewrite_results(table, others + carried)
    return len(sample), len(carried)


def _sample(rows: list[Result], each: int) -> list[Result]:
    """`each` of each experiment's own runs, and as many of its variants."""
    rng, found = np.random.default_rng(0), []
    for group in dict.fromkeys((one.experiment, bool(one.variant)) for one in rows):
        those = [one for one in rows if (one.experiment, bool(one.variant)) == group]
        found += [those[i] for i in rng.choice(len(those), min(each, len(those)), replace=False)]
    return found


@in_one_line
def main() -> int:
    parser = argparse.ArgumentParser(prog="rehearsal.carry", description=(__doc__ or "").partition("\n")[0])
    parser.add_argument("--experiments", nargs="+", default=[], choices=EXPERIMENTS, help="to carry; default: all")
    parser.add_argument("--each", type=int, default=2, choices=range(1, 1001), metavar="1..1000")
    parser.add_argument("--table", type=Path, default=OUT / "runs.csv")
    given = parser.parse_args()
    require_checkout(Path("."))
    package = only_package()
    again, carried = carry(given.table, package, source_of(package), given.each, thread_count(), given.experiments)
    print(f"{again} runs made again, all the same; {carried} carried over")
    return 0


if __name__ == "__main__":
    sys.exit(main())
