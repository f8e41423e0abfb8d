"""From touches to where the headset's frame stands in the robot's base: what is computed, without clock and sockets.

A touch is a dwell, not a press, which would jerk the hand. What is touched is a mark on the flange, whose place the
robot itself knows, so the touches want no ruler. `reference` is the headset's frame, y up; `base` the rigid robot's.
"""

from collections import deque
from dataclasses import dataclass, field
from typing import NamedTuple

import numpy as np
from scipy.spatial.transform import Rotation

from trunkline.ar.teleop.messages import Pose
from trunkline.errors import InputError
from trunkline.frames import rotation_from_wxyz, wxyz_from_rotation
from trunkline.kinematics.panda.kinematics import mount_pose

STILL, DWELL = 0.005, 0.5  # m/s below which a tip is still, s for which it must be
MARK_STILL = 0.001  # m by which the flange may move meanwhile
WHOLE = 0.95  # share of DWELL that frames must span
POSES = 120  # of a tip that rests
TURN = np.radians(8.0)  # root mean square by which the poses must differ from their mean, about every axis
TIP_MOVED = 0.002  # m, root mean square by which a tip that rests may miss its place
FEWEST = 4  # touches, of which one may be left out
FLAT = 0.03  # m, root mean square by which touches must leave the plane that is nearest to them
BAD = 0.006  # m by which a touch that is wrong misses where the others have it


class Tip(NamedTuple):
    """`place` of the tip in the controller's frame, m (3,), and by how much it missed its `dent`, rms, m."""

    place: np.ndarray
    dent: np.ndarray
    missed: float


def tip_of(positions: np.ndarray, quaternions: np.ndarray) -> Tip:
    """The tip of a controller that is turned about it, by least squares: R_i t + p_i = c for all i.

    Args:
        positions: of the controller, m (N, 3). quaternions: w first (N, 4).

    Raises:
        InputError: too few poses, too little turn, or a tip that moved.
    """
    count = len(positions)
    if count < POSES:
        raise InputError(f"tip: found {count} poses, expected {POSES}")
    turns = rotation_from_wxyz(quaternions).as_matrix()
    turned = np.linalg.svd((turns - turns.mean(axis=0)).reshape(-1, 3), compute_uv=False)[-1] / np.sqrt(count)
    if turned < TURN:
        turn_deg, expected = np.degrees([turned, TURN])
        raise InputError(f"tip: found {turn_deg:.1f}° of turn about one axis, expected {expected:.0f}° about each")
    rows = np.concatenate([turns, np.tile(-np.eye(3), (count, 1, 1))], axis=2).reshape(-1, 6)
    solution = np.linalg.lstsq(rows, -positions.ravel(), rcond=None)[0]
    missed = float(np.sqrt(np.mean(np.sum((rows @ solution + positions.ravel()).reshape(-1, 3) ** 2, axis=1))))
    if missed > TIP_MOVED:
        raise InputError(f"tip: it moved by {1e3 * missed:.1f} mm, expected at most {1e3 * TIP_MOVED:.0f} mm")
    return Tip(solution[:3], solution[3:], missed)


@dataclass
class Dwell:
    """Whether a tip rests, on a flange that rests: `hear` gives the mean of the last DWELL s once they do, and then not
    again until the tip has moved."""

    _samples: deque[tuple[float, np.ndarray, np.ndarray]] = field(default_factory=deque)
    _done: bool = False

    def hear(self, time: float, point: np.ndarray | None, mark: np.ndarray | None) -> np.ndarray | None:
        """At `time`, s, the tip is at `point`, m (3,), None where it is not known; the flange's mark at `mark`."""
        if point is None or mark is None or (self._samples and time <= self._samples[-1][0]):
            self._samples.clear()
            return None
        self._samples.append((time, point, mark))
        while self._samples[0][0] < time - DWELL:
            self._samples.popleft()
        points, marks = (np.array([sample[index] for sample in self._samples]) for index in (1, 2))
        moved = np.linalg.norm(points - points[0], axis=1).max() > STILL * DWELL
        moved |= np.linalg.norm(marks - marks[0], axis=1).max() > MARK_STILL
        self._done &= not moved
        if self._done or moved or time - self._samples[0][0] < WHOLE * DWELL:
            return None
        self._done = True
        return points.mean(axis=0)


def mark_at(joints: np.ndarray, mark: tuple[float, float, float]) -> np.ndarray:
    """Where `mark` of the flange's frame is in the base with the robot at `joints` (7,), rad. Shape (3,), m."""
    places, turns = mount_pose(np.asarray(joints, dtype=float)[None], 0.0)
    return places[0] + turns[0] @ np.array(mark)


