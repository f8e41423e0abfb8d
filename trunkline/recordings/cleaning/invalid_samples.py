"""Samples that are no measurement: far away, at the origin, not finite, without a rotation."""

from collections.abc import Iterator

import numpy as np

from trunkline.recordings.cleaning.checks import Findings
from trunkline.recordings.cleaning.reference import FARTHEST, Reference
from trunkline.recordings.logs.pose_stream import PoseStream
from trunkline.recordings.logs.transforms import is_rotation

REACH = 2.0  # times the arm's length, by which no body goes away from where it usually is


def valid_samples(
    poses: PoseStream,
    rows: np.ndarray,
    columns: list[int],
    reference: Reference,
    findings: Findings,
) -> tuple[np.ndarray, np.ndarray | None]:
    """Positions in metres and unit quaternions of the bodies in `columns`, NaN where either is invalid.

    A body exactly at the origin is one that a driver does not see, but for a base that is the origin throughout.
    """
    names = reference.bodies
    cells = np.ix_(rows, np.array(columns, int))
    positions = reference.scale * poses.positions[cells]
    present = poses.present[cells]
    for flagged, words in unmeasured(positions, reference.base is not None, reference.distances):
        findings.dropped(flagged, words, names)
        present &= ~flagged
    good = np.isfinite(positions).all(axis=-1)
    quaternions = None
    if poses.quaternions is not None:
        quaternions = poses.quaternions[cells]
        rotation = is_rotation(quaternions)
        findings.dropped(present & good & ~rotation, "with a NaN, zero or unnormalised quaternion", names)
        quaternions[rotation] /= np.linalg.norm(quaternions[rotation], axis=-1, keepdims=True)
        good, bad = good & rotation, present & ~good
        quaternions[~good] = np.nan
    else:
        bad = present & ~good
    findings.dropped(bad, "with a position that is not finite", names)
    positions[~good] = np.nan
    return positions, quaternions


def unmeasured(
    positions: np.ndarray, marked_base: bool, distances: np.ndarray | None
) -> Iterator[tuple[np.ndarray, str]]:
    """Which samples (T, B) of (T, B, 3) m are no measurement, and what is wrong with them; each becomes NaN in place.

    Args:
        marked_base: whether the first body marks the base, which may be the origin throughout.
        distances: usual ones between bodies, m, None where they are unknown. Shape (1 + S, 1 + S).
    """
    finite = np.asarray(np.isfinite(positions).all(axis=-1))
    far = finite & np.any(np.abs(positions) > FARTHEST, axis=-1)
    nowhere = np.asarray(finite & np.all(positions == 0, axis=-1))
    if marked_base and nowhere[:, 0].sum() == finite[:, 0].sum():
        nowhere[:, 0] = False
    yield far, f"with a position beyond {FARTHEST:g} m"
    yield nowhere, "exactly at the origin, where a driver puts what it does not see,"
    positions[far | nowhere] = np.nan
    twice = _coinciding(positions, marked_base)
    yield twice, "exactly at the place of another body, as of one that is not seen,"
    positions[twice] = np.nan
    away = _out_of_reach(positions, distances)
    yield away, "farther away than the arm reaches, as of a body that is not seen,"
    positions[away] = np.nan


def _coinciding(positions: np.ndarray, marked_base: bool) -> np.ndarray:
    """Which samples (T, B) of (T, B, 3) m are at the place of another body to the last bit, but for the base's, and for
    bodies that mostly are."""
    twice = np.zeros(positions.shape[:2], bool)
    for body in range(1 if marked_base else 0, positions.shape[1]):
        others = np.delete(positions, body, axis=1)
        twice[:, body] = (others == positions[:, [body]]).all(axis=2).any(axis=1)
    return twice & (twice.mean(axis=0) < 0.5)


def _out_of_reach(positions: np.ndarray, distances: np.ndarray | None) -> np.ndarray:
    """Which samples (T, B) of (T, B, 3) m are farther from where a body usually is than any shape of the arm brings it.

    Args: distances: usual ones between bodies, m, None where they are unknown. Shape (1 + S, 1 + S).
    """
    if distances is None:
        return np.zeros(positions.shape[:2], bool)
    middle = np.full(positions.shape[1:], np.nan)
    visible = np.isfinite(positions[..., 0]).any(axis=0)
    middle[visible] = np.nanmedian(positions[:, visible], axis=0)
    away = np.linalg.norm(positions - middle, axis=2)
    return np.isfinite(away) & (away > REACH * np.nanmax(distances))
