"""What poses that a lab records are worth: `python -m studies.residual_map`

The lab's arm is sent commands that are drawn as `train_ik` draws them, with another seed, and moves by itself until its
cameras see it rest (`qualification/seen.py`). From some of these poses `trunkline/kinematics/residual` learns how far
the tip rests beside the twin's; the others, which nothing has learnt from, say how near it then is, and how often it
is within the radius of 90 %. Beside it: nothing learnt, and learnt from the static trials that the session has anyway.
Takes some ten minutes.
"""

import argparse
import sys
from pathlib import Path

import numpy as np

from qualification.seen import MODEL, DrawnPoses, everyone
from studies.stage_chain import require_demo
from trunkline.errors import in_one_line
from trunkline.kinematics.ik.inputs import gravity_of, position_of
from trunkline.kinematics.residual.residual_map import ResidualMap, RestingPoses
from trunkline.model_files import read_model
from trunkline.recordings.trials.conditions import conditions_of
from trunkline.recordings.trials.experiments import is_static
from trunkline.recordings.trials.splits import DECIDING, IDENTIFY
from trunkline.recordings.trials.trial import read_trials
from trunkline.report.certificate.arms import arm_of
from trunkline.report.certificate.poses import posed
from upkeep.results import recorded

TRIALS = Path("data/processed/filter")
SEED, POSES, HELD_OUT = 49_001, 300, 100
SIZES, SETS = (15, 30, 60, 100, 200), 5
SHARE = 0.9


def measure() -> None:
    rng = np.random.default_rng(SEED)
    drawn = DrawnPoses(POSES, rng)
    model, chain, (origin, turn), targets = read_model(MODEL), drawn.chain, drawn.frame, drawn.targets
    tips = (np.array(everyone("poses", lambda *pose: drawn.brought(*pose)[1], POSES)) - origin) @ turn
    residuals = tips - position_of(targets)
    rested = np.isfinite(residuals).all(axis=1)
    poses = RestingPoses((chain.straight_lengths - drawn.commands)[rested], gravity_of(targets)[rested])
    residuals = residuals[rested]
    trials = read_trials(TRIALS, DECIDING)
    within = np.maximum(poses.pulls, 0).sum(axis=1) <= conditions_of(trials).pulls
    learnt, others = np.arange(len(poses) - HELD_OUT), slice(len(poses) - HELD_OUT, None)

    print("| learnt from | tip, mm: median / 95 % | within the session's pulls | in the 90 % radius | its length |")
    print("|---|---:|---:|---:|---:|")
    print(row("nothing", residuals[others], within[others]))
    resting = [t for t in trials if t.split == IDENTIFY and is_static(t.experiment) and not t.load]
    session = posed(resting, model)
    off = (np.array([trial.positions[-1, -1] for trial in resting]) - arm_of(model).tips(session)) @ turn
    usable = np.isfinite(off).all(axis=1) & np.array([trial.measured[-1, -1] for trial in resting])
    there = RestingPoses(chain.straight_lengths - session.commands, session.gravity @ turn)[usable]
    fitted, name = ResidualMap.fit(there, off[usable], chain.length), f"the session's {usable.sum()} static trials"
    print(learned([fitted], name, poses[others], residuals[others], within[others]))
    for size in SIZES:
        chosen = [rng.permutation(learnt)[:size] for _ in range(SETS if 2 * size < len(learnt) else 1)]
        maps = [ResidualMap.fit(poses[rows], residuals[rows], chain.length) for rows in chosen]
        name = f"{size} poses" + (f", {len(maps)} sets" if len(maps) > 1 else "")
        print(learned(maps, name, poses[others], residuals[others], within[others]))
    print(f"\n{HELD_OUT} other poses; in {within[others].sum()} motors pull by no more than in the session.")


def learned(maps: list[ResidualMap], name: str, poses: RestingPoses, residuals: np.ndarray, within: np.ndarray) -> str:
    """A row of the table, of several maps together."""
    left = np.concatenate([residuals - fitted.mean(poses) for fitted in maps])
    radius = np.concatenate([fitted.radius(poses, SHARE) for fitted in maps])
    share, worth = np.mean(np.linalg.norm(left, axis=1) <= radius), sum(fitted.is_worth_it for fitted in maps)
    name += "" if worth == len(maps) else f" (worth it by the poses it learnt from: {worth} of {len(maps)})"
    return row(name, left, np.tile(within, len(maps)), f"{100 * share:.0f} %", f"{1e3 * np.median(radius):.1f}")


def row(name: str, left: np.ndarray, within: np.ndarray, share: str = "–", radius: str = "–") -> str:
    lengths = 1e3 * np.linalg.norm(left, axis=1)
    both = [" / ".join(f"{np.quantile(part, q):.1f}" for q in (0.5, 0.95)) for part in (lengths, lengths[within])]
    return f"| {name} | {' | '.join(both)} | {share} | {radius} |"


@in_one_line
def main() -> int:
    argparse.ArgumentParser(prog="studies.residual_map", description=__doc__).parse_args()
    require_demo(MODEL)
    with recorded("residual_map"):
        measure()
    return 0


if __name__ == "__main__":
    sys.exit(main())
