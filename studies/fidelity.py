"""How true previews were: `python -m studies.fidelity`

Of the runs that `dvc repro rehearsal/dvc.yaml` made and that were previewed, by experiment: how often preview and
execution agree, the Brier score of the stated probabilities beside that of always saying the base rate, and the median
difference of the tips' paths. A Markdown table. Draws the reliability diagram into artifacts/rehearse/.
"""

import sys

import numpy as np

from rehearsal.experiments.calibration import base_brier, brier, draw_reliability, stated
from rehearsal.experiments.result import Result, read_results
from rehearsal.rehearse import OUT
from trunkline.errors import existing, in_one_line
from upkeep.results import recorded


def row(name: str, results: list[Result]) -> str:
    probability, outcome = stated(results)
    agreed = np.mean([result.agreed for result in results if np.isfinite(result.agreed)])
    paths = [result.path_pct for result in results if np.isfinite(result.path_pct)]
    scores = f"{brier(probability, outcome):.3f} | {base_brier(outcome):.3f}"
    return f"| {name} | {len(outcome)} | {100 * agreed:.0f} % | {scores} | {np.median(paths):.2g} % |"


@in_one_line
def main() -> int:
    results = [one for one in read_results(existing(OUT / "runs.csv")) if not one.variant]
    previewed = [one for one in results if np.isfinite(one.probability)]
    with recorded("fidelity"):
        print("| experiment | previews | came out so | Brier score | … of the base rate | paths apart, of length |")
        print("|---|---:|---:|---:|---:|---:|")
        for name in dict.fromkeys(one.experiment for one in previewed):
            print(row(name, [one for one in previewed if one.experiment == name]))
        print(row("all", previewed))
    draw_reliability(previewed, OUT / "reliability.png")
    return 0


if __name__ == "__main__":
    sys.exit(main())
