"""Poses that come body by body, each with a time of its own, and which of them belong together."""

from typing import NamedTuple

import numpy as np

from trunkline.recordings.signals.even_times import even_times, is_uneven

WHOLE = 0.9  # share of bodies that are in a frame, below which they may not have been put together rightly
FRAMES_OPEN = 16  # frames back to which a body's late sample may still belong


class PoseSamples(NamedTuple):
    """M poses, in the order in which they were logged.

    stamps, logged: ns, of the header and the recorder. Shape (M,). names: the bodies. Shape (M,). parents: names of
    the frames that the poses are in, empty where messages do not say. Shape (M,). positions: in the log's unit.
    Shape (M, 3). quaternions: wxyz, NaN where there are none. Shape (M, 4).
    """

    stamps: np.ndarray
    logged: np.ndarray
    names: np.ndarray
    parents: np.ndarray
    positions: np.ndarray
    quaternions: np.ndarray

    @classmethod
    def none(cls) -> "PoseSamples":
        time, names = np.empty(0, np.int64), np.empty(0, str)
        return cls(time, time, names, names, np.empty((0, 3)), np.empty((0, 4)))

    def take(self, rows: np.ndarray) -> "PoseSamples":
        return PoseSamples(*(values[rows] for values in self))

    @property
    def clock(self) -> np.ndarray:
        """What dates a sample, ns: its stamp, or the log time where no message is stamped. Shape (M,)."""
        return self.stamps if self.stamps.any() else self.logged

    def bodies(self) -> tuple[tuple[str, ...], np.ndarray]:
        """All names, in the order of their first appearance, and each sample's by index (M,)."""
        names = self.names.tolist()
        index = {name: place for place, name in enumerate(dict.fromkeys(names))}
        return tuple(index), np.array([index[name] for name in names], int)

    def frames(self, body: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
        """Each sample's frame (M,), and the index of each frame's first sample.

        Samples of different bodies (M,) at most half a frame's interval apart belong together; where few do, as each
        came late by itself, those at evened times.
        """
        frames = _grouped(self.clock, body)
        bodies = len(np.unique(body))
        if len(body) < WHOLE * bodies * len(frames[1]) and (even := _evened(self.clock, body)) is not None:
            frames = min(frames, _grouped(even, body), key=lambda grouped: len(grouped[1]))
        return frames


def _evened(clock: np.ndarray, body: np.ndarray) -> np.ndarray | None:
    """Times (M,) ns of the samples of bodies (M,), without what each came late; None where a body's cannot tell."""
    even = clock.copy()
    for which in np.unique(body):
        rows = np.flatnonzero(body == which)
        rows = rows[np.argsort(clock[rows], kind="stable")]
        time = 1e-9 * (clock[rows] - clock[rows[0]])
        times = even_times(time, None) if is_uneven(time) else None
        if times is None:
            return None
        even[rows] = clock[rows[0]] + np.round(1e9 * times.time).astype(np.int64)
    return even


def _grouped(clock: np.ndarray, body: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
    """Each sample's frame (M,) by times (M,) ns and bodies (M,), and the index of each frame's first sample."""
    steps = np.concatenate([[0], *(np.diff(np.sort(clock[body == i])) for i in np.unique(body))])
    steps = steps[steps > 0]
    apart = 0.5 * float(np.median(steps)) if len(steps) else 0.0
    frame, first, taken = np.empty(len(clock), int), [], []
    for sample, (time, who) in enumerate(zip(clock.tolist(), body.tolist(), strict=True)):
        for place in range(len(first) - 1, max(-1, len(first) - 1 - FRAMES_OPEN), -1):
            if abs(time - clock[first[place]]) <= apart and who not in taken[place]:
                break
        else:
            place = len(first)
            first.append(sample)
            taken.append(set())
        frame[sample] = place
        taken[place].add(who)
    return frame, np.array(first, int)


def union(batches: list[tuple[np.ndarray, list[str]]]) -> tuple[str, ...]:
    """All names, in the order of their first appearance: by row, then by place."""
    first: dict[str, tuple[int, int]] = {}
    for rows, names in batches:
        for place, name in enumerate(names):
            first[name] = min(first.get(name, (rows[0], place)), (rows[0], place))
    return tuple(sorted(first, key=first.__getitem__))
