"""What corrections leave for later: the first error where a plan begins from them, and the tip that follows by them.

    python -m qualification.revisited [--targets 20]

The lab's arm is corrected by its cameras at a tip of its own, as in `qualification.seen`. Then it hangs again and is
sent there, or to tips of its own near there, at once: by commands that are made as a session makes them, without and
with what the corrections have measured. Likewise its tip follows targets that go evenly from there to the farthest of
these tips and back, at several speeds.
"""

import argparse
import sys
from collections.abc import Callable
from dataclasses import dataclass
from functools import partial

import numpy as np
import onnxruntime

from demo.plants.bench import COMMAND_RATE
from qualification.seen import FIRST_RAMP, NETWORK, ROWS, SEED, Corrected, DrawnPoses, correct, everyone
from trunkline.ar.session.correction_rests import learnt_in_base
from trunkline.ar.teleop.correction import Bent, corrected
from trunkline.errors import in_one_line
from trunkline.frames import STANDARD_GRAVITY
from trunkline.kinematics.ik.inference import ask
from trunkline.kinematics.ik.inputs import gravity_of, position_of
from trunkline.kinematics.residual.residual_map import ResidualMap
from upkeep.results import recorded

TARGETS = 20
APART = (0.0, 5e-3, 10e-3, 20e-3)  # m, of the pulls from where the arm was corrected
SPEEDS = (5e-3, 10e-3, 20e-3, 40e-3, 80e-3)  # m/s, of targets that are followed
PLACES = 9  # on their way at which commands are sought, linear between
SETTLE = 3.0  # s before they move

Commands = Callable[[np.ndarray], np.ndarray]  # of a tip, m, those that are to bring the arm there, m (K,)


@dataclass
class Visit:
    """first: m, errors of the tip at each of APART, without and with what was learnt; followed: m, rms, at each of
    SPEEDS. Shapes (2, ...)."""

    first: np.ndarray
    followed: np.ndarray


