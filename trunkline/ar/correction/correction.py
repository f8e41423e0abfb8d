"""Commands corrected by where cameras see the tip, step by step, until it is at its target or no step may follow.

With e the way that is missing and J = ∂tip/∂pull, a step is

    min |J δp - e|² + CAUTION δpᵀ P δp,   over steps in which no cable pushes,   scaled to a radius,

P being the covariance of each row of J: of errors of J that are independent from row to row, this is the mean of what
is missing after the step (CAUTION 3, the tip's coordinates). J and P begin with the twin and learn from each step as a
Kalman filter of constant J does (K. J. Åström, B. Wittenmark, Adaptive Control, 1995, sections 2.2 and 7.5), so that
the arm's own answer, once to twice as strong as the twin's in trials, soon takes the twin's place.

A loose cable is wound up where those that pull leave much of the way, as in trials it began to pull elsewhere than the
twin says. No step changes the commands by more than `longest` in all, so that it may take several; a cable that lies
too far away for the steps that are left stays loose.

The radius halves with a step that left the tip farther off. The best command so far is never lost: it is the last one
that is sent.
"""

from dataclasses import dataclass
from typing import Annotated

import numpy as np
from pydantic import Field
from scipy.optimize import lsq_linear

from trunkline.model.statics.chain import Chain
from trunkline.model.statics.equilibria import Equilibrium, actuated
from trunkline.model.statics.sensitivity import sensitivity

CAUTION = 3.0
UNSURE = 0.3  # of the twin's J, root mean square of its columns, standard deviation
FRICTION = 0.5e-3  # m by which a step may end elsewhere than J says, as cables rub, standard deviation
WORSE = 0.3e-3  # m farther off than before, beyond what a measurement scatters, that make a step a bad one
STRONGEST = 0.95  # of a motor's largest force, that a step may ask of it
BEGINS = 1e-3  # m beyond where the twin says that a loose cable pulls, that a step winds it at most
AWAY = 1e-3  # m by which a loose cable that pulls sooner than the twin says may take the tip farther off
RELUCTANT = 0.5  # of what is missing, that cables which pull must leave before a loose one is wound up
NEGLIGIBLE = 1e-5  # m, change of a command that is not sent: a loose cable stays loose

Metres = Annotated[float, Field(gt=0, le=0.1)]


@dataclass(frozen=True)
class CorrectionSettings:
    """tolerance: m from the target, within which the tip has arrived. steps: at most. longest: m, change of commands
    in a step. steepest: m of the tip's way for 1 m of one motor's, from which on the arm is near snapping through.
    astray: m that the tip may be off: beyond, the twin or the cameras are wrong, which no step mends. misplaced: m that
    the cameras may see the arm's mount from where the joints have it: beyond, the pose of their frame is wrong."""

    tolerance: Metres = 0.8e-3
    steps: Annotated[int, Field(ge=1, le=20)] = 5
    longest: Metres = 5e-3
    steepest: Annotated[float, Field(gt=0, le=1000)] = 15.0
    astray: Metres = 30e-3
    misplaced: Metres = 5e-3


