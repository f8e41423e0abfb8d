"""Self-collision of the Panda, with the capsules that its maker publishes.

Source: `franka_description/robots/panda_arm.xacro` in franka_ros (self-collision capsules) and the pairs
that the maker's MoveIt configuration does not rule out. Two simplifications keep the map round about joint 1:
the base's capsule, which points backwards, is a sphere that covers all but 18 mm of its back end, and the plug beside
the flange is left out, since joint 7 turns it out of the way without moving the mount.
"""

import numpy as np

from trunkline.kinematics.panda.kinematics import FLANGE, JointFrame, joint_frames

# link: capsules as (end, end, radius) in m, in the frame of the joint that moves the link (0: base).
CAPSULES = {
    0: [((0.0, 0.0, 0.0), (0.0, 0.0, 0.0), 0.15)],
    1: [((0.0, 0.0, -0.333), (0.0, 0.0, -0.05), 0.06)],
    2: [((0.0, 0.0, -0.06), (0.0, 0.0, 0.06), 0.06)],
    5: [((0.0, 0.0, -0.31), (0.0, 0.0, -0.21), 0.06), ((0.0, 0.08, -0.20), (0.0, 0.08, -0.06), 0.025)],
    6: [((0.0, 0.0, -0.07), (0.0, 0.0, 0.01), 0.05)],
    7: [((0.0, 0.0, -0.06), (0.0, 0.0, 0.08), 0.04)],
}
PAIRS = [(0, 5), (0, 6), (0, 7), (1, 5), (1, 6), (1, 7), (2, 5), (2, 7)]
MOUNT_RADIUS = 0.04  # m, half the soft arm's base width; the adapter between flange and mount is as wide
CHUNK = 1 << 14  # poses at a time, so that the arrays stay in the processor's cache


def clearance(q: np.ndarray, mount_offset: float = 0.0) -> np.ndarray:
    """Smallest gap between links that could touch, in m; negative when they overlap.

    Args:
        q: joint angles in rad, (N, 7).
        mount_offset: from the flange to the mount along the flange's z, in m; the adapter counts as link 7.

    Returns:
        (N,). Independent of the first and the last joint.
    """
    q = np.asarray(q, dtype=float)
    gaps = [_clearance(joint_frames(q[i:i + CHUNK]), mount_offset) for i in range(0, len(q), CHUNK)]
    return np.concatenate(gaps) if gaps else np.zeros(0)


def link_capsules(mount_offset: float) -> dict[int, list]:
    """`CAPSULES` with link 7 made longer by the adapter to the mount."""
    adapter = ((0.0, 0.0, -0.06), (0.0, 0.0, max(0.08, FLANGE + mount_offset - MOUNT_RADIUS)), MOUNT_RADIUS)
    return CAPSULES | {7: [adapter]}


def _clearance(frames: list[JointFrame], mount_offset: float) -> np.ndarray:
    capsules = {
        link: [(_point(frames, link, start), _point(frames, link, end), radius) for start, end, radius in parts]
        for link, parts in link_capsules(mount_offset).items()
    }
    gap = np.full(frames[-1].p.shape[1], np.inf)
    for first, second in PAIRS:
        for a_start, a_end, a_radius in capsules[first]:
            for b_start, b_end, b_radius in capsules[second]:
                distance = segment_distance(a_start, a_end, b_start, b_end)
                np.minimum(gap, distance - a_radius - b_radius, out=gap)
    return gap


def _point(frames: list[JointFrame], link: int, local: tuple[float, float, float]) -> np.ndarray:
    if link == 0:
        return np.array(local)[:, None]
    x, y, z, p = frames[link - 1]
    return p + local[0] * x + local[1] * y + local[2] * z


def segment_distance(a_start: np.ndarray, a_end: np.ndarray, b_start: np.ndarray, b_end: np.ndarray) -> np.ndarray:
    """Distance between segments a and b, ends (3, N) in m. Shape (N,).

    Source: Ericson, Real-Time Collision Detection, section 5.1.9.
    """
    u, v, w = a_end - a_start, b_end - b_start, a_start - b_start
    uu, vv, uv = _dot(u, u), _dot(v, v), _dot(u, v)
    uw, vw = _dot(u, w), _dot(v, w)
    tiny = 1e-12
    s = np.clip((uv * vw - uw * vv) / np.maximum(uu * vv - uv * uv, tiny), 0.0, 1.0)
    t = (uv * s + vw) / np.maximum(vv, tiny)
    t = np.clip(t, 0.0, 1.0)
    s = np.clip((uv * t - uw) / np.maximum(uu, tiny), 0.0, 1.0)
    gap = w + s * u - t * v
    return np.sqrt(_dot(gap, gap))


def _dot(a: np.ndarray, b: np.ndarray) -> np.ndarray:
    return a[0] * b[0] + a[1] * b[1] + a[2] * b[2]
