"""What the user cares about, as a weight W: the expected loss is tr(W C), C the covariance of a stage's parameters.

`intervals`: W = I / P in u, the mean square deviation over the ranges, in which the widest intervals count most.
`tip`: W = mean of GᵀG over poses of the workspace, G = ∂tip/∂u from the statics: the mean square uncertainty of the tip
at rest. `grasp`: the same over poses in which the arm is wound up the most, in which it holds things.
"""

from typing import Literal

import mujoco
import numpy as np

from trunkline.identification.parameters.parameters import parameter_named
from trunkline.recordings.trials.conditions import Conditions
from trunkline.report.certificate.arms import arm_of, arms_with
from trunkline.report.certificate.poses import StaticPoses, draw_poses
from trunkline.tools.suggest.information import StageInformation
from trunkline.tools.suggest.settings import Recordable

Goal = Literal["intervals", "tip", "grasp"]
GOALS: tuple[Goal, ...] = ("intervals", "tip", "grasp")
POSES, SEED = 48, 1
COILED = 0.25  # share of the poses that are wound up the most
STEP = 1e-3  # in a parameter's own axis, for differences to both sides


def weights_for(
    goal: Goal, stages: list[StageInformation], model: mujoco.MjModel, grid: Recordable
) -> list[np.ndarray]:
    """W of each stage, 0 for a parameter that a later stage finds anew. Each (P, P)."""
    last = {name: stage.stage for stage in stages for name in stage.names}
    latest = [np.array([last[name] == stage.stage for name in stage.names], float) for stage in stages]
    if goal == "intervals":
        return [np.diag(counts) / len(last) for counts in latest]
    poses = workspace(model, grid)
    if goal == "grasp":
        poses = poses[_most_wound(model, poses)]
    weights = []
    for stage, counts in zip(stages, latest, strict=True):
        moves = tip_moves(model, stage.names, poses) * (stage.half * counts)[:, None, None]
        weights.append(np.einsum("ink,jnk->ij", moves, moves) / len(poses))
    return weights


def workspace(model: mujoco.MjModel, grid: Recordable) -> StaticPoses:
    """Poses at rest over all that the candidates go up to."""
    arm = arm_of(model)
    length = float(np.linalg.norm(arm.chain.offset, axis=1).sum() + np.linalg.norm(arm.chain.tip))
    pull, tilt = length * max(grid.pulls, default=0.0), max(grid.tilts_deg, default=0.0)
    pull = pull if model.nu else 0.0
    conditions = Conditions(tilt_deg=tilt, pulled_tilt_deg=tilt, pull=pull, pulls=1.5 * pull)
    return draw_poses(arm.chain, conditions, POSES, np.random.default_rng(SEED))


def tip_moves(model: mujoco.MjModel, names: list[str], poses: StaticPoses) -> np.ndarray:
    """∂tip/∂z by differences to both sides, m, 0 where an arm finds no rest. Shape (P, N, 3)."""
    count = len(names)
    axes = [parameter_named(name) for name in names]
    read = [axis.read(model) for axis in axes]
    missing = np.array([not axis.signed and value <= 0 for axis, value in zip(axes, read, strict=True)])
    z = np.array([axis.coordinate(1.0 if lacks else v) for axis, v, lacks in zip(axes, read, missing, strict=True)])
    moved = z + STEP * np.concatenate([np.eye(count), -np.eye(count)])
    values = {name: axes[i].value(moved[:, i]) for i, name in enumerate(names) if not missing[i]}
    if not values:
        return np.zeros((count, len(poses), 3))
    near = arm_of(model).rest(poses).qpos
    tips = np.array([arm.tips(poses, near) for arm in arms_with(model, values)])
    slopes = np.nan_to_num((tips[:count] - tips[count:]) / (2 * STEP))
    slopes[missing] = 0  # what the arm lacks moves nothing
    return slopes


def _most_wound(model: mujoco.MjModel, poses: StaticPoses) -> np.ndarray:
    """Numbers of the poses whose joints are bent the most in all."""
    arm = arm_of(model)
    angles = np.abs(arm.rest(poses).qpos).sum(axis=1)
    return np.argsort(-np.nan_to_num(angles))[: max(round(COILED * len(poses)), 1)]
