"""The shape in which an arm comes to rest after it was let go: what its springs hold when nothing pulls."""

import mujoco
import numpy as np

from trunkline.arm.rest import RestShape, rest_shape
from trunkline.errors import InputError
from trunkline.identification.experiment import Experiment
from trunkline.identification.pose_fit import fit_pose

LAST = 0.5  # s at the end of a release in which it has to be at rest
SAME_GRAVITY = 0.5  # m/s², 3° of tilt
STILL = 2e-3  # m, of every coordinate's range in that time


def resting_shape(model: mujoco.MjModel, experiments: list[Experiment], segments: tuple[str, ...]) -> RestShape:
    """The mean shape at the ends of the releases to identify from; those that still move have no say.

    Raises:
        InputError: none comes to rest.
    """
    shapes, gravities = [], []
    for experiment in experiments:
        if experiment.kind != "release" or experiment.split != "identify":
            continue
        last = slice(-max(round(LAST / experiment.frame_step), 1), None)
        positions = np.where(experiment.measured[last, :, None], experiment.positions[last], np.nan)
        if not experiment.measured[last].any(axis=0).all():
            continue
        if (np.nanmax(positions, axis=0) - np.nanmin(positions, axis=0)).max() < STILL:
            shapes.append(np.nanmean(positions, axis=0))
            gravities.append(experiment.gravity)
    if not shapes:
        found = f"found no release with split identify that is at rest in its last {LAST:g} s"
        raise InputError(f"rest_shape: {found}, expected at least one, or rest_shape: unchanged")
    if np.ptp(gravities, axis=0).max() > SAME_GRAVITY:
        found = "found releases under different gravity angles"
        raise InputError(f"rest_shape: {found}, expected the same for all, or rest_shape: unchanged")
    pose = fit_pose(model, segments, np.mean(shapes, axis=0)).qpos
    return rest_shape(model, pose, np.mean(gravities, axis=0))