def fit(reference: np.ndarray, base: np.ndarray) -> Pose:
    """The pose of the reference frame in the base for which touches (N, 3) in both are nearest: W. Kabsch, "A solution
    for the best rotation to relate two sets of vectors", Acta Cryst. A32 (1976).

    Raises:
        InputError: there are too few, one is no place, or they lie in a plane.
    """
    if len(base) < FEWEST:
        raise InputError(f"touches: found {len(base)}, expected at least {FEWEST}")
    for number, places in enumerate(zip(reference, base, strict=True), 1):
        for x, y, z in places:
            if not np.isfinite([x, y, z]).all():
                raise InputError(f"touch {number}: found ({x:g}, {y:g}, {z:g}), expected finite numbers")
    off_plane = np.linalg.svd(base - base.mean(axis=0), compute_uv=False)[-1] / np.sqrt(len(base))
    if off_plane < FLAT:
        span = f"found all within {1e3 * off_plane:.0f} mm of a plane"
        raise InputError(f"touches: {span}, expected {1e3 * FLAT:.0f} mm: touch higher and lower ones")
    return _fit(reference, base)


def _fit(reference: np.ndarray, base: np.ndarray) -> Pose:
    middle, centre = reference.mean(axis=0), base.mean(axis=0)
    turn = Rotation.align_vectors(base - centre, reference - middle)[0]
    return pose_of(centre - turn.apply(middle), turn)


def in_base(pose: Pose, points: np.ndarray) -> np.ndarray:
    """Points (..., 3) of the reference frame in the base, m."""
    return np.array(pose.position) + rotation_from_wxyz(np.array(pose.quaternion)).apply(points)


def residuals(pose: Pose, reference: np.ndarray, base: np.ndarray) -> np.ndarray:
    """How far each touch is from where the fit has it, m (N,)."""
    return np.linalg.norm(in_base(pose, reference) - base, axis=1)


class Suspect(NamedTuple):
    """The touch number `index` misses the fit of the others by `off`, m."""

    index: int
    off: float


def suspect(reference: np.ndarray, base: np.ndarray) -> Suspect | None:
    """The touch without which the others agree best, if it misses them by more than BAD; of FEWEST or more touches."""
    if len(base) < FEWEST:
        return None
    misses = []
    for index in range(len(base)):
        others = np.arange(len(base)) != index
        pose = _fit(reference[others], base[others])
        missed = residuals(pose, reference, base)
        misses.append((float(np.sum(missed[others] ** 2)), index, float(missed[index])))
    _, index, off = min(misses)
    return Suspect(index, off) if off > BAD else None


def expected_error(pose: Pose, reference: np.ndarray, base: np.ndarray, point: np.ndarray) -> float:
    """Of the fit at `point` of the base, m, root mean square: J. M. Fitzpatrick, J. B. West, C. R. Maurer, "Predicting
    error in rigid-body point-based registration", IEEE Trans. Medical Imaging 17 (1998).

        TRE² = FLE²/N (1 + 1/3 Σ_k d_k²/f_k²),    FLE² = FRE² N/(N - 2)

    d_k: distance of `point` from the principal axis k of the touches; f_k: rms distance of the touches from it.
    """
    count, centre = len(base), base.mean(axis=0)
    located = np.mean(residuals(pose, reference, base) ** 2) * count / (count - 2)
    axes = np.linalg.svd(base - centre)[2]

    def squares(points: np.ndarray) -> np.ndarray:
        away = points - centre
        return np.sum(away**2, axis=-1)[..., None] - (away @ axes.T) ** 2

    lever = np.sum(squares(np.asarray(point)) / squares(base).mean(axis=0)) / 3
    return float(np.sqrt(located / count * (1 + lever)))


def tilt(pose: Pose) -> float:
    """Angle between the headset's vertical and the robot's, rad."""
    up = rotation_from_wxyz(np.array(pose.quaternion)).apply([0.0, 1.0, 0.0])
    return float(np.arccos(np.clip(up[2], -1.0, 1.0)))


def inverse(pose: Pose) -> Pose:
    """The other way round."""
    back = rotation_from_wxyz(np.array(pose.quaternion)).inv()
    return pose_of(-back.apply(pose.position), back)


def after(outer: Pose, inner: Pose) -> Pose:
    """`inner` of a frame that is itself at `outer`."""
    turn = rotation_from_wxyz(np.array(outer.quaternion)) * rotation_from_wxyz(np.array(inner.quaternion))
    return pose_of(in_base(outer, np.array(inner.position)), turn)


def pose_of(position: np.ndarray, turn: Rotation) -> Pose:
    x, y, z = (float(value) for value in position)
    w, a, b, c = (float(value) for value in wxyz_from_rotation(turn))
    return Pose((x, y, z), (w, a, b, c))
