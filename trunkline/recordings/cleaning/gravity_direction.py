"""Whether the declared vertical can be right: by the tilts that the experimenter aimed at, or by how the arm hangs."""

import numpy as np

from trunkline.recordings.cleaning.checks import Findings
from trunkline.recordings.signals.base_frame import average_base
from trunkline.recordings.trials.experiments import EXPERIMENTS, TILT
from trunkline.recordings.trials.raw_trial import RawTrial
from trunkline.recordings.trials.splits import IDENTIFY

AXES = np.concatenate([np.eye(3), -np.eye(3)])
OFF = np.radians(15)  # a misfit beyond aiming a tilt by hand
FITS = np.radians(5)
SPREAD = 20.0  # degrees between levels, so that not every direction on a cone fits
HANGS, LIES = np.radians(30), np.radians(60)  # from the vertical: an arm that hangs, and one that does not


def check_gravity_direction(
    raw_trials: list[RawTrial], measured_base: bool
) -> tuple[np.ndarray | None, str | None, bool]:
    """(the vertical (3,) to take instead, or None; what to tell, or None; whether other splits than identify decided).

    It is replaced only where static trials at several tilts fit exactly one other axis of the frame: those of the
    split `identify`, and only where those cannot tell, all of them.

    Args:
        measured_base: whether a body marks the mount; otherwise its orientation follows from the vertical itself.
    """
    tilted = [raw for raw in raw_trials if EXPERIMENTS[raw.experiment].level is TILT and raw.level is not None]
    if not tilted or not measured_base:
        return None, _check_hanging(raw_trials), False
    identifying = [raw for raw in tilted if raw.split == IDENTIFY]
    up, remark = _by_tilts(identifying) if identifying else (None, None)
    by_others = False
    if len(identifying) < len(tilted) and up is None and not (identifying and remark is None):
        up, by_all = _by_tilts(tilted)
        by_others = up is not None
        remark = by_all if by_others or not identifying else remark
    if up is not None and not possible_axes(raw_trials, measured_base)[np.argmax(AXES @ up)]:
        contradiction = f"levels would fit {show_axis(up)}, along which released arms do not hang"
        return None, f"up: {contradiction}: check `frame.up`, `base` and the levels in session.yaml", False
    return up, remark if remark is not None else _check_hanging(raw_trials), by_others


def _by_tilts(static: list[RawTrial]) -> tuple[np.ndarray | None, str | None]:
    """(another vertical that these tilts prove, or None; what to tell, or None where the declared one fits)."""
    up, levels = static[0].up, np.radians([raw.level for raw in static if raw.level is not None])
    z = np.array([_axis(raw) for raw in static])
    off = _misfit(z, up, levels)
    if off <= OFF:
        return None, None
    misfits = np.array([_misfit(z, axis, levels) for axis in AXES])
    best, second = np.argsort(misfits)[:2]
    difference = f"{np.degrees(off):.0f}° off their levels with {show_axis(up)}"
    problem = f"up: the tilts of {len(static)} static trials are {difference}"
    if misfits[best] < FITS and misfits[second] > OFF and np.ptp(np.degrees(levels)) >= SPREAD:
        return AXES[best], f"{problem}, {np.degrees(misfits[best]):.1f}° with {show_axis(AXES[best])}, which was taken"
    return None, f"{problem}, and no other axis fits: check the levels, `frame.up` and `base` in session.yaml"


def possible_axes(raw_trials: list[RawTrial], measured_base: bool = True) -> np.ndarray:
    """Which of `AXES` may be up, as tilts and releases tell. Shape (6,).

    Levels exclude axes where they fit the declared vertical and differ enough; releases, axes from which arms come to
    rest far from hanging.
    """
    possible = np.ones(len(AXES), bool)
    tilted = [raw for raw in raw_trials if EXPERIMENTS[raw.experiment].level is TILT and raw.level is not None]
    levels = np.radians([raw.level for raw in tilted if raw.level is not None])
    if tilted and measured_base and np.ptp(np.degrees(levels)) >= SPREAD:
        z = np.array([_axis(raw) for raw in tilted])
        if _misfit(z, tilted[0].up, levels) <= OFF:
            possible &= np.array([_misfit(z, axis, levels) <= OFF for axis in AXES])
    hanging = [_hang(raw) for raw in raw_trials if EXPERIMENTS[raw.experiment].hangs]
    if hanging:
        possible &= np.array([_from_hanging(np.array(hanging), axis) < LIES for axis in AXES])
    return possible


def check_levels(raw_trials: list[RawTrial], findings: list[Findings]) -> None:
    """Warn of each tilt whose base is not inclined as its level says, by the vertical that the raw trials have."""
    for raw, record in zip(raw_trials, findings, strict=True):
        if EXPERIMENTS[raw.experiment].level is TILT and raw.level is not None:
            tilt = np.degrees(np.arccos(np.clip(_axis(raw) @ raw.up, -1, 1)))
            if abs(tilt - raw.level) > np.degrees(OFF):
                problem = f"level: found {raw.level:g}, but the base is tilted by {tilt:.0f}°"
                record.warnings.append(f"{problem}, expected at most {np.degrees(OFF):.0f}° between them")


def _axis(raw: RawTrial) -> np.ndarray:
    """The base's z axis (3,) in the motion-capture frame."""
    return average_base(raw.base_positions, raw.base_quaternions).rotation.apply([0, 0, 1])


def _misfit(z: np.ndarray, up: np.ndarray, levels: np.ndarray) -> float:
    """Median difference, rad, between levels (N,) and the angles of the base's z axes (N, 3) from `up`."""
    return float(np.median(np.abs(np.arccos(np.clip(z @ up, -1, 1)) - levels)))


def _check_hanging(raw_trials: list[RawTrial]) -> str | None:
    """After a release an arm hangs more or less; told where all releases come to rest along another axis."""
    hanging = [_hang(raw) for raw in raw_trials if EXPERIMENTS[raw.experiment].hangs]
    if not hanging:
        return None
    down, up = np.array(hanging), raw_trials[0].up
    angle = _from_hanging(down, up)
    others = [_from_hanging(down, axis) for axis in AXES]
    best = int(np.argmin(others))
    if angle < LIES or others[best] > HANGS:
        return None
    problem = f"released arms come to rest {np.degrees(angle):.0f}° from hanging with {show_axis(up)}"
    other = f"{np.degrees(others[best]):.0f}° with {show_axis(AXES[best])}"
    return f"up: {problem}, {other}: check `frame.up` in session.yaml"


def _from_hanging(down: np.ndarray, up: np.ndarray) -> float:
    """Median angle, rad, between the directions (N, 3) in which arms come to rest and the opposite of `up`."""
    return float(np.median(np.arccos(np.clip(-down @ up, -1, 1))))


def _hang(raw: RawTrial) -> np.ndarray:
    """The direction (3,) from the base to the farthest marker, over the last fifth of a raw trial."""
    ends = slice(-max(1, len(raw.time) // 5), None)
    middle = np.nanmedian(raw.positions[ends], axis=0) - np.nanmedian(raw.base_positions[ends], axis=0)
    distance = np.where(np.isfinite(middle[:, 0]), np.linalg.norm(middle, axis=1), 0)
    return middle[np.argmax(distance)] / max(distance.max(), 1e-12)


def show_axis(axis: np.ndarray) -> str:
    """As session.yaml has it."""
    return "[" + ", ".join(f"{value:g}" for value in np.round(axis, 3) + 0.0) + "]"
