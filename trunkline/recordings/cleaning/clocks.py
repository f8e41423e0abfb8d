"""The three clocks of a log: frame numbers, stamps and log times. A step of one against the others bends time."""

from itertools import combinations

import numpy as np

from trunkline.errors import InputError
from trunkline.recordings.cleaning.checks import Findings, TrialLimits
from trunkline.recordings.logs.pose_stream import PoseStream
from trunkline.recordings.signals.steps import find_step, relative, size_at

WORDS = {"frame": "frame numbers", "stamp": "stamps", "log": "log times"}
USED = {"frame": ("frame", "stamp"), "stamp": ("stamp",), "log": ("log",)}  # by session.yaml's `clock`
DRIFT = 0.01  # by which stamps and log times may differ in rate
CERTAIN = 10.0  # times the jitter that such a drift has to bring in all


def check_clocks(poses: PoseStream, clock: str, limits: TrialLimits, where: str, findings: Findings) -> None:
    """Refuse a log whose time would be bent, by a step of a clock that `clock` uses; warn of a step of another.

    Raises:
        InputError: naming the clock that steps, by how much and where, and the clocks that would do.
    """
    clocks = _clocks(poses)
    if clock == "log" and "stamp" in clocks:
        back = np.maximum.accumulate(clocks["stamp"]) - clocks["stamp"]
        if back.max() > limits.disorder:
            message = f"in the order of the log times, stamps run backwards by {back.max():.3f} s"
            raise InputError(f"{where}: {message} at message {int(back.argmax())}, expected `clock: stamp` or `frame`")
    for early, late in combinations(clocks, 2):
        step = find_step(clocks[late], clocks[early])
        if step is None or not {early, late} & set(USED[clock]):
            continue
        wrong = _at_fault(clocks, early, late, step.at)
        other = early if wrong == late else late
        size = step.size if wrong == late else -step.size
        seconds = clocks[late][step.at - 1] - clocks[late][0]
        place = f"at message {step.at}, after {seconds:.2f} s, against {WORDS[other]}"
        jump = f"{WORDS[wrong]} jump by {size:+.3f} s {place}"
        if wrong in USED[clock]:
            others = " or ".join(f"`clock: {name}`" for name, used in USED.items() if wrong not in used)
            raise InputError(f"{where}: {jump}, expected a clock that runs evenly, such as {others} in session.yaml")
        findings.warnings.append(f"{jump}; left so, as `clock: {clock}` does not use them")
    fit = findings.logged
    if fit is not None and abs(fit.rate - 1) > max(DRIFT, CERTAIN * fit.jitter / np.ptp(clocks["log"])):
        rate = f"{100 * abs(1 / fit.rate - 1):.1f} % {'slower' if fit.rate > 1 else 'faster'}"
        findings.warnings.append(f"stamps run {rate} than log times; time is by `clock: {clock}`")


def _clocks(poses: PoseStream) -> dict[str, np.ndarray]:
    """What a log's clocks read at each message, s, in the order in which a message passes them: those that run."""
    clocks = {}
    stamps, logged = (1e-9 * (some - some[0]) for some in (poses.stamps, poses.log_times))
    if poses.frames is not None and np.ptp(poses.frames) and np.ptp(stamps):
        counted = (poses.frames - poses.frames[0]).astype(float)
        interval = np.median(np.diff(stamps)) or np.ptp(stamps) / len(stamps)  # a coarse clock stands still mostly
        clocks["frame"] = counted * interval / max(np.median(np.diff(counted)), 1.0)
    if poses.stamps.any() and np.ptp(stamps):
        clocks["stamp"] = stamps
    if np.ptp(logged):
        clocks["log"] = logged
    return clocks


def _at_fault(clocks: dict[str, np.ndarray], early: str, late: str, at: int) -> str:
    """Which of two clocks steps: the one that does so against the third too, or whose own interval is unusual."""
    third = next((name for name in clocks if name not in (early, late)), None)
    if third is None:
        unusual = {name: _unusual(clocks[name], at) for name in (early, late)}
    else:
        interval = float(np.ptp(clocks[third])) / (len(clocks[third]) - 1)
        unusual = {name: abs(size_at(relative(clocks[name], clocks[third]), at, interval)) for name in (early, late)}
    return max(unusual, key=unusual.__getitem__)


def _unusual(clock: np.ndarray, at: int) -> float:
    intervals = np.diff(clock)
    return float(abs(intervals[at - 1] - np.median(intervals)))
