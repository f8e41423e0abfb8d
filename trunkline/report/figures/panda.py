"""The Panda as the maps' pictures show it: a line along its links."""

import numpy as np

from trunkline.kinematics.panda.inverse import solve
from trunkline.kinematics.panda.kinematics import DH_A, FLANGE, joint_frames

POSE = (0.45, 0.0, 0.55)  # m, where the drawn Panda holds the mount


def panda_line(mount_offset: float, avoid_collisions: bool) -> np.ndarray:
    """Polyline (P, 3) in m along the links of a Panda that holds the mount at `POSE`, pointing down."""
    solution = solve(np.array([POSE]), seed=1, starts=200, mount_offset=mount_offset, avoid_collisions=avoid_collisions)
    frames = joint_frames(solution.q)
    shoulder, elbow, wrist, hand = (frames[i].p[:, 0] for i in (0, 3, 5, 6))
    upper_end = frames[2].p[:, 0]
    forearm_start = elbow + DH_A[4] * frames[3].x[:, 0]
    mount = hand + (FLANGE + mount_offset) * frames[6].z[:, 0]
    return np.array([[0, 0, 0], shoulder, upper_end, elbow, forearm_start, wrist, hand, mount])
