"""Rehearse some runs of the experiments on the stand-in robot, or film one of each.

    python -m rehearsal [--only reach] [--runs 10] [--variants 0] [--package FILE] [--out build/rehearse]
    python -m rehearsal --animate [--only reach] [--seed 0]

Says where table and picture will be; how long it takes, once the first run of each experiment is made. Runs that the
table in the folder `out` has of the same package and code are not made again. The committed metrics are of more:
`dvc repro rehearsal/dvc.yaml`.
"""

import argparse
import sys
import time
from pathlib import Path

from rehearsal.animation import animate
from rehearsal.experiments.bench import bench_of
from rehearsal.experiments.registry import EXPERIMENTS
from rehearsal.experiments.result import Result, read_results
from rehearsal.rehearse import OUT, TABLE, metrics_of
from rehearsal.report import draw
from rehearsal.runs import Run, RunSource, make, run_of, source_of, wanted
from trunkline.ar.preview.package import only_package
from trunkline.compute.threads import thread_count
from trunkline.errors import in_one_line
from trunkline.pipeline.checkout import require_checkout
from upkeep.limits import read_limits
from upkeep.readme import preview_table
from upkeep.rehearsal_table import rehearsal_table


@in_one_line
def main() -> int:
    parser = argparse.ArgumentParser(prog="rehearsal", description=(__doc__ or "").partition("\n")[0])
    parser.add_argument("--only", choices=sorted(EXPERIMENTS))
    parser.add_argument("--runs", type=_count, default=10, help="of each experiment, seeds 0, 1, ...")
    parser.add_argument("--variants", type=_count, default=0, help="runs of each variant of them")
    parser.add_argument("--animate", action="store_true", help="film one run of each, into artifacts/rehearse/")
    parser.add_argument("--seed", type=_count, default=0, help="of the run that is filmed")
    parser.add_argument("--package", type=Path, default=None)
    parser.add_argument("--out", type=Path, default=Path("build/rehearse"))
    arguments = parser.parse_args()
    names = [arguments.only] if arguments.only else list(EXPERIMENTS)
    require_checkout(Path("."))
    package = arguments.package or only_package()
    if arguments.animate:
        animate(bench_of(package), names, arguments.seed, OUT)
        return 0
    runs = wanted({name: arguments.runs for name in names}, arguments.variants)
    source = source_of(package)
    table, picture = arguments.out / TABLE, arguments.out / "rehearsal.png"
    print(f"table: {table}, a row when a run ends; picture: {picture}, at the end", flush=True)
    results = make_timed(runs, package, source, table, thread_count())
    goals = read_limits(Path("tests/limits.yaml"))["rehearse"]
    metrics = metrics_of(source, results)
    print(rehearsal_table(metrics, goals, f"with package `{source.package}`", variants=True))
    if stated := preview_table(metrics.get("preview"), goals):
        print(f"\n{stated}")
    draw(results, picture)
    return 0


def make_timed(runs: list[Run], package: Path, source: RunSource, table: Path, workers: int) -> list[Result]:
    """As `runs.make`, the first missing run of each experiment before all others; then says how long those take."""
    made = {run_of(result) for result in source.of(read_results(table))}
    missing = [run for run in runs if run not in made]
    first = list({run.experiment: run for run in reversed(missing)}.values())
    print(f"{len(missing)} of {len(runs)} runs to make, {workers} side by side; Ctrl-C stops, the same command goes on")
    if len(missing) > len(first):
        began = time.monotonic()
        make(first, package, source, table, workers)
        minutes = (time.monotonic() - began) / len(first) * (len(missing) - len(first)) / 60
        print(f"{len(missing) - len(first)} more runs, about {max(minutes, 1):.0f} min", flush=True)
    return make(runs, package, source, table, workers)


def _count(text: str) -> int:
    count = int(text)
    if count < 0:
        raise ValueError(text)
    return count


if __name__ == "__main__":
    sys.exit(main())