class TipCorrection:
    """Of one arm at rest, whose tip is to be at one target.

    Attributes:
        commands: to be sent now, or, once it has ended, to stay at, m. Shape (K,).
        ended: why there is no further step, "" while there is one.
        errors: m, of the tip at each measurement so far.
    """

    def __init__(
        self, chain: Chain, gravity: np.ndarray, target: np.ndarray, commands: np.ndarray, settings: CorrectionSettings
    ) -> None:
        """chain: of the twin. gravity (3,), m/s², and target (3,), m: in the frame of its base. commands (K,): m, under
        which the arm rests now."""
        self._chain, self._gravity, self._target, self._settings = chain, gravity, target, settings
        self.commands, self.ended, self.errors = np.array(commands, float), "", []
        self._best, self._radius = self.commands, settings.longest
        self._rest, tendons = actuated(chain, self.commands[None], gravity), chain.tendons
        self._jacobian = tip_by_pulls(chain, self._rest, gravity) if self._rest.converged[0] else np.zeros((3, tendons))
        scatter = UNSURE * np.linalg.norm(self._jacobian) / np.sqrt(tendons)
        self._variance = scatter**2 * np.eye(tendons)
        self._step: tuple[np.ndarray, np.ndarray] | None = None  # the last one's change of pulls, and the tip before

    @property
    def arrived(self) -> bool:
        return bool(self.errors) and min(self.errors) <= self._settings.tolerance

    def measured(self, tip: np.ndarray) -> None:
        """The arm rests under `commands` with its tip at `tip`, m, (3,): what to send next, or that it ends."""
        settings, missing = self._settings, self._target - tip
        error = float(np.linalg.norm(missing))
        self._learn(tip)
        bad = bool(self.errors) and error > min(self.errors) + WORSE
        if not self.errors or error < min(self.errors):
            self._best = self.commands
        self.errors.append(error)
        if not error <= settings.astray:
            self._end(f"the tip is {1e3 * error:.0f} mm off, expected at most {1e3 * settings.astray:.0f} mm")
        elif error <= settings.tolerance:
            self._end("arrived")
        elif len(self.errors) > settings.steps:
            self._end(f"{settings.steps} steps are done")
        else:
            self._radius /= 2 if bad else 1
            self._take_step(tip, missing)

    def refuse(self, reason: str) -> None:
        """End it from outside: what the cameras send is not sound, say, or something touches the arm."""
        self._end(reason)

    def _end(self, reason: str) -> None:
        self.ended, self.commands = reason, self._best

    def _learn(self, tip: np.ndarray) -> None:
        """Mend the Jacobian by the last step."""
        if self._step is None:
            return
        change, before = self._step
        at_change = self._variance @ change
        gain = at_change / (change @ at_change + FRICTION**2)
        self._jacobian = self._jacobian + np.outer(tip - before - self._jacobian @ change, gain)
        self._variance = self._variance - np.outer(gain, at_change)

    def _take_step(self, tip: np.ndarray, missing: np.ndarray) -> None:
        chain, rest = self._chain, self._rest
        if not rest.converged[0]:
            return self._end("the twin does not rest under these commands")
        if not np.isfinite(self._jacobian).all():
            return self._end("the twin is near snapping through under these commands")
        change = self._change(missing)
        moving = change != 0
        if not moving.any():
            return self._end("no motor brings the tip nearer")
        steep = np.linalg.norm(self._jacobian[:, moving], axis=0).max(initial=0.0)
        if steep > self._settings.steepest:
            return self._end(f"the tip moves {steep:.0f} mm for 1 mm of a motor: near snapping through")
        wanted = np.where(moving, np.minimum(self.commands, rest.lengths[0]) - change, self.commands)
        way = shortened(wanted - self.commands, self._settings.longest)
        began = moving & (rest.tensions[0] == 0)  # at which command a loose cable really pulls, the twin says about
        share = self._not_farther(missing, way, began & (way < 0))
        if not np.isfinite(share):
            return self._end("the twin is near snapping through once its loose cables pull")
        commands = self.commands + share * way
        foreseen = actuated(chain, commands[None], self._gravity)
        if not foreseen.converged[0] or (foreseen.tensions[0] > STRONGEST * chain.max_tension).any():
            return self._end("a motor would be at its largest force")
        self._step = None if began.any() else (change, tip)
        self.commands, self._rest = commands, foreseen

    def _not_farther(self, missing: np.ndarray, way: np.ndarray, wound: np.ndarray) -> float:
        """The share of a step `way`, m, (K,), after which the tip is farther off by AWAY at most, if the loose cables
        that it winds, `wound`, (K,), pull from its beginning on, each alone or all of them: in trials some did, where
        the twin's were loose by mm. NaN where that is not known."""
        taut = tip_by_pulls(self._chain, self._rest, self._gravity, wound) if wound.sum() > 1 else self._jacobian
        distance = np.linalg.norm(missing)
        room = (distance + AWAY) ** 2 - distance**2
        share = 1.0
        for tip in (-self._jacobian @ way, -taut @ way):
            along, square = missing @ tip, np.maximum(tip @ tip, NEGLIGIBLE**2)
            share = float(np.minimum(share, (along + np.sqrt(along**2 + square * room)) / square))
        return share

    def _change(self, missing: np.ndarray) -> np.ndarray:
        """Of the pulls, m. Shape (K,)."""
        loose = self._rest.tensions[0] == 0
        wound = self._rest.lengths[0] - self.commands
        near = wound > -self._settings.longest * (self._settings.steps - len(self.errors))  # a step is left to pull
        change = self._least_squares(missing, wound, loose)
        if np.linalg.norm(missing - self._jacobian @ change) > RELUCTANT * np.linalg.norm(missing):
            change = self._least_squares(missing, wound, loose & ~near)
        change = np.where(np.abs(change) > NEGLIGIBLE, change, 0.0)
        return shortened(change, self._radius)

    def _least_squares(self, missing: np.ndarray, wound: np.ndarray, idle: np.ndarray) -> np.ndarray:
        """Of the pulls, m, before it is shortened, for which the cables `idle`, (K,), stay loose. Shape (K,)."""
        caution = np.linalg.cholesky(CAUTION * self._variance).T
        rows, sought = np.vstack([self._jacobian, caution]), np.append(missing, np.zeros(len(wound)))
        most = np.where(idle, NEGLIGIBLE, np.where(self._rest.tensions[0] > 0, np.inf, BEGINS))
        return lsq_linear(rows, sought, (-np.maximum(wound, 0.0) - NEGLIGIBLE, most)).x


def shortened(vector: np.ndarray, longest: float) -> np.ndarray:
    """Of at most the length `longest`, with its direction. Shape as before."""
    return vector * min(1.0, longest / max(float(np.linalg.norm(vector)), NEGLIGIBLE))


def tip_by_pulls(chain: Chain, rest: Equilibrium, gravity: np.ndarray, taut: np.ndarray | bool = False) -> np.ndarray:
    """The tip's way by each motor's pull, m/m, of an arm at rest; of a motor whose cable is loose, once it is taut. The
    others that pull stay where they are. NaN where the arm rests only because its motors hold their place, as one that
    is about to snap through may. Shape (3, K).

    Args:
        rest: of one arm. gravity: m/s². Shape (3,).
        taut: cables that count as pulling where they are, as those do that really pull. Shape (K,).
    """
    pulls = (rest.tensions[0] > 0) | taut
    slopes = sensitivity(chain, rest.qpos, rest.tensions, gravity)
    tip, length = slopes.tip_by_tension[0], slopes.length_by_tension[0]
    jacobian, pulling = np.zeros((3, chain.tendons)), [int(motor) for motor in np.flatnonzero(pulls)]
    for motor in range(chain.tendons):
        motors = pulling if motor in pulling else [*pulling, motor]
        pull_by_tension = np.diag(1 / chain.gain[motors]) - length[np.ix_(motors, motors)]
        jacobian[:, motor] = (tip[:, motors] @ np.linalg.inv(pull_by_tension))[:, motors.index(motor)]
    return jacobian
