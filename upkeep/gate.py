"""`python -m upkeep.gate`: do the metrics keep within tests/limits.yaml, and an example's within its own?

A row is held to its goal, where it has one, and to a bound near its value in `baseline.json`, which only
`make baseline` changes. The gate needs no history, and fails closed: what is missing, null, not a number or not finite
fails, and so does a row without a baseline, and a baseline that was edited. With Git it also asks that the baseline's
commit is in the history, and changed nothing else; where Git cannot say, that is told. No row is of the split `test`:
`python -m upkeep.release` holds that against goals, and decides nothing. A headline whose runs are of
another code than the tree's fails too (upkeep/provenance.py). Metrics that no row names are let alone. A
stage that has no row in the baseline and no metrics has never run, as the rehearsal before its first: that is told, and
no failure.
"""

import sys
from pathlib import Path

from trunkline.errors import InputError
from upkeep.baseline import (
    MetricBaseline,
    baseline_file,
    breaks,
    company,
    disagreements,
    read_baseline,
    unchecked,
    unrun,
)
from upkeep.limits import Limits, limit_files, metrics_folder, read_limits, read_metrics
from upkeep.provenance import stale


def failures(limits: Limits, baseline: MetricBaseline, folder: Path) -> list[str]:
    """One line per metric in `folder` that breaks its limit, naming stage and key; empty if all is well."""
    problems, never = [], unrun(limits, baseline, folder)
    for stage, rows in limits.items():
        if stage in never:
            continue
        try:
            metrics = read_metrics(folder, stage)
        except InputError as error:
            problems.append(f"{stage}: {error}")
            continue
        for key, limit in rows.items():
            before = baseline.metrics.get(stage, {}).get(key)
            if before is None and limit.equals is None:
                problems.append(f'{stage}: {key}: no baseline, expected one (`make baseline REASON="..."`)')
            problems += [f"{stage}: {key}: {problem}" for problem in limit.problems(metrics, key, before)]
    return problems


def main(root: Path = Path(".")) -> int:
    count, stages, count_problems = 0, 0, 0
    for file in limit_files(root):
        try:
            limits, baseline = read_limits(file), read_baseline(baseline_file(file))
        except InputError as error:
            print(f"gate: error: {error}", file=sys.stderr)
            return 1
        folder = metrics_folder(file)
        example = "" if folder == root else f"{folder.name}: "
        never = unrun(limits, baseline, folder)
        for stage in never:
            print(f"gate: {example}{stage}: never ran, its {len(limits[stage])} rows hold nothing yet")
        problems = [*failures(limits, baseline, folder), *breaks(baseline), *disagreements(baseline, folder)]
        problems += company(baseline_file(file))
        for problem in problems:
            print(f"gate: FAIL {example}{problem}")
        checked = [rows for stage, rows in limits.items() if stage not in never]
        count, stages = count + sum(map(len, checked)), stages + len(checked)
        count_problems += len(problems)
    for problem in stale(root):
        print(f"gate: FAIL {problem}")
        count_problems += 1
    if why := unchecked(root):
        print(f"gate: {why}: not checked whether the commits of baselines are in the history and have their values")
    print(f"gate: {count} metrics in {stages} stages, {count_problems} problems")
    return 1 if count_problems else 0


if __name__ == "__main__":
    sys.exit(main())
