"""Rehearse the experiments on the stand-in robot, and tell how often they succeed.

    python -m rehearsal [--only reach] [--runs 20] [--package artifacts/package_unity/...tgz] [--out artifacts/rehearse]

Runs that the table in the folder `out` has for the same package are not made again.
"""

import argparse
import time
from pathlib import Path

from demo.plants.choice import plant_of
from demo.plants.stranger import Stranger
from demo.rig import ROOT as LAB
from demo.rig import Config as Lab
from rehearsal import settings
from rehearsal.experiments.bench import Bench
from rehearsal.experiments.follow import follow
from rehearsal.experiments.grasp import grasp
from rehearsal.experiments.handle import handle
from rehearsal.experiments.reach import reach
from rehearsal.experiments.report import draw, table
from rehearsal.experiments.result import append_result, read_results
from rehearsal.package import read_package
from trunkline.pipeline.config import PROJECT, load_config, load_folder
from trunkline.teleop.config import Config

EXPERIMENTS = {"reach": reach, "follow": follow, "grasp": grasp, "handle": handle}


def main() -> None:
    parser = argparse.ArgumentParser(description=(__doc__ or "").partition("\n")[0])
    parser.add_argument("--only", choices=sorted(EXPERIMENTS))
    parser.add_argument("--runs", type=int, default=20, help="of each experiment, seeds 0, 1, ...")
    parser.add_argument("--package", type=Path, default=None)
    parser.add_argument("--out", type=Path, default=Path("artifacts/rehearse"))
    given = parser.parse_args()
    file = given.package or next(iter(sorted(Path("artifacts/package_unity").glob("*.tgz"))), Path("none"))
    package = read_package(file)
    arm = plant_of(load_config(Lab, "record", LAB))
    assert isinstance(arm, Stranger)
    config = load_folder(Config, PROJECT / "conf/teleop")
    bench = Bench(package, config, arm, settings.stand_in(), settings.person(), settings.free())
    runs = given.out / "runs.csv"
    for name in [given.only] if given.only else EXPERIMENTS:
        made = {(result.experiment, result.seed, result.package) for result in read_results(runs)}
        for seed in range(given.runs):
            if (name, seed, package.digest[:12]) in made:
                continue
            began = time.process_time()
            result, _ = EXPERIMENTS[name](bench, seed)
            append_result(runs, result)
            told = "success" if result.success else result.cause
            print(f"{name} {seed}: {told}; {time.process_time() - began:.0f} s of processor", flush=True)
    results = [result for result in read_results(runs) if result.package == package.digest[:12]]
    print(table(results))
    draw(results, given.out / "rehearsal.png")


if __name__ == "__main__":
    main()
