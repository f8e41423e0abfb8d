"""How often the true tip lies inside the radius that the certificate states: `python -m studies.certificate`

The stand-in lab's arm is brought to poses that no trial of its session has, within what the certificate says it is for,
as slowly as in the session's pulls, half of them from straight and half from beyond, and left to creep to rest. Where
its tip then is, the lab knows; it is held against the twin's tip and the radius that the certificate has for that pose.
Poses that are done are kept in docs/results/certificate.csv, as they take half an hour; the budget is made anew.
"""

import argparse
import json
import sys
from contextlib import redirect_stdout
from pathlib import Path

import numpy as np

from demo.rig import ROOT, bring
from stages.report import ARTIFACTS, TRIALS
from stages.report import Config as Report
from studies.rows import Rows, digest
from trunkline.errors import in_one_line
from trunkline.model.statics.chain import read_chain
from trunkline.pipeline.config import load_config
from trunkline.recordings.trials.conditions import conditions_of
from trunkline.recordings.trials.splits import DECIDING
from trunkline.recordings.trials.trial import read_trials
from trunkline.report.certificate.budget import Budget, budget
from trunkline.report.certificate.certificate import inputs_of
from trunkline.report.certificate.coverage import is_inside, pulls_of
from trunkline.report.certificate.poses import draw_poses
from trunkline.twin.twin import Twin

COUNT, SEED, BATCH = 500, 20, 20


def told_lines(tips: np.ndarray, found: Budget, loose: np.ndarray, back: np.ndarray) -> list[str]:
    """A table of how often the tips (N, 3), m, lie inside, over all poses and over kinds of them."""
    off, inside = np.linalg.norm(tips - found.tips, axis=1), is_inside(tips, found)
    lines = ["| poses | inside | of | radius, median | distance: median / 95th percentile | largest, in radii |"]
    lines.append("|---|---:|---:|---:|---:|---:|")
    kinds = {"all": np.ones(len(off), bool), "pulled, from straight": ~loose & ~back}
    for words, chosen in (kinds | {"pulled, from beyond": ~loose & back, "no pull, tilted": loose}).items():
        own, radius = off[chosen], found.radius[chosen]
        cells = [f"{100 * np.mean(inside[chosen]):.1f} %", str(chosen.sum()), f"{1e3 * np.median(radius):.1f} mm"]
        cells.append(f"{1e3 * np.median(own):.1f} / {1e3 * np.quantile(own, 0.95):.1f} mm")
        lines.append(f"| {words} | {' | '.join(cells)} | {np.max(own / radius):.1f} |")
    return lines


@in_one_line
def main() -> int:
    parser = argparse.ArgumentParser(prog="studies.certificate", description=__doc__)
    parser.add_argument("--poses", type=int, default=COUNT, help=f"stop after so many of {COUNT}")
    arguments = parser.parse_args()
    twin, trials = Twin.load(ARTIFACTS), read_trials(TRIALS, DECIDING)
    chain, conditions = read_chain(twin.arm.model), conditions_of(trials)
    rng = np.random.default_rng(SEED)
    poses = draw_poses(chain, conditions, COUNT, rng)
    pulls, back = pulls_of(chain, poses), rng.random(COUNT) < 0.5
    lab = [*sorted(Path("demo/plants").glob("*.py")), ROOT / "conf"]
    rows = Rows("certificate", digest((SEED, conditions), *lab), "pose")
    with redirect_stdout(sys.stderr):
        for first in range(len(rows.read()), arguments.poses, BATCH):
            chosen = slice(first, min(first + BATCH, arguments.poses))
            tips = bring(pulls[chosen], poses.gravity[chosen], back[chosen])
            for index, place in enumerate(tips.tolist(), start=first):
                rows.add(str(index), **dict(zip("xyz", place, strict=True)))
    config = load_config(Report, "report")
    ingested = json.loads((ARTIFACTS / "ingest/metrics.json").read_text())
    kept = list(rows.read().values())
    with rows.recorded(len(kept) == COUNT):
        draws = np.random.default_rng(config.seed)
        inputs = inputs_of(twin, trials, ingested, config.arms, draws)
        found = budget(inputs, poses[: len(kept)], config.arms, config.each, draws)
        tips = np.array([[float(row[axis]) for axis in "xyz"] for row in kept])
        loose = np.max(pulls[: len(kept)], axis=1) <= 0
        print("\n".join(told_lines(tips, found, loose, back[: len(kept)])))
    return 0


if __name__ == "__main__":
    sys.exit(main())
