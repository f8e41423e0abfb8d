"""`python -m tests.mutants`: how many small faults of what judges, scores, decides and stops its tests find.

The mutants are those of `operators` in the functions that targets.yaml names, and its edits by hand. One that survives
is named in equivalent.yaml, with the reason why nothing that is promised tells it from the original. The table that is
written, table.md, is committed. `--sample 40` runs some of them, drawn anew each week.
"""

import argparse
import os
import random
import sys
import time
from collections import Counter
from collections.abc import Iterator
from dataclasses import replace
from datetime import UTC, datetime
from pathlib import Path

import yaml

FOLDER = Path(__file__).parent
LEAST = 0.9  # share of mutants that are killed

for name, threads in (("OPENBLAS_NUM_THREADS", "1"), ("OMP_NUM_THREADS", "1"), ("TRUNKLINE_THREADS", "1")):
    os.environ[name] = threads  # before NumPy: as many processes run as there are cores


def main(arguments: list[str] | None = None) -> int:
    from trunkline.arithmetic import hold_arithmetic

    hold_arithmetic()
    for module in [name for name in sys.modules if name.partition(".")[0] == "trunkline"]:
        del sys.modules[module]  # the mutants are loaded anew
    from tests.mutants import running

    asked = _parser().parse_args(arguments)
    begun = time.monotonic()
    try:
        mutants = list(every(Path(FOLDER / "targets.yaml")))
        reasons = yaml.safe_load((FOLDER / "equivalent.yaml").read_text()) or {}
    except ValueError as error:
        print(f"mutants: error: {error}", file=sys.stderr)
        return 1
    keys = {mutant.key for mutant in mutants}
    wrong = [f"equivalent.yaml: no such mutant: {key}" for key in reasons if key not in keys]
    chosen = [m for m in mutants if m.path.startswith(asked.only) and asked.of in m.key]
    if asked.sample:
        week = datetime.now(UTC).isocalendar()
        seed = asked.seed or f"{week.year}-{week.week}"
        others = [m for m in chosen if m.key not in reasons]
        chosen = random.Random(seed).sample(others, min(asked.sample, len(others)))
        print(f"mutants: {len(chosen)} of {len(others)}, seed {seed}")
    if asked.list:
        print(*(f"{m.path}:{m.line}: {m.function}: {m.name}" for m in chosen), sep="\n")
        return 0
    running.load_libraries()
    workers = asked.workers
    bounds = dict(running.limits((m.tests for m in chosen), workers))
    wrong += [f"{' '.join(tests)}: {bound}" for tests, bound in bounds.items() if isinstance(bound, str)]
    chosen = [m for m in chosen if not isinstance(bounds[m.tests], str)]
    count = iter(range(1, len(chosen) + 1))

    def tell(job: running.Job, outcome: running.Outcome) -> None:
        if outcome.kind == running.SURVIVED or asked.all:
            mutant = by_text[job.path, job.text]
            print(f"{next(count)}/{len(chosen)} {outcome.kind} {outcome.seconds:.1f} s {mutant.path}:{mutant.line}: "
                  f"{mutant.function}: {mutant.name} [{outcome.by}]", flush=True)  # fmt: skip
        else:
            next(count)

    by_text = {(m.path, m.text): m for m in chosen}
    results = running.outcomes([running.of(m, bounds[m.tests]) for m in chosen], workers, tell)
    pairs = list(zip(chosen, results, strict=True))
    wrong += [f"{m.key}: {o.by}" for m, o in pairs if o.kind == running.WRONG]
    survivors = [m for m, o in pairs if o.kind == running.SURVIVED]
    alive = {m.key for m in survivors}
    wrong += [f"survives, and equivalent.yaml gives no reason: {key}" for key in alive if key not in reasons
              and not asked.sample]  # fmt: skip
    wrong += [f"equivalent.yaml: is killed: {m.key}" for m in chosen if m.key in reasons and m.key not in alive]
    share = 1 - len(survivors) / max(len(pairs), 1)
    kinds = Counter(o.kind for _, o in pairs)
    print(f"mutants: {len(pairs)}, {100 * share:.1f} % killed ({', '.join(f'{n} {k}' for k, n in kinds.items())}), "
          f"{time.monotonic() - begun:.0f} s")  # fmt: skip
    if share < LEAST:
        wrong.append(f"found {100 * share:.1f} % killed, expected at least {100 * LEAST:.0f} %")
    if not asked.only and not asked.of and not asked.sample:
        (FOLDER / "table.md").write_text(table(pairs, reasons))
    for line in wrong:
        print(f"mutants: FAIL {line}")
    return 1 if wrong else 0


def _parser() -> argparse.ArgumentParser:
    parser = argparse.ArgumentParser(prog="python -m tests.mutants", description=__doc__)
    parser.add_argument("--sample", type=int, default=0, help="so many, by chance")
    parser.add_argument("--seed", default="", help="of the sample; by default the week")
    parser.add_argument("--only", default="", metavar="PATH", help="those of files whose path begins so")
    parser.add_argument("--of", default="", metavar="TEXT", help="those that have this in their name")
    parser.add_argument("--list", action="store_true", help="name them, run nothing")
    parser.add_argument("--all", action="store_true", help="print what became of each, not of survivors alone")
    parser.add_argument("--workers", type=int, default=os.cpu_count())
    return parser


def every(path: Path) -> Iterator:
    """The mutants of all targets.

    Raises:
        ValueError: a target names what is not there, or the old text of an edit is not there exactly once.
    """
    from tests.mutants.operators import Mutant, mutants

    document = yaml.safe_load(path.read_text())
    for file, target in document["targets"].items():
        text = Path(file).read_text()
        for group in target if isinstance(target, list) else [target]:
            for mutant in mutants(file, text, group.get("only", ())):
                yield replace(mutant, tests=tuple(group["tests"]))
    for file, edits in document["edits"].items():
        text = Path(file).read_text()
        for edit in edits:
            old, new = edit["old"], edit["new"]
            if text.count(old) != 1:
                raise ValueError(f"{file}: {edit['id']}: found {text.count(old)} times, expected once: {old!r}")
            line = text.count("\n", 0, text.index(old)) + 1
            yield Mutant(file, edit["id"], edit["bug"], line, text.replace(old, new), tuple(edit["tests"]))


def table(pairs: list, reasons: dict[str, str]) -> str:
    """As table.md has it."""
    from tests.mutants.running import BROKEN, LATE, SURVIVED

    rows: dict[str, Counter] = {}
    for mutant, outcome in pairs:
        rows.setdefault(mutant.path, Counter())[outcome.kind] += 1
    total = sum(rows.values(), Counter())
    lines = ["# Mutants", "", "Written by `make mutants`; tests/mutants/__main__.py says what they are.", ""]
    lines += ["| file | mutants | killed | of these late | not imported | survive |", "|---|---:|---:|---:|---:|---:|"]
    for name, row in [*rows.items(), ("all", total)]:
        lines.append(f"| {name} | {row.total()} | {row.total() - row[SURVIVED]} | {row[LATE]} | {row[BROKEN]} | "
                     f"{row[SURVIVED]} |")  # fmt: skip
    lines += ["", f"{100 * (1 - total[SURVIVED] / total.total()):.1f} % are killed. What survives, and why it may:", ""]
    lines += [f"- `{m.key}`: {reasons.get(m.key, 'no reason yet')}" for m, o in pairs if o.kind == SURVIVED]
    return "\n".join([*lines, ""])


if __name__ == "__main__":
    sys.exit(main())
