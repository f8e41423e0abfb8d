"""Whether a live stream of poses can be true: what stalls, lies or is no measurement is named, and its poses go.

A pose to which a check objects is NaN at once, or at the next look at the last frames, LOOKS s later. If the objection
lasts for LASTS s, it is a fault of the stream: outliers and short occlusions are none.

Faults are of two kinds. A stream that is late, silent or its frames old, as on a machine that does other work, says
nothing that is untrue: that fault ends once no frame has been late for `recovers` s. Whatever else is objected to means
that a stream says what is untrue (it is frozen, labels are exchanged, a body is elsewhere, a number is none, its frames
do not count up), or what nobody can read: such a fault persists until the stream is connected anew. Rules of positions
are those by which `ingest` reads logs (`trunkline/recordings/cleaning/`):

- no measurement: at the origin, at another body's place, farther than cameras see or the arm reaches (`unmeasured`);
- stale: the same to the last bit as in the frame before (`stale_samples`);
- exchanged labels (`find_label_swaps`; here also by bodies that are suddenly where others just were), and a body that
  is elsewhere by its distances to its neighbors (`misplaced`);
- no rotation (`is_rotation`).

Of the stream alone: silence, frames that do not count up or whose stamps do not, and frames that come later than they
did at first: one that is late from its first frame on does not show. Where all bodies repeat from the first frame on,
that shows after a whole window, WINDOW frames. Exchanged labels that appear within a gap may show late, or not at all.
"""

import math
from collections import deque
from dataclasses import dataclass
from typing import Annotated

import numpy as np
from pydantic import Field
from scipy.sparse.csgraph import csgraph_from_dense, shortest_path

from trunkline.ar.tracking.tracker import CameraFrame, ExpectedBodies, TrackedPoses
from trunkline.recordings.cleaning.invalid_samples import unmeasured
from trunkline.recordings.cleaning.label_swaps import find_label_swaps
from trunkline.recordings.cleaning.sanity_checks import misplaced
from trunkline.recordings.logs.transforms import is_rotation
from trunkline.recordings.signals.repeats import stale_samples

WINDOW = 120  # frames that are looked at together
LOOKS = 0.05  # s from one look at the window to the next: it costs more than all else
SWAPPED = 12  # frames in which exchanged labels are looked for
SEARCHES = (
    0.25  # s for which they are, once a body came nearer to where another was; a search takes longer than a frame
)
LASTS = 0.1  # s after which an objection is a fault; outliers last for a frame or two
JUST = 0.1  # s since bodies were where labels are exchanged
THERE = 0.3  # of the distance of two bodies, within which one is where the other was
DRIFT = 2e-4  # by which clocks may differ in rate; quartzes differ by less
AGE = "age"  # the rule that objects to frames that come late
STREAM = ""  # in place of a body, for objections to the stream as a whole


@dataclass(frozen=True)
class StreamLimits:
    """silence: s without a frame. age: s that a frame may be old when it comes. distance: share of the arm's length by
    which a body's distances to its neighbors may differ, as `plausible.distance` of conf/ingest. recovers: s without a
    late frame after which a fault of lateness ends."""

    silence: Annotated[float, Field(gt=0, le=10)] = 0.15
    age: Annotated[float, Field(gt=0, le=10)] = 0.1
    distance: Annotated[float, Field(gt=0, le=0.5)] = 0.1
    recovers: Annotated[float, Field(gt=0, le=60)] = 2.0


def along_arm(distances: np.ndarray) -> np.ndarray:
    """Distances (B, B), m, those that are NaN by way of other bodies: a session knows those of neighbors alone, and the
    arm reaches as far as all of them together; infinite where no way leads."""
    return shortest_path(csgraph_from_dense(distances, null_value=np.inf, nan_null=True), directed=False)


