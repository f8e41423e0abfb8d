"""table.md: what became of the mutants of each file, and of those that survive, why they may."""

from collections import Counter

from tests.mutants.running import BROKEN, LATE, SURVIVED, WRONG, Pairs

HEAD = """# Mutants

Written by `make mutants`, which `python -m tests.mutants --help` says more of. Killed are also those that the tests do
not end with in time (late) or that cannot be imported. One whose tests do not pass without it has no result, and counts
as not killed.

| file | mutants | killed | of these late | not imported | survive | no result |
|---|---:|---:|---:|---:|---:|---:|
"""


def table(pairs: Pairs, reasons: dict[str, str]) -> str:
    rows: dict[str, Counter] = {}
    for mutant, outcome in pairs:
        rows.setdefault(mutant.path, Counter())[outcome.kind] += 1
    total = sum(rows.values(), Counter())
    lines = [_row(name, row) for name, row in [*sorted(rows.items()), ("**all**", total)]]
    lines += ["", f"{100 * killed(pairs):.1f} % are killed. What survives, and why it may:"]
    alive = [mutant.key for mutant, outcome in pairs if outcome.kind == SURVIVED]
    for why in dict.fromkeys(reasons.get(key, "no reason yet") for key in alive):
        lines += ["", f"{why}", ""]
        lines += [f"- `{key}`" for key in alive if reasons.get(key, "no reason yet") == why]
    return HEAD + "\n".join([*lines, ""])


def killed(pairs: Pairs) -> float:
    """The share of them, 1 of none."""
    return 1 - sum(outcome.kind in (SURVIVED, WRONG) for _, outcome in pairs) / max(len(pairs), 1)


def _row(name: str, row: Counter) -> str:
    dead = row.total() - row[SURVIVED] - row[WRONG]
    numbers = row.total(), dead, row[LATE], row[BROKEN], row[SURVIVED], row[WRONG]
    return f"| {name} | {' | '.join(map(str, numbers))} |"
