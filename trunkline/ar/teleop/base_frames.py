"""The frame in which the arm's statics are: its base, as the Panda holds it."""

import numpy as np

from trunkline.kinematics.panda.kinematics import mount_pose


def base_frames(joints: np.ndarray, mount_offset: float) -> tuple[np.ndarray, np.ndarray]:
    """Origins (..., 3), m, and rotations (..., 3, 3) of the arm's base frame in the robot's, at `joints` (..., 7), rad:
    its y and z are opposite to the flange's."""
    places, flanges = mount_pose(joints.reshape(-1, joints.shape[-1]), mount_offset)
    rotations = flanges @ np.diag([1.0, -1.0, -1.0])
    return places.reshape(*joints.shape[:-1], 3), rotations.reshape(*joints.shape[:-1], 3, 3)
