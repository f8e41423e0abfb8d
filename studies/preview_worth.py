"""What previews are worth, and how often the radius that they state holds: `python -m studies.preview_worth`

Rehearses more than the committed metrics do (rehearsal/params.yaml): 200 reaches, and the same grasps with the batch
of futures, with the nominal future alone, and confirmed whatever their preview shows. Of the seeds whose first plan
the operator declines, the last line says how many succeed with that plan confirmed nevertheless.

A row is kept in docs/results/preview_worth.csv when its run ends; stopped, the study goes on from there. Runs of the
rehearsal (artifacts/rehearse/runs.csv) that are of the same code and package are taken as they are.
"""

import argparse
import sys
from collections.abc import Iterable
from contextlib import redirect_stdout
from pathlib import Path

import numpy as np

from rehearsal.experiments.result import LATER, Result, share_of, summary
from rehearsal.experiments.stated import scores
from rehearsal.rehearse import OUT, TABLE
from rehearsal.runs import Run, make, source_of, wanted
from trunkline.ar.preview.package import only_package
from trunkline.compute.threads import thread_count
from trunkline.errors import in_one_line
from trunkline.settings import read_yaml
from upkeep.rehearsal_table import rehearsal_table
from upkeep.results import FOLDER, recorded

RUNS = {"reach": 200, "grasp": 34}
CONFIRMED = "no_preview"
ABLATED = ("single", CONFIRMED)  # rehearsal/experiments/ablations.py
TIMES = dict(zip(LATER, ("at the end", "2 s later", "10 s later"), strict=True))


def coverage_table(groups: dict[str, list[Result]]) -> str:
    """How often the tip was within the stated radius, a row for each group of reaches and each time."""
    lines = ["| reaches | time | tips within the radius | share | 95 % interval | radius, mm: median / 95th percentile "
             "| tip's distance, mm: median / 95th percentile |", "|---|---|---:|---:|---:|---:|---:|"]  # fmt: skip
    for words, rows in groups.items():
        stated = scores(rows)
        radius = " / ".join(f"{stated['radius_mm'][name]:.3g}" for name in ("median", "p95"))
        for time, when in TIMES.items():
            of = stated["coverage"][time]
            off = np.array([getattr(row, f"{time}_mm") for row in rows])
            distance = " / ".join(f"{value:.3g}" for value in np.nanquantile(off, (0.5, 0.95)))
            share, interval = f"{100 * of['share']:.1f} %", f"{100 * of['low']:.1f} to {100 * of['high']:.1f} %"
            counts = f"{of['inside']} of {of['runs']}"
            lines.append(f"| {words} | {when} | {counts} | {share} | {interval} | {radius} | {distance} |")
    return "\n".join(lines)


def declined_line(grasps: Iterable[Result]) -> str:
    """What becomes of first plans that the operator of the batch declines, where they are confirmed."""
    rows = {(row.variant, row.seed): row for row in grasps}
    declined = [seed for (variant, seed), row in rows.items() if not variant and row.plans > 1]
    if not declined:
        return "No first plan of a grasp was declined."
    successes, _, low, high = share_of([rows[CONFIRMED, seed].success for seed in declined])
    return (
        f"First plans of grasps that the operator declined: {len(declined)}; confirmed nevertheless, "
        f"{successes} of them succeeded ({100 * low:.0f} to {100 * high:.0f} %)."
    )


@in_one_line
def main() -> int:
    argparse.ArgumentParser(prog="studies.preview_worth", description=__doc__).parse_args()
    package = only_package()
    source, table = source_of(package), FOLDER / "preview_worth.csv"
    runs = wanted(RUNS, 0) + [Run("grasp", seed, name) for name in ABLATED for seed in range(RUNS["grasp"])]
    committed = read_yaml(Path("rehearsal/params.yaml")).rehearse.runs.reach
    with recorded("preview_worth"):
        with redirect_stdout(sys.stderr):  # each run as it ends
            results = make(runs, package, source, table, thread_count(), [OUT / TABLE])
        reaches = [row for row in results if row.experiment == "reach"]
        new = [row for row in reaches if row.seed >= committed]
        print(coverage_table({"all": reaches, f"those beyond the committed seeds, from {committed} on": new}))
        print(rehearsal_table(summary(results), {}, "study of previews", variants=True))
        print(declined_line(row for row in results if row.experiment == "grasp"))
    return 0


if __name__ == "__main__":
    sys.exit(main())
