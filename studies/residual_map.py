"""What poses that a lab records are worth: `python -m studies.residual_map`

The lab's arm is sent commands that are drawn as `train_ik` draws them, with another seed, and moves by itself until its
cameras see it rest (`qualification/seen.py`). From some of these poses a certificate learns how far the tip rests
beside the twin's; the others, which nothing has learnt from, say how near it then is, and how often it is within the
radius that the certificate states. Beside it: nothing learnt, and learnt from the static trials of the session. Takes
some ten minutes.
"""

import argparse
import sys
from pathlib import Path

import numpy as np

from qualification.seen import MODEL, NOISE, DrawnPoses, everyone
from studies.stage_chain import require_demo
from trunkline.errors import in_one_line
from trunkline.identification.evaluation.evaluation import replay
from trunkline.kinematics.ik.inputs import gravity_of
from trunkline.recordings.trials.conditions import conditions_of
from trunkline.recordings.trials.experiments import is_static
from trunkline.recordings.trials.splits import DECIDING, IDENTIFY
from trunkline.recordings.trials.trial import read_trials
from trunkline.report.certificate.arms import arm_of
from trunkline.report.certificate.budget import Budget, Inputs, budget, held_out, left_by_map
from trunkline.report.certificate.coverage import is_inside
from trunkline.report.certificate.held_out import learnt_from, tip_residuals
from trunkline.report.certificate.poses import StaticPoses, posed
from trunkline.twin.twin import Twin
from upkeep.results import recorded

TRIALS = Path("data/processed/filter")
SEED, POSES, HELD_OUT = 49_001, 300, 100
OTHERS = slice(-HELD_OUT, None)
ARMS, EACH = 60, 40  # draws of the parameters, and of everything else with each
SIZES, SETS = (15, 30, 60, 100, 200), 5


class Recorded:
    """Poses of the lab's arm: in the frame of the twin's mount, and by how far the tip rests beside the twin's, m (N,
    3). within: whether their pulls add up to no more than in the session. Shape (N,)."""

    def __init__(self, count: int, rng: np.random.Generator) -> None:
        self.twin = Twin.load(MODEL)
        drawn, arm = DrawnPoses(count, rng), arm_of(self.twin.arm.model)
        tips = np.array(everyone("poses", lambda *pose: drawn.brought(*pose)[1], count))
        poses = StaticPoses(gravity_of(drawn.targets) @ arm.turn.T, drawn.commands)
        self.residuals = (tips - arm.tips(poses)) @ arm.turn
        rested = np.isfinite(self.residuals).all(axis=1)
        self.poses, self.residuals = poses[rested], self.residuals[rested]
        self.trials = read_trials(TRIALS, DECIDING)
        pulls = np.maximum(arm.chain.straight_lengths - self.poses.commands, 0).sum(axis=1)
        self.within = pulls <= conditions_of(self.trials).pulls

    def session(self) -> tuple[StaticPoses, np.ndarray]:
        """Poses and residuals of the static trials that the stages fitted."""
        model = self.twin.arm.model
        trials = [t for t in self.trials if t.split == IDENTIFY and is_static(t.experiment) and not t.load]
        residuals = tip_residuals(model, trials, replay(model, [], trials[0].markers).tip)
        usable = np.isfinite(residuals).all(axis=1)
        return posed(trials, model)[usable], residuals[usable]

    def stated(self, poses: StaticPoses, residuals: np.ndarray, learn: bool = True) -> Budget:
        """Tips and radii that a certificate states of the others, had these poses been held out."""
        model, posterior, rng = self.twin.arm.model, self.twin.posterior, np.random.default_rng(SEED)
        learnt, missed = learnt_from(model, poses, residuals) if learn else (None, residuals)
        lacking = held_out(model, posterior, NOISE, poses, np.linalg.norm(residuals, axis=1), ARMS, rng)
        left = learnt and left_by_map(arm_of(model), NOISE, poses, np.linalg.norm(missed, axis=1))
        inputs = Inputs(model, posterior, lacking, NOISE, learnt, left)
        return budget(inputs, self.poses[OTHERS], ARMS, EACH, rng)


def measure() -> None:
    rng = np.random.default_rng(SEED)
    recorded_poses = Recorded(POSES, rng)
    others = recorded_poses.poses[OTHERS]
    arm = arm_of(recorded_poses.twin.arm.model)
    tips = arm.tips(others) + recorded_poses.residuals[OTHERS] @ arm.turn.T
    learnt, within = np.arange(len(recorded_poses.poses) - HELD_OUT), recorded_poses.within[OTHERS]

    print("| learnt from | tip, mm: median / 95 % | within the session's pulls | in the 95 % radius | its length |")
    print("|---|---:|---:|---:|---:|")
    poses, residuals = recorded_poses.session()
    for name, learn in (("nothing; radius by the session's", False), ("the session's", True)):
        stated = [recorded_poses.stated(poses, residuals, learn)]
        print(row(f"{name} {len(poses)} static trials", tips, stated, within))
    for size in SIZES:
        sets = [rng.permutation(learnt)[:size] for _ in range(SETS if 2 * size < len(learnt) else 1)]
        stated = [recorded_poses.stated(recorded_poses.poses[rows], recorded_poses.residuals[rows]) for rows in sets]
        print(row(f"{size} poses" + (f", {len(sets)} sets" if len(sets) > 1 else ""), tips, stated, within))
    print(f"\n{len(others)} other poses; in {within.sum()} motors pull by no more than in the session.")


def row(name: str, tips: np.ndarray, stated: list[Budget], within: np.ndarray) -> str:
    """Of the table: tips (N, 3), m, beside what each of some certificates states of them."""
    left = 1e3 * np.concatenate([np.linalg.norm(tips - each.tips, axis=1) for each in stated])
    both = [" / ".join(f"{np.nanquantile(part, q):.1f}" for q in (0.5, 0.95))
            for part in (left, left[np.tile(within, len(stated))])]  # fmt: skip
    share = np.mean([is_inside(tips, each).mean() for each in stated])
    radius = np.median([np.median(each.radius) for each in stated])
    return f"| {name} | {' | '.join(both)} | {100 * share:.0f} % | {1e3 * radius:.1f} |"


@in_one_line
def main() -> int:
    argparse.ArgumentParser(prog="studies.residual_map", description=__doc__).parse_args()
    require_demo(MODEL)
    with recorded("residual_map"):
        measure()
    return 0


if __name__ == "__main__":
    sys.exit(main())