class StreamChecks:
    """Of the frames of one stream."""

    def __init__(self, expected: ExpectedBodies, limits: StreamLimits) -> None:
        self._untrue = self._late = ""  # the first fault that persists, and the one of lateness that there is
        self._late_at = -math.inf  # s, when a frame was late last, or none came
        self._expected, self._limits = expected, limits
        self._paths = None if expected.distances is None else along_arm(expected.distances)
        self._since: dict[tuple[str, str], float] = {}  # of objections, by rule and body
        self._behind_at = -math.inf  # s, when a frame was behind last
        self._dropped: dict[str, set[str]] = {}  # by rule, as of the last look at the window
        self._last: CameraFrame | None = None
        self._offset, self._received, self._looked = math.inf, math.nan, -math.inf
        self._counted: deque[tuple[float, int]] = deque()  # of the last second: when each frame came, and its number
        self._window: deque[np.ndarray] = deque(maxlen=WINDOW)
        self._search, self._places = math.inf, np.full((len(expected.names), 3), np.nan)  # from the first frame on
        self._homes, self._home_at = self._places.copy(), np.full(len(expected.names), -np.inf)  # of labels; m, s
        self._labels = np.arange(len(expected.names))  # of each label the body that has it
        usual = expected.distances
        self._least = math.inf if usual is None else limits.distance * float(np.nanmax(usual[0]))
        self._names = expected.names if expected.marked_base else ("base", *expected.names)  # as in `distances`

    @property
    def fault(self) -> str:
        """In one line; "" while there is none."""
        return self._untrue or self._late

    def take(self, now: float, frame: CameraFrame) -> TrackedPoses | None:
        """The poses of a frame that came at `now`, s of the monotonic clock; None for one that comes after a later."""
        last, behind = self._last, ""
        if not (math.isfinite(frame.stamp) and math.isfinite(frame.sent)):
            behind = f"found the stamp {frame.stamp} in frame {frame.number}, expected a time"
        elif last is not None and not (frame.number > last.number and frame.stamp > last.stamp):
            came = f"found frame {frame.number}, stamped {frame.stamp:.3f} s, after {last.number}, {last.stamp:.3f} s"
            behind = f"{came}, expected both to grow"
        self._object_to_order(now, behind)
        if behind:
            return None
        if now - self._received > self._limits.silence:
            self._late_at = now
        age = self._age(now, frame)
        if now - self._late_at >= self._limits.recovers:
            self._late = ""
        self._last, self._received = frame, now
        self._since.pop(("unreadable", STREAM), None)
        rate, loss = self._count(now, frame.number)
        positions, quaternions = self._measured(now, frame)
        return TrackedPoses(self._expected.names, now - age, positions, quaternions, age, rate, loss, self.fault)

    def unreadable(self, now: float, reason: str) -> None:
        """That a message came which is no frame; `reason` in one line."""
        self._object(now, "unreadable", {STREAM: reason})

    def wait(self, now: float) -> None:
        """That nothing came until `now`, s."""
        silent = now - self._received
        if silent > self._limits.silence:
            self._late_at = now
            line = f"found no frame for {silent:.2f} s, expected one within {self._limits.silence:g} s"
            self._late = self._late or line

    def _object_to_order(self, now: float, behind: str) -> None:
        """That a frame is `behind`, "" where it is not: frames in between, as of a second publisher, are no end of it,
        LASTS s are."""
        if behind:
            self._behind_at = now
            self._object(now, "order", {STREAM: behind})
        elif now - self._behind_at >= LASTS:
            self._object(now, "order", {})

    def _object(self, now: float, rule: str, sentences: dict[str, str]) -> None:
        """What a rule objects to now, by body, and to no others any more."""
        self._since = {key: at for key, at in self._since.items() if key[0] != rule or key[1] in sentences}
        for body, sentence in sentences.items():
            if now - self._since.setdefault((rule, body), now) < LASTS:
                continue
            line = " ".join(sentence.split())
            if rule == AGE:
                self._late = self._late or line
            else:
                self._untrue = self._untrue or line

    def _age(self, now: float, frame: CameraFrame) -> float:
        """s from the exposure until `now`, without the shortest way of a message."""
        since = 0.0 if math.isnan(self._received) else now - self._received
        self._offset = min(self._offset + DRIFT * since, now - frame.sent)
        age = now - self._offset - frame.stamp
        old = f"found poses that are {age:.2f} s old when they come, expected at most {self._limits.age:g} s"
        if age > self._limits.age:
            self._late_at = now
        self._object(now, AGE, {STREAM: old} if age > self._limits.age else {})
        return age

    def _count(self, now: float, number: int) -> tuple[float, float]:
        """Rate, Hz, and share of lost frames, of the last second."""
        self._counted.append((now, number))
        while now - self._counted[0][0] > 1.0:
            self._counted.popleft()
        (begin, first), steps = self._counted[0], len(self._counted) - 1
        if not steps or now <= begin:
            return 0.0, 0.0
        return steps / (now - begin), 1.0 - steps / (number - first)

    def _measured(self, now: float, frame: CameraFrame) -> tuple[np.ndarray, np.ndarray]:
        """The poses (B, 3) and (B, 4) of a frame, NaN where they are none."""
        names = self._expected.names
        positions = np.where(frame.tracked[:, None], frame.positions, np.nan)
        finite = np.isfinite(positions).all(axis=1)
        rotation = is_rotation(frame.quaternions)
        self._drop(now, "finite", frame.tracked & ~finite, "a position that is not finite,")
        self._drop(now, "rotation", frame.tracked & ~rotation, "a NaN, zero or unnormalised quaternion,")
        positions[~(finite & rotation)] = np.nan
        self._window.append(positions.copy())
        crossed = self._crossed(positions)
        self._relabel(now, positions)
        self._drop_exchanged(now, "exchanged", self._labels != np.arange(len(names)))
        if crossed or self._search == math.inf:
            self._search = now + SEARCHES
        if crossed or now - self._looked >= LOOKS:
            self._looked = now
            self._look(now)
        gone = self._misplaced(now, positions).union(*self._dropped.values())
        positions[[names.index(name) for name in gone]] = np.nan
        quaternions = np.where(np.isfinite(positions[:, :1]), frame.quaternions, np.nan)
        return positions, quaternions / np.linalg.norm(quaternions, axis=1, keepdims=True)

    def _drop(self, now: float, rule: str, flagged: np.ndarray, what: str) -> set[str]:
        """Bodies (B,) that are flagged, to which a rule objects with what is the matter."""
        bodies = [self._expected.names[body] for body in np.flatnonzero(flagged)]
        self._object(now, rule, {name: f"{name!r}: found {what} expected measured poses" for name in bodies})
        return set(bodies)

    def _misplaced(self, now: float, positions: np.ndarray) -> set[str]:
        """Names of bodies elsewhere."""
        usual = self._expected.distances
        if usual is None or len(usual) < 3:
            return set()
        places = self._expected.with_base(positions)
        distances = np.linalg.norm(places[:, None] - places, axis=-1)
        bodies = {
            self._names[body]: text for body, text in misplaced(distances, usual, self._names, self._least).items()
        }
        swapped = self._dropped.get("swap", set()) | self._dropped["exchanged"]
        self._object(now, "misplaced", {name: bodies[name] for name in bodies if name not in swapped})
        return set(bodies) & set(self._expected.names)

    def _drop_exchanged(self, now: float, rule: str, exchanged: np.ndarray) -> None:
        """Labels (B,) that are on other bodies."""
        others = " and ".join(repr(self._expected.names[body]) for body in np.flatnonzero(exchanged))
        self._dropped[rule] = self._drop(now, rule, exchanged, f"the labels {others} taken for each other,")

    def _crossed(self, positions: np.ndarray) -> bool:
        """Whether a body (B, 3) m is nearer to where another was last than to where it was itself."""
        apart = np.linalg.norm(positions[:, None] - self._places, axis=-1)
        both = np.isfinite(np.diagonal(apart))
        nearest = np.argmin(np.where(np.isfinite(apart), apart, np.inf), axis=1)
        visible = np.isfinite(positions[:, 0])
        self._places[visible] = positions[visible]
        return bool(np.any(nearest[both] != np.flatnonzero(both)))

    def _relabel(self, now: float, positions: np.ndarray) -> None:
        """Which body each label is on, by labels at (B, 3), m, that are where others just were: bodies move no way so
        fast, several at once, and end where others were. One of them may be hidden meanwhile."""
        apart = np.linalg.norm(positions[:, None] - self._homes, axis=-1)
        between = np.linalg.norm(self._homes[:, None] - self._homes, axis=-1)
        just = now - self._home_at <= JUST
        there = (apart < THERE * between) & just & just[:, None]
        moved = np.flatnonzero(there.any(axis=1) & there.any(axis=0))
        before, elsewhere = there[moved].argmax(axis=1), there.any(axis=1)
        if np.array_equal(np.sort(before), moved):
            self._labels[moved], elsewhere[moved] = self._labels[before], False
        at_home = np.isfinite(positions[:, 0]) & ~elsewhere
        self._homes[at_home], self._home_at[at_home] = positions[at_home], now

    def _look(self, now: float) -> None:
        """At the window, for what a single frame does not show."""
        raw, expected = np.array(self._window), self._expected
        steps = np.diff(raw, axis=0)
        steps = steps[np.isfinite(steps)]
        same = f"found the same poses of all bodies in {WINDOW} frames, to the last bit, expected noise"
        self._object(now, "still", {STREAM: same} if len(raw) == WINDOW and steps.size and not steps.any() else {})
        stale = stale_samples(raw)[-1]
        self._dropped["stale"] = self._drop(now, "stale", stale, "poses that only repeat the one before,")
        places = expected.with_base(raw)
        if expected.distances is not None and now <= self._search:
            swapped = np.zeros(places.shape[1], bool)
            for swap in find_label_swaps(places[-SWAPPED:], expected.distances, expected.marked_base):
                swapped[list(swap.bodies)] |= swap.frames[-1]
            swapped = swapped[len(swapped) - len(expected.names) :]
            self._drop_exchanged(now, "swap", swapped)
        for flagged, words in unmeasured(places, expected.marked_base, self._paths):
            flagged = flagged[-1, places.shape[1] - len(expected.names) :]
            self._dropped[words] = self._drop(now, words, flagged, f"poses {words}")
