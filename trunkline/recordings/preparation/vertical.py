"""Which way is up, by the logs alone: arms that nothing pulls sag downwards, and hang at last."""

from typing import NamedTuple

import numpy as np

from trunkline.frames import rotation_from_wxyz
from trunkline.recordings.logs.pose_stream import PoseStream
from trunkline.recordings.preparation.survey import LogSurvey
from trunkline.recordings.signals.clock import MIN_TRAVEL

SAGS = np.sin(np.radians(3))  # of some arm, from its straight line, or no log tells anything
EXPLAINED = 0.8  # of the sags' squares, by one vertical
SNAPS = np.cos(np.radians(20))  # from an axis of the frame
LEAST = 0.05  # of the vertical that logs with mounts in all directions would tell, by those that there are
BACK = np.array([0.0, 0.0, 1.0])  # of a base whose axes are the arm's
ALONG, HANGS = np.cos(np.radians(45)), np.cos(np.radians(30))

Axis = tuple[int, int, int]


class AtRest(NamedTuple):
    """The arm at a log's end. tip, first: unit vectors from the base to the farthest body, and to the nearest.

    base: its rotation matrix, None where nothing says it. All in the frame of the cameras.
    """

    tip: np.ndarray
    first: np.ndarray
    base: np.ndarray | None


def up_by_sags(surveys: list[LogSurvey], base: str | None) -> Axis | None:
    """The axis of the frame against which arms of several mounts sag from their straight lines.

    To first order a sag is the part of gravity across the arm, times one number. Least squares over the logs give the
    vector; None where arms hardly sag, where mounts are alike, or where no axis explains it.
    """
    arms = [arm for survey in surveys if (arm := at_rest(survey, base)) is not None and arm.base is not None]
    if len(arms) < 2:
        return None
    turns, tips = np.array([arm.base for arm in arms]), np.array([arm.tip for arm in arms])
    straight = np.einsum("kji,kj->ki", turns, [arm.first for arm in arms]).mean(axis=0)
    straight /= np.linalg.norm(straight)
    if -straight @ BACK > ALONG:
        straight = -BACK
    along = turns @ straight
    across = np.eye(3) - along[:, :, None] * along[:, None, :]
    sags = np.einsum("kij,kj->ki", across, tips)
    down, _, _, sizes = np.linalg.lstsq(across.reshape(-1, 3), sags.ravel(), rcond=None)
    left = np.sum((sags.ravel() - across.reshape(-1, 3) @ down) ** 2)
    enough = sizes[-1] ** 2 >= LEAST * len(arms) and np.linalg.norm(sags, axis=1).max() >= SAGS
    if not enough or left > (1 - EXPLAINED) * np.sum(sags**2):
        return None
    up = -down / np.linalg.norm(down)
    return nearest_axis(up) if np.abs(up).max() >= SNAPS else None


def up_by_hanging(surveys: list[LogSurvey], base: str | None) -> tuple[Axis, bool] | None:
    """(the axis against which arms hang at the end, whether they do so clearly and all); None where no arm is seen."""
    tips = [arm.tip for survey in surveys if (arm := at_rest(survey, base)) is not None]
    if not tips:
        return None
    up = nearest_axis(-np.mean(tips, axis=0))
    return up, bool(np.min(-np.array(tips) @ up) >= HANGS)


def at_rest(survey: LogSurvey, base: str | None) -> AtRest | None:
    """Where a log leaves an arm that nothing pulls; None where something does, or too little is seen."""
    poses = survey.poses
    if poses is None or not len(poses.stamps) or pulled(survey):
        return None
    ends = slice(-max(1, len(poses.positions) // 5), None)
    return _shape(poses, base, ends)


def pulled(survey: LogSurvey) -> bool:
    """Whether motors move in a log, or hold a tendon drawn in."""
    motors = survey.commands or survey.tendon_positions  # encoders may start anywhere
    if motors is None or not motors.positions.size:
        return False
    pulls = np.ma.masked_invalid(motors.positions)
    drawn = survey.commands is not None and pulls.max() > MIN_TRAVEL
    return bool(drawn or np.ptp(pulls, axis=0).max() > MIN_TRAVEL)


def _shape(poses: PoseStream, base: str | None, ends: slice) -> AtRest | None:
    """The first body stands for a base that none marks."""
    start = poses.names.index(base) if base in poses.names else 0
    visible = [i for i in range(len(poses.names)) if np.isfinite(poses.positions[ends, i, 0]).any()]
    others = [i for i in visible if i != start]
    if start not in visible or not others:
        return None
    middle = np.array([np.nanmedian(poses.positions[ends, i], axis=0) for i in (start, *others)])
    away = middle[1:] - middle[0]
    distances = np.linalg.norm(away, axis=1)
    if not distances.min() > 0:
        return None
    directions = away / distances[:, None]
    turn = None
    if base in poses.names and poses.quaternions is not None:
        turns = poses.quaternions[ends, start]
        turns = turns[np.linalg.norm(np.nan_to_num(turns), axis=1) > 0]
        turn = rotation_from_wxyz(turns).mean().as_matrix() if len(turns) else None
    return AtRest(directions[int(np.argmax(distances))], directions[int(np.argmin(distances))], turn)


def nearest_axis(direction: np.ndarray) -> Axis:
    """The axis of the frame nearest to a direction."""
    axis = int(np.argmax(np.abs(direction)))
    x, y, z = (int(np.sign(direction[axis])) if i == axis else 0 for i in range(3))
    return x, y, z