class Visits:
    """Of the poses that were drawn."""

    def __init__(self, count: int) -> None:
        self.drawn = DrawnPoses(count, np.random.default_rng(SEED + 1))
        self._network = partial(ask, onnxruntime.InferenceSession(NETWORK, providers=["CPUExecutionProvider"]))

    def visit(self, index: int, noise: np.random.Generator) -> Visit:
        drawn, (origin, turn) = self.drawn, self.drawn.frame
        gravity, target = gravity_of(drawn.targets[[index]])[0], drawn.targets[index].copy()
        pulls, aside = drawn.chain.straight_lengths - drawn.commands[index], noise.standard_normal(drawn.chain.tendons)
        aside = np.where(pulls > 0, aside, 0.0) / np.linalg.norm(np.where(pulls > 0, aside, 0.0))
        goals = [(self._bring(index, np.where(pulls > 0, np.maximum(pulls + far * aside, 1e-3), pulls), noise) - origin)
                 @ turn for far in APART]  # fmt: skip
        position_of(target[None])[:] = goals[0]
        plain = self._commands(target, gravity, None)
        first = correct(drawn.hanging(index), drawn.chain, target, plain(goals[0]), drawn.frame, noise)
        ways = plain, self._commands(target, gravity, self._learnt(first, gravity))
        straight = drawn.chain.straight_lengths
        errors = [[self._error(index, straight - way(goal), goal, noise) for goal in goals] for way in ways]
        followed = [self._followed(index, way, goals[0], goals[-1]) for way in ways]
        return Visit(np.array(errors), np.array(followed))

    def _learnt(self, first: Corrected, gravity: np.ndarray) -> ResidualMap | None:
        commands, tips = (np.array(part) for part in zip(*first.rests, strict=True))
        return learnt_in_base(self.drawn.chain, commands, np.tile(gravity, (len(tips), 1)), tips)

    def _commands(self, target: np.ndarray, gravity: np.ndarray, learnt: ResidualMap | None) -> Commands:
        down = gravity / STANDARD_GRAVITY

        def commands(goal: np.ndarray) -> np.ndarray:
            inputs = target[None].copy()
            position_of(inputs)[:] = goal
            answer = self._network(inputs)
            begin = Bent(*(answer[name][0].astype(float) for name in ("commands", "lengths", "tip")))
            x, y, z, gx, gy, gz = (float(value) for value in (*goal, *down))
            bent = corrected(self.drawn.chain, begin, (x, y, z), (gx, gy, gz), learnt)
            return begin.commands if bent is None else bent.commands

        return commands

    def _bring(self, index: int, pulls: np.ndarray, noise: np.random.Generator) -> np.ndarray:
        return self.drawn.hanging(index).bring(pulls, FIRST_RAMP, noise)[0]

    def _error(self, index: int, pulls: np.ndarray, goal: np.ndarray, noise: np.random.Generator) -> float:
        origin, turn = self.drawn.frame
        return float(np.linalg.norm((self._bring(index, pulls, noise) - origin) @ turn - goal))

    def _followed(self, index: int, way: Commands, near: np.ndarray, far: np.ndarray) -> list[float]:
        """Root mean square, m, at each of SPEEDS, of the tip's distance from targets that go from `near` to `far`, m,
        and back."""
        (origin, turn), places, errors = self.drawn.frame, np.linspace(0, 1, PLACES), []
        sought = self.drawn.chain.straight_lengths - np.array([way(near + share * (far - near)) for share in places])
        for speed in SPEEDS:
            arm = self.drawn.hanging(index)
            steps = max(round(float(np.linalg.norm(far - near)) / speed * COMMAND_RATE / ROWS), 1)
            shares = 1 - np.abs(np.linspace(-1, 1, 2 * steps + 1))
            sent = np.stack([np.interp(shares, places, pulls) for pulls in sought.T], axis=1)
            for step in np.linspace(0, 1, round(FIRST_RAMP * COMMAND_RATE / ROWS)):
                arm.advance(step * sent[0], ROWS)
            arm.advance(sent[0], round(SETTLE * COMMAND_RATE))
            tips = (np.array([arm.advance(pulls, ROWS) for pulls in sent]) - origin) @ turn
            errors.append(float(np.sqrt(np.mean(np.sum((tips - near - shares[:, None] * (far - near)) ** 2, axis=1)))))
        return errors


def table(head: str, places: tuple[float, ...], unit: str, errors: np.ndarray) -> list[str]:
    """errors: m, without and with, at each place. Shape (N, 2, places). Where an arm does not rest it counts as inf."""
    lines = [f"| {head} | {' | '.join(f'{1e3 * place:g}' for place in places)} {unit} |"]
    lines.append(f"|---|{'---:|' * len(places)}")
    errors = 1e3 * np.where(np.isfinite(errors), errors, np.inf)
    for row, name in enumerate(("without", "with")):
        for word, share in (("median", 0.5), ("95th percentile", 0.95)):
            values = np.quantile(errors[:, row], share, axis=0, method="higher")
            lines.append(f"| {name}, {word} | {' | '.join(f'{value:.2f}' for value in values)} |")
    worse = (errors[:, 1] > errors[:, 0] + 2).sum(axis=0)
    lines.append(f"| farther off by 2 mm with it, of {len(errors)} | {' | '.join(map(str, worse))} |")
    return lines


def measure(targets: int) -> None:
    visits = everyone("visits", Visits(targets).visit, targets)
    first = table("first error, mm, so far from where it was corrected:", APART, "mm of pulls",
                  np.array([visit.first for visit in visits]))  # fmt: skip
    followed = table("error as it follows, mm rms, at", SPEEDS, "mm/s", np.array([visit.followed for visit in visits]))
    print("\n".join([*first, "", *followed]))


@in_one_line
def main() -> int:
    parser = argparse.ArgumentParser(prog="qualification.revisited", description=__doc__)
    parser.add_argument("--targets", type=int, default=TARGETS)
    args = parser.parse_args()
    with recorded("revisited", keep=args.targets >= TARGETS):
        measure(args.targets)
    return 0


if __name__ == "__main__":
    sys.exit(main())
