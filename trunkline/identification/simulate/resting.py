"""The shape in which an arm comes to rest after it was let go, and spring references that hold it there."""

from dataclasses import dataclass

import mujoco
import numpy as np
from scipy.optimize import newton

from trunkline.errors import InputError
from trunkline.identification.parameters.joints import follow_rest
from trunkline.identification.parameters.parameter import Fields
from trunkline.identification.simulate.experiment import Experiment
from trunkline.identification.simulate.pose_fit import fit_pose
from trunkline.model.arm_model import HINGE_SHARE, ArmModel
from trunkline.recordings.trials.experiments import EXPERIMENTS
from trunkline.recordings.trials.splits import IDENTIFY

LAST = 0.5  # s at the end of a release in which it has to be at rest
SAME_GRAVITY = 0.5  # m/s², 3° of tilt
BEND_TOLERANCE = 1e-12  # rad, of a joint's bend under its load
STILL = 2e-3  # m, of every coordinate's range in that time


@dataclass(frozen=True)
class RestShape:
    """A shape at rest under gravity.

    pose: angles of the arm's hinges, rad. Shape (n,). load: torque that gravity puts on each spring there, N m.
    Shape (n,).
    """

    pose: np.ndarray
    load: np.ndarray


def rest_shape(model: mujoco.MjModel, pose: np.ndarray, gravity: np.ndarray) -> RestShape:
    """The shape `pose` (n,) of an arm without pull, and what its springs bear there under `gravity` (3,) m/s²."""
    model = model.__copy__()
    model.opt.gravity[:] = gravity
    data = mujoco.MjData(model)
    data.qpos[: len(pose)] = pose
    mujoco.mj_forward(model, data)
    return RestShape(np.array(pose), -data.qfrc_bias[: len(pose)])


def hang_in(fields: Fields, model: mujoco.MjModel, rest: RestShape) -> None:
    """Let the springs of each candidate be slack where it then rests in `rest`, in place."""
    fields["qpos_spring"] = spring_references(fields, model, rest)
    follow_rest(fields, model)


def spring_references(fields: Fields, model: mujoco.MjModel, rest: RestShape) -> np.ndarray:
    """Joint angles q_0 at which each candidate's springs are slack, so that it rests in `rest`. Shape (C, nq).

    The torque of a spring is -(a x + b x² + c x³), x = q - q_0. At rest it balances the load, which bends it by x:
    the stiffer the arm, the less of its shape comes from gravity. A round joint bends to where its load points, by as
    much as both its hinges together. Fields that `fields` lacks are the model's. NaN where no bend balances the load.
    """
    springs = {name: getattr(model, name)[None] for name in ("jnt_stiffness", "jnt_stiffnesspoly")} | fields
    arm = len(rest.pose)  # hinges; those of Maxwell branches come after them and have no springs
    poly = springs["jnt_stiffnesspoly"][:, :arm]
    load, share = rest.load, 1.0
    if diagonals := ArmModel(model).diagonals:
        share, pairs = HINGE_SHARE, diagonals[0].hinge[:, None] + np.arange(2)
        load = np.zeros(arm)
        load[pairs] = np.linalg.norm(rest.load[pairs], axis=1)[:, None]
    a, b, c, load = np.broadcast_arrays(springs["jnt_stiffness"][:, :arm], poly[..., 0], poly[..., 1] / share, load)
    bend, settled, _ = newton(
        lambda x: x * (a + x * (b + x * c)) - load,
        load / a,
        lambda x: a + x * (2 * b + 3 * x * c),
        tol=BEND_TOLERANCE,
        full_output=True,
    )
    references = np.repeat(model.qpos_spring[None], len(bend), axis=0)
    toward = rest.load / np.where(load > 0, load, 1.0)  # 1 or -1, or of a round joint its share of the whole
    references[:, :arm] = rest.pose - np.where(settled, bend * np.where(share < 1, toward, 1.0), np.nan)
    return references


def resting_shape(model: mujoco.MjModel, experiments: list[Experiment], markers: tuple[str, ...]) -> RestShape:
    """The mean shape at the ends of the releases to identify from; those that still move have no say.

    Raises:
        InputError: none comes to rest.
    """
    shapes, gravities = [], []
    for experiment in experiments:
        if not EXPERIMENTS[experiment.kind].hangs or experiment.split != IDENTIFY or experiment.load:
            continue
        last = slice(-max(round(LAST / experiment.frame_step), 1), None)
        positions = np.where(experiment.measured[last, :, None], experiment.positions[last], np.nan)
        if not experiment.measured[last].any(axis=0).all():
            continue
        if (np.nanmax(positions, axis=0) - np.nanmin(positions, axis=0)).max() < STILL:
            shapes.append(np.nanmean(positions, axis=0))
            gravities.append(experiment.gravity)
    if not shapes:
        reason = f"found no release with split identify that is at rest in its last {LAST:g} s"
        raise InputError(f"rest_shape: {reason}, expected at least one, or rest_shape: unchanged")
    if np.ptp(gravities, axis=0).max() > SAME_GRAVITY:
        reason = "found releases under different gravity angles"
        raise InputError(f"rest_shape: {reason}, expected the same for all, or rest_shape: unchanged")
    pose = fit_pose(model, markers, np.mean(shapes, axis=0)).qpos
    return rest_shape(model, pose, np.mean(gravities, axis=0))
