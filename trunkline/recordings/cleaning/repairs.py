"""Repairs of one trial's poses: samples that are none, labels that changed places, frames that nobody counted."""

import numpy as np

from trunkline.recordings.cleaning.checks import Findings
from trunkline.recordings.cleaning.dropped_frames import find_dropped_frames, put_back, unbroken
from trunkline.recordings.cleaning.label_swaps import find_label_swaps
from trunkline.recordings.cleaning.reference import FARTHEST, Reference
from trunkline.recordings.cleaning.stale_poses import stale_samples
from trunkline.recordings.logs.pose_stream import PoseStream
from trunkline.recordings.logs.transforms import is_rotation
from trunkline.recordings.signals.smoothing import noise_level


def good_samples(
    poses: PoseStream,
    rows: np.ndarray,
    columns: list[int],
    reference: Reference,
    findings: Findings,
) -> tuple[np.ndarray, np.ndarray | None]:
    """Positions in metres and unit quaternions of the bodies in `columns`, NaN where either is no good.

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
    _tell_dropped(far, f"with a position beyond {FARTHEST:g} m", names, findings)
    _tell_dropped(nowhere, "exactly at the origin, where a driver puts what it does not see,", names, findings)
    positions[far | nowhere] = np.nan
    present &= ~(far | nowhere)
    good = np.isfinite(positions).all(axis=-1)
    quaternions = None
    if poses.quaternions is not None:
        quaternions = poses.quaternions[cells]
        rotation = is_rotation(quaternions)
        _tell_dropped(present & good & ~rotation, "with a NaN, zero or unnormalised quaternion", names, findings)
        quaternions[rotation] /= np.linalg.norm(quaternions[rotation], axis=-1, keepdims=True)
        good, bad = good & rotation, present & ~good
        quaternions[~good] = np.nan
    else:
        bad = present & ~good
    _tell_dropped(bad, "with a position that is not finite", names, findings)
    positions[~good] = np.nan
    return positions, quaternions


def drop_frozen(
    positions: np.ndarray, quaternions: np.ndarray | None, names: list[str], findings: Findings
) -> None:
    """Make NaN of the poses that only repeat the one before."""
    still = stale_samples(positions)
    _tell_dropped(still, "that only repeat the one before, to the last bit,", names, findings)
    positions[still] = np.nan
    if quaternions is not None:
        quaternions[still] = np.nan


def untangle(
    base: tuple[np.ndarray, np.ndarray],
    positions: np.ndarray,
    quaternions: np.ndarray | None,
    time: np.ndarray,
    reference: Reference,
    findings: Findings,
) -> None:
    """Give labels that changed places back, in the poses of the base (where a body marks it) and of the markers, at
    times (T,) s."""
    if reference.distances is None:
        return
    names = [reference.base or "base", *reference.markers]
    bodies = np.insert(positions, 0, base[0], axis=1)
    turns = None if quaternions is None else np.insert(quaternions, 0, base[1], axis=1)
    for swap in find_label_swaps(bodies, reference.distances, reference.base is not None):
        wrong, right = np.array(swap.bodies), np.array([*swap.bodies[1:], swap.bodies[0]])
        for values in (bodies, turns):
            if values is not None:
                values[np.ix_(swap.frames, right)] = values[np.ix_(swap.frames, wrong)]
        count, who = int(swap.frames.sum()), " and ".join(repr(names[body]) for body in swap.bodies)
        begin, end = time[np.flatnonzero(swap.frames)[[0, -1]]]
        when = f"between {begin:.2f} and {end:.2f} s"
        findings.repairs.append(f"{who} were taken for each other in {count} frames {when}, put right")
    base[0][:], positions[:] = bodies[:, 0], bodies[:, 1:]
    if turns is not None and quaternions is not None:
        base[1][:], quaternions[:] = turns[:, 0], turns[:, 1:]


def with_dropped_time(time: np.ndarray, positions: np.ndarray, motors: bool, findings: Findings) -> np.ndarray:
    """Time (T,) with what even stamps hide put back, unless motors are dated by a clock that would not move along."""
    noise = float(np.median(noise_level(positions.reshape(len(time), -1))))
    lost = find_dropped_frames(time, positions, noise)
    if not lost:
        return time
    count, at = sum(place.frames for place in lost), ", ".join(f"{time[place.after]:.2f}" for place in lost)
    frames = "frame" if count == 1 else "frames"
    sentence = f"{count} {frames} lost at {at} s, though the stamps go on evenly: all bodies jump ahead on their ways"
    if motors:
        findings.warnings.append(f"{sentence}; left so, as the motors have a clock of their own")
        return time
    findings.repairs.append(f"{sentence}; their time put back")
    return put_back(time, lost)


def longest_part(time: np.ndarray, positions: np.ndarray, findings: Findings) -> slice:
    """What to keep of a trial in which so many frames were lost at once that their time cannot be put back."""
    part = unbroken(time, positions)
    for begin, end in ((0, part.start), (part.stop, len(time))):
        if end > begin:
            at = time[part.start if begin == 0 else part.stop - 1]
            findings.repairs.append(
                f"more frames lost at {at:.2f} s than can be counted, though the stamps go on evenly; {end - begin} "
                f"frames {'before' if begin == 0 else 'after'} it left out"
            )
    return part


def _tell_dropped(bad: np.ndarray, what: str, names: list[str], findings: Findings) -> None:
    if bad.any():
        where = ", ".join(name for name, hit in zip(names, np.any(bad, axis=0), strict=True) if hit)
        findings.repairs.append(f"{int(bad.sum())} samples {what} dropped ({where})")
