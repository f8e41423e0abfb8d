"""Whose error is it that the tip is beside what it follows? The distance taken apart, in a few runs of `follow`.

    python -m studies.follow_shares [--runs 4] [--package artifacts/package_unity/...tgz]

At time t, with d the set delay, all in the frame that the client takes for the robot's base:

    tip(t) - object(t - d) =   target(t - d) - object(t - d)     operator: aim, tremor, depth, lag, and filter
                             + twin(t) - target(t - d)           following: look-ahead, network, limits
                             + still(t) - twin(t)                model: the stand-in's tip beside the twin's
                             + tip(t) - still(t)                 swinging
                             + seen(t) - tip(t)                  alignment of the base

twin(t) is where the twin's tip rests under what the robot is sent at t; still(t) is the stand-in's tip, a mean over
two periods of the slowest swing. Each is the median of its length in a run. The operator's figures weigh most, so there
are rows, too, of one who foresees nothing of the path, and of one whose errors are twice as large.
"""

import argparse
from dataclasses import dataclass, replace
from pathlib import Path

import numpy as np

from rehearsal.experiments.bench import Bench, SessionFrame, bench_of, rehearse
from rehearsal.experiments.follow import Path as Way
from rehearsal.experiments.follow import on_path
from rehearsal.operator.hands import Person
from rehearsal.session import Session, View
from trunkline.ar.preview.package import only_package
from trunkline.frames import STANDARD_GRAVITY
from trunkline.kinematics.panda.kinematics import mount_pose
from trunkline.model.statics.equilibria import actuated
from upkeep.results import recorded

RATE = 60.0  # frames, Hz
EVERY = 6  # frames of which the twin's rest is looked up; linear between
SHARES = ("whole", "operator", "following", "model", "swinging", "alignment")


@dataclass
class Run:
    """Of a script, `frames` from where the robot began to move, and all `views`."""

    path: Way
    session: Session
    frames: list[SessionFrame]
    views: list[View]


def run(bench: Bench, seed: int) -> Run:
    path, staged = on_path(bench, seed)
    _, frames, views = rehearse(staged.session, staged.script)
    return Run(path, staged.session, frames, views)


@recorded("follow_shares")
def main() -> None:
    parser = argparse.ArgumentParser()
    parser.add_argument("--runs", type=int, default=4)
    parser.add_argument("--package", type=Path, default=None)
    given = parser.parse_args()
    package = given.package or only_package()
    bench = bench_of(package)
    print("| operator | seed | " + " | ".join(SHARES) + " | operator's lag |")
    print("|---|---:|" + "---:|" * (len(SHARES) + 1))
    for name, person in people(bench.person).items():
        one, rows = replace(bench, person=person), []
        for seed in range(given.runs):
            found = run(one, seed)
            rows.append([*shares(one, found), operators_lag(one, found)])
            tell(name, str(seed), rows[-1])
        tell(name, "median", np.median(rows, axis=0))


def people(person: Person) -> dict[str, Person]:
    """Operators by what is different of them."""
    return {
        "typical": person,
        "foresees nothing": replace(person, forecast=0.0),
        "notices half as well": replace(person, unnoticed_deg=2 * person.unnoticed_deg),
    }


def tell(name: str, seed: str, row) -> None:
    *lengths, lag = row
    print(f"| {name} | {seed} | " + " | ".join(f"{1e3 * m:.1f} mm" for m in lengths) + f" | {1e3 * lag:.0f} ms |",
          flush=True)  # fmt: skip


def shares(bench: Bench, found: Run) -> list[float]:
    """Median length, m, of each of SHARES."""
    path, session, delay = found.path, found.session, bench.config.core.follow_delay
    targets = {view.now: wanted.tip.position for view in found.views if (wanted := view.intent.follow)}
    frames = [f for f in found.frames if path.begun + delay <= f.now <= path.begun + delay + path.seconds]
    tip = np.array([frame.truth.tip for frame in frames])
    target = np.array([targets[frame.now] for frame in frames])
    thing = np.array([session.in_client_frame(path(frame.now - delay)) for frame in frames])
    seen = np.array([session.in_client_frame(place) for place in tip])
    twin = rests(bench, np.array([f.joints for f in frames]), np.array([f.commands for f in frames]))
    still = mean_over(tip, round(2 * bench.package.period * RATE))
    parts = (seen - thing, target - thing, twin - target, still - twin, tip - still, seen - tip)
    return [float(np.median(np.linalg.norm(part, axis=1))) for part in parts]


def rests(bench: Bench, joints: np.ndarray, commands: np.ndarray) -> np.ndarray:
    """Where the twin's tip rests with the robot at `joints` (T, 7) and `commands` (T, K), m, (T, 3)."""
    chosen = np.unique([*range(0, len(joints), EVERY), len(joints) - 1])
    place, turn = mount_pose(joints[chosen], bench.config.mount_offset)
    turn = turn @ np.diag([1.0, -1.0, -1.0])  # the arm's frame is half a turn about x from the mount's
    gravity = -STANDARD_GRAVITY * turn[:, 2]
    found = actuated(bench.package.chain, commands[chosen], gravity).position
    tips = place + np.einsum("tij,tj->ti", turn, found)
    return np.column_stack([np.interp(range(len(joints)), chosen, axis) for axis in tips.T])


def mean_over(rows: np.ndarray, count: int) -> np.ndarray:
    """Running mean of `rows` (T, 3) over about `count` of them, fewer at the ends."""
    half, total = count // 2, np.cumsum(np.vstack([np.zeros(3), rows]), axis=0)
    low = np.maximum(np.arange(len(rows)) - half, 0)
    high = np.minimum(np.arange(len(rows)) + half + 1, len(rows))
    return (total[high] - total[low]) / (high - low)[:, None]


def operators_lag(bench: Bench, found: Run) -> float:
    """By how much the tip target is behind the object, s: the shift by which both differ least."""
    path, lags = found.path, np.arange(-0.2, 0.6, 0.01)
    shown = [(view.now, now.tip.position) for view in found.views if (now := view.intent.targets)]
    times, target = zip(*((now, tip) for now, tip in shown if 1 <= now - path.begun <= path.seconds), strict=True)

    def apart(lag: float) -> float:
        thing = np.array([found.session.in_client_frame(path(now - lag)) for now in times])
        return float(((target - thing) ** 2).sum())

    return float(min(lags, key=apart))


if __name__ == "__main__":
    main()
