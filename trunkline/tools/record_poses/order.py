"""The order in which poses are recorded: mounts are moved as seldom as possible, and all moves are short."""

import numpy as np

from trunkline.tools.record_poses.draw import Mounts, PosesToRecord


def ordered(poses: PosesToRecord, mounts: Mounts) -> np.ndarray:
    """Rows of `poses`: those of a mount together, mounts from the nearest to the one that is not tilted on, and the
    poses of each from the one with the nearest pulls to those before on, at first from loose cables. Shape (N,)."""
    places, which = np.unique(poses.mounts, axis=0, return_inverse=True)
    pulls, last = np.maximum(poses.pulls, 0), np.zeros(poses.pulls.shape[1])
    rows: list[int] = []
    for mount in short_way(mounts.gravity(places), mounts.gravity(np.zeros((1, 2)))[0]):
        there = np.flatnonzero(which.reshape(-1) == mount)
        rows += there[short_way(pulls[there], last)].tolist()
        last = pulls[rows[-1]]
    return np.array(rows)


def short_way(points: np.ndarray, begin: np.ndarray) -> list[int]:
    """Through all `points` (N, D) from `begin` (D,), each time to the nearest that is left."""
    left, way = list(range(len(points))), []
    while left:
        distances = np.linalg.norm(points[left] - begin, axis=1)
        way.append(left.pop(int(np.argmin(distances))))
        begin = points[way[-1]]
    return way
