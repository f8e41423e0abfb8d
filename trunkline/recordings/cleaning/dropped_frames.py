"""Frames that a recorder lost without saying so: stamps go on evenly, and the arm jumps ahead on its way."""

from dataclasses import dataclass

import numpy as np

from trunkline.recordings.cleaning.checks import Findings
from trunkline.recordings.signals.smoothing import noise_level

SIDE = 3  # frames before and after a jump whose motion a parabola describes
MOST = 9  # frames, one more than are looked for at one place; by then an arm has gone round a bend
GAIN = 3.0  # how much better the parabola fits with the frames put back
LEAST, NOISES = 3e-4, 5.0  # m, and times the noise, of a body's misfit without them: below, it tells nothing
SUDDEN, AWAY = 4.0, 0.005  # times a body's steps nearby, and m, by which it jumps where no number of frames explains it
EVEN = 0.01  # share of a frame by which stamps differ that were counted and not measured


@dataclass
class DroppedFrames:
    """`frames` are missing after frame `after`."""

    after: int
    frames: int


def repair_dropped_frames(time: np.ndarray, positions: np.ndarray, motors: bool, findings: Findings) -> np.ndarray:
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


def longest_unbroken(time: np.ndarray, positions: np.ndarray, findings: Findings) -> slice:
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


def find_dropped_frames(time: np.ndarray, positions: np.ndarray, noise: float) -> list[DroppedFrames]:
    """Where even stamps hide a loss.

    Around every step a parabola is fitted to three frames before and three after it, once as stamped and once with
    1 to `MOST` frames put in between. Points that jump together along their ways, each by the same multiple of its own
    step, all fit with the right number; after an outlier, a swap or a knock they do not.

    Args:
        time: (T,) s. positions: (T, S, 3) m, NaN where not seen. noise: m, of a coordinate.
    """
    steps = np.diff(time)
    step = np.median(steps) if len(steps) else 0.0
    even = np.abs(steps - step) < EVEN * step
    window = np.arange(1 - SIDE, SIDE + 1)
    gaps = []
    fits = [_misfit(np.where(window > 0, window + lost, window)) for lost in range(MOST + 1)]
    shift = np.zeros(len(time), dtype=int)  # frames put in before each frame
    for after in range(SIDE - 1, len(time) - SIDE):
        rows = after + window
        if not even[rows[0] : rows[-1]].all() or shift[rows[0]] != shift[after]:
            continue
        points = positions[rows]
        points = points[:, np.isfinite(points).all(axis=(0, 2))]
        left = np.array([np.einsum("ab,bsi->asi", fit, points) for fit in fits])
        bodies = np.sqrt(np.mean(np.square(left), axis=(1, 3)))  # (MOST + 1, S)
        jumped = bodies[0] > max(LEAST, NOISES * noise)
        if not jumped.any():
            continue
        misfits = np.sqrt(np.mean(np.square(bodies), axis=1))
        best = int(np.argmin(misfits))
        together = bodies[best, jumped] < bodies[0, jumped] / 2
        if 0 < best < MOST and together.all() and misfits[0] > GAIN * misfits[best]:
            gaps.append(DroppedFrames(after, best))
            shift[after + 1 :] += best
    return gaps


def unbroken(time: np.ndarray, positions: np.ndarray) -> slice:
    """The longest part without a gap that nobody can count: where several bodies are much faster for one step than
    around it, more was lost than `find_dropped_frames` looks for.

    Args:
        time: (T,) s, with what could be counted put back. positions: (T, S, 3) m, NaN where not seen.
    """
    passed = np.diff(time)
    # a frame that was stamped late is followed too soon, which is no speed
    steps = np.linalg.norm(np.diff(positions, axis=0), axis=2) * np.minimum(np.median(passed) / passed, 1.0)[:, None]
    edges = [0]
    for after in range(1, len(steps) - 1):
        nearby = np.r_[steps[max(after - SIDE, 0) : after], steps[after + 1 : after + 1 + SIDE]]
        usual = np.nanmax(np.where(np.isfinite(nearby), nearby, 0.0), axis=0)
        jumped = (steps[after] > SUDDEN * usual) & (steps[after] > AWAY)
        if jumped.sum() > 1:
            edges.append(after + 1)
    edges.append(len(positions))
    longest = int(np.argmax(np.diff(edges)))
    return slice(edges[longest], edges[longest + 1])


def _misfit(frames: np.ndarray) -> np.ndarray:
    """(6, 6): what a parabola through samples at these frames leaves of them."""
    powers = np.vander(frames.astype(float), 3)
    return np.eye(len(frames)) - powers @ np.linalg.pinv(powers)


def put_back(time: np.ndarray, lost: list[DroppedFrames]) -> np.ndarray:
    """`time` (T,) with every later frame moved by the time of those that are missing before it."""
    step, moved = np.median(np.diff(time)), time.copy()
    for place in lost:
        moved[place.after + 1 :] += place.frames * step
    return moved
