"""Samples that are no measurement: far away, at the origin, not finite, without a rotation."""

import numpy as np

from trunkline.recordings.cleaning.checks import Findings
from trunkline.recordings.cleaning.reference import FARTHEST, Reference
from trunkline.recordings.logs.pose_stream import PoseStream
from trunkline.recordings.logs.transforms import is_rotation


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
    finite = np.asarray(np.isfinite(positions).all(axis=-1))
    far = finite & np.any(np.abs(positions) > FARTHEST, axis=-1)
    nowhere = np.asarray(finite & np.all(positions == 0, axis=-1))
    if reference.base is not None and nowhere[:, 0].sum() == finite[:, 0].sum():
        nowhere[:, 0] = False
    findings.dropped(far, f"with a position beyond {FARTHEST:g} m", names)
    findings.dropped(nowhere, "exactly at the origin, where a driver puts what it does not see,", names)
    positions[far | nowhere] = np.nan
    present &= ~(far | nowhere)
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
