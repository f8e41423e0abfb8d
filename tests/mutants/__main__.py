"""`python -m tests.mutants`: how many small faults of what judges, scores, decides and stops are noticed by its tests.

The mutants are those of `operators.py` in what targets.yaml names, and its edits by hand. One that survives is named in
equivalent.yaml, under the reason why nothing that is promised tells it from the original; what is named there and does
not survive is an error too. All together write table.md, which is committed. A sample is drawn from those that have to
be killed; it takes that their tests pass from `make test`. Exit code 1 below 90 %, or with a survivor without a reason.
"""

import argparse
import os
import sys
import time
from collections import Counter
from datetime import UTC, datetime
from pathlib import Path

from tests.mutants import targets
from tests.mutants.operators import Mutant

LEAST = 0.9  # share of mutants that are killed
Pairs = list[tuple[Mutant, "running.Outcome"]]  # noqa: F821


def main(arguments: list[str] | None = None, folder: Path = Path(__file__).parent, root: Path = Path(".")) -> int:
    asked = _arguments(arguments)
    try:
        every, reasons = targets.read_targets(folder, root), targets.read_reasons(folder)
    except ValueError as error:
        print(f"mutants: error: {error}", file=sys.stderr)
        return 1
    chosen = [m for m in every if m.path.startswith(asked.only) and asked.like in m.key]
    if asked.sample:
        chosen = targets.drawn(chosen, reasons, asked.sample, asked.seed)
        print(f"mutants: a sample of {len(chosen)} of {len(every)}, seed {asked.seed}")
    if asked.list:
        print(*(f"{m.path}:{m.line}: {m.function}: {m.name}" for m in chosen), sep="\n")
        return 0
    wrong = [f"{targets.EQUIVALENT}: no such mutant: {key}" for key in reasons.keys() - {m.key for m in every}]
    return _report(_run(chosen, asked), reasons, asked, wrong, folder)


def _run(chosen: list[Mutant], asked: argparse.Namespace) -> Pairs:
    _prepare()
    from tests.mutants import running

    number = iter(range(1, len(chosen) + 1))

    def tell(mutant: Mutant, outcome: running.Outcome) -> None:
        done = f"{next(number)}/{len(chosen)}"
        if asked.each or outcome.kind == running.SURVIVED:
            where = f"{mutant.path}:{mutant.line}: {mutant.function}: {mutant.name}"
            print(f"{done} {outcome.kind} {outcome.seconds:.1f} s {where} [{outcome.by}]", flush=True)

    return running.outcomes(chosen, asked.workers, tell, tried=not asked.sample)


def _prepare() -> None:
    """What is to be so before NumPy is imported: as in the tests, and one thread, as processes run on all cores."""
    os.environ |= dict.fromkeys(("OPENBLAS_NUM_THREADS", "OMP_NUM_THREADS", "TRUNKLINE_THREADS"), "1")
    for module in [name for name in sys.modules if name.partition(".")[0] == "trunkline"]:
        del sys.modules[module]  # each process imports its own, with the mutant


def _report(pairs: Pairs, reasons: dict[str, str], asked: argparse.Namespace, wrong: list[str], folder: Path) -> int:
    from tests.mutants.running import SURVIVED, WRONG
    from tests.mutants.table import killed, table

    share, kinds = killed(pairs), Counter(outcome.kind for _, outcome in pairs)
    every = not (asked.only or asked.like or asked.sample)
    if (every or asked.sample) and share < LEAST:
        wrong.append(f"found {100 * share:.1f} % killed, expected at least {100 * LEAST:.0f} %")
    wrong += dict.fromkeys(f"{m.path}: {o.by}" for m, o in pairs if o.kind == WRONG)
    for mutant, outcome in pairs:
        if outcome.kind == SURVIVED and mutant.key not in reasons and not asked.sample:
            wrong.append(f"survives without a reason: {mutant.key}")
        if outcome.kind not in (SURVIVED, WRONG) and mutant.key in reasons:
            wrong.append(f"{targets.EQUIVALENT}: is killed: {mutant.key}")
    if every:
        (folder / "table.md").write_text(table(pairs, reasons), encoding="utf-8")
    for line in wrong:
        print(f"mutants: FAIL {line}")
    counts = ", ".join(f"{count} {kind}" for kind, count in kinds.items())
    print(f"mutants: {len(pairs)}, {100 * share:.1f} % killed ({counts}) in {time.monotonic() - BEGUN:.0f} s")
    return 1 if wrong else 0


def _arguments(arguments: list[str] | None) -> argparse.Namespace:
    week = datetime.now(UTC).isocalendar()
    parser = argparse.ArgumentParser(prog="python -m tests.mutants", description=__doc__)
    parser.add_argument("--sample", type=int, default=0, metavar="N", help="so many, by chance")
    parser.add_argument("--seed", default=f"{week.year}-{week.week}", help="of the sample, by default year and week")
    parser.add_argument("--only", default="", metavar="PATH", help="those of files whose path begins so")
    parser.add_argument("--like", default="", metavar="TEXT", help="those whose name has this in it")
    parser.add_argument("--list", action="store_true", help="name them, run nothing")
    parser.add_argument("--each", action="store_true", help="tell of each, not of survivors alone")
    parser.add_argument("--workers", type=int, default=len(os.sched_getaffinity(0)), metavar="N", help="processes")
    return parser.parse_args(arguments)


BEGUN = time.monotonic()

if __name__ == "__main__":
    sys.exit(main())
