"""Follow a moving object: success is that its path is completed without interruption; the tip's error is told.

The path is drawn: along each axis two sines, from rest. The object that is followed touches nothing.
"""

import numpy as np

from rehearsal.experiments.bench import SessionFrame, SharedRun, Staged
from rehearsal.experiments.result import Result
from rehearsal.operator.scripts import Ending
from rehearsal.session import View
from trunkline.ar.teleop.core import STAYS

EASE = 2.0  # s in which the object begins to move


class Path:
    """Where the object is, (3,), m: at `start` until `begun`, then away and to and fro for `seconds`."""

    def __init__(
        self, start: np.ndarray, amplitude: float, fastest: float, seconds: float, rng: np.random.Generator
    ) -> None:
        self.start, self.seconds, self.begun = start, seconds, np.inf
        self.rates = 2 * np.pi * rng.uniform(fastest / 3, fastest, (2, 3))
        self.phases = rng.uniform(0, 2 * np.pi, (2, 3))
        self.amplitude = amplitude / 2

    def __call__(self, now: float) -> np.ndarray:
        gone = min(max(now - self.begun, 0.0), self.seconds)
        ease = min(gone / EASE, 1.0)
        swing = np.sin(self.rates * gone + self.phases) - np.sin(self.phases)
        return self.start + self.amplitude * ease * ease * (3 - 2 * ease) * swing.sum(axis=0)

    def begin(self, now: float) -> None:
        self.begun = now

    def finished(self, now: float) -> bool:
        return now >= self.begun + self.seconds


def follow(bench: SharedRun, seed: int) -> Staged:
    return on_path(bench, seed)[1]


def on_path(bench: SharedRun, seed: int) -> tuple[Path, Staged]:
    """The path that the seed draws, and the experiment of following it to its end."""
    rng = np.random.default_rng([seed, 1])
    s, delay = bench.settings, bench.config.core.follow_delay
    path = Path(bench.place(rng), s.path, s.path_hz, s.path_seconds, rng)
    operator = bench.operator(rng)
    session = bench.session(operator, None, seed, path)
    script = operator.follow(
        path.begin, lambda now: path.finished(now - delay), lambda now: session.in_client_frame(path(now))
    )

    def judge(result: Result, ending: Ending, frames: list[SessionFrame], views: list[View]) -> str:
        tell(result, path, delay, frames, views)
        return failure(ending, views, session.refusals, path, s.interruption)

    return path, Staged("follow", seed, session, script, judge)


def tell(result: Result, path: Path, delay: float, frames: list[SessionFrame], views: list[View]) -> None:
    """How far the tip was from where the object had been `delay` s before, while that was on its way."""
    during = [frame for frame in frames if path.begun + delay <= frame.now <= path.begun + delay + path.seconds]
    if not during:
        return
    off = [float(np.linalg.norm(frame.truth.tip - path(frame.now - delay))) for frame in during]
    result.tip_mm, result.worst_mm = (1e3 * float(value) for value in np.quantile(off, (0.5, 0.95)))
    result.nearest_mm = 1e3 * min(off)
    wanted = [
        float(np.linalg.norm(view.tip - view.intent.follow.tip.position))
        for view in views
        if view.intent.follow is not None and view.now >= path.begun + delay
    ]
    result.robot_mm = 1e3 * float(np.median(wanted)) if wanted else float("nan")


def failure(ending: Ending, views: list[View], refusals: list[tuple[float, str]], path: Path, longest: float) -> str:
    """Why the path was not followed, "" if it was. The first of these that is so:

    1. The operator gave up, or the robot left off: why. How far the tip was from the object does not count.
    2. Nothing was looked at while the path went on: stopped.
    3. The robot stayed where it was for longer than `longest` s meanwhile: interrupted.
    """
    if not ending.done:
        return ending.why or "stopped: the operator gave up"
    if not any(path.begun <= view.now <= path.begun + path.seconds for view in views):
        return "stopped: the path was never begun"
    return interruption(views, refusals, path, longest)


def interruption(views: list[View], refusals: list[tuple[float, str]], path: Path, longest: float) -> str:
    """Why the robot stayed where it was for longer than `longest` s while the path went on; "" if it did not. It stays
    where targets are not followed, `refusals`: times and why; or where the core keeps the last ones, as it notices."""
    why = {now: reason for now, reason in refusals}
    since = None
    for view in views:
        if not path.begun <= view.now <= path.begun + path.seconds:
            continue
        reason = why.get(view.now) or ("out of reach" if STAYS in view.intent.notice else "")
        if not reason:
            since = None
            continue
        since = view.now if since is None else since
        if view.now - since > longest:
            return f"interrupted: {reason}"
    return ""
