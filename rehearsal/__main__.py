"""Rehearse some runs of the experiments on the stand-in robot, or film one of each.

    python -m rehearsal [--only reach] [--runs 10] [--variants 0] [--package FILE] [--out build/rehearse]
    python -m rehearsal --animate [--only reach] [--seed 0]

Runs that the table in the folder `out` has of the same package and code are not made again. The committed metrics are
of more: `dvc repro rehearsal/dvc.yaml`.
"""

import argparse
import sys
from pathlib import Path

from rehearsal.animation import animate
from rehearsal.experiments.bench import bench_of
from rehearsal.experiments.registry import EXPERIMENTS
from rehearsal.experiments.result import summary
from rehearsal.report import draw
from rehearsal.runs import make, source_of, wanted
from trunkline.ar.preview.package import only_package
from trunkline.compute.threads import thread_count
from trunkline.errors import in_one_line
from trunkline.pipeline.checkout import require_checkout
from upkeep.limits import read_limits
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
        animate(bench_of(package), names, arguments.seed, Path("artifacts/rehearse"))
        return 0
    runs = wanted({name: arguments.runs for name in names}, arguments.variants)
    source = source_of(package)
    results = make(runs, package, source, arguments.out / "runs.csv", thread_count())
    goals = read_limits(Path("tests/limits.yaml"))["rehearse"]
    print(rehearsal_table(summary(results), goals, f"with package `{source.package}`", variants=True))
    draw(results, arguments.out / "rehearsal.png")
    return 0


def _count(text: str) -> int:
    count = int(text)
    if count < 0:
        raise ValueError(text)
    return count


if __name__ == "__main__":
    sys.exit(main())
