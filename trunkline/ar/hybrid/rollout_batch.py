"""A preview that knows what it does not know: not one twin tries a plan but a batch of them.

The nominal twin, with all as it is believed, goes first and is shown as it is simulated. Then come futures, drawn from
what is not known (`uncertainty.py`): how far their tips spread, and the share of them that holds the object is the
probability that the grasp holds, with Wilson's interval. That interval says how many futures were asked, not how true
the model is.
"""

from collections.abc import Callable, Iterator
from dataclasses import dataclass

import numpy as np

from trunkline.ar.hybrid.outcomes import Criterion
from trunkline.ar.hybrid.rates import wilson
from trunkline.ar.hybrid.rollouts import FRAME, CommandTrajectory, ComposedTwin, Piece, rollouts
from trunkline.ar.hybrid.tip_uncertainty import TipUncertainty, TipUnknown
from trunkline.ar.hybrid.uncertainty import GraspUncertainty, PosteriorSamples, nominal_sample, sample

WITHIN = 0.9  # share of futures whose tips are within the spread
OFFSETS = 100  # draws of where the tip rests for each future: a quantile of a dozen is none
CONTACT = "the arm touches something, and in no trial did it"
TOUCHES = TipUnknown(CONTACT)
EVERY = 0.1  # s between the times at which a spread is stated


@dataclass(frozen=True)
class Stated:
    """What people are told of the tip: at `times` (n,), s, the robot's is within `radii` (n,), m, of the one that is
    shown, `tips` (n, 3), m, with probability WITHIN. Without radii where that is unknown."""

    times: np.ndarray
    tips: np.ndarray
    radii: np.ndarray


@dataclass(frozen=True)
class PlanPreview:
    """What may come of a plan. Positions in the world, m.

    Attributes:
        nominal: the motion of the twin as it is believed, B = 1.
        motion: of the B futures.
        samples: what each future has.
        success: which of them hold the object, or do what else was asked; None if nobody asked. Shape (B,).
        offsets: of the tip beside the futures', draws for each; None where they are unknown. Shape (B, D, 3).
        unknown: why they are unknown; "" where they are known.
        shift: by how far the arm's tip is beside the nominal twin's, where poses of the arm tell. Shape (F, 3).
    """

    nominal: Piece
    motion: Piece
    samples: PosteriorSamples
    success: np.ndarray | None
    offsets: np.ndarray | None = None
    unknown: str = CONTACT
    shift: np.ndarray | None = None

    @property
    def shown(self) -> np.ndarray:
        """The nominal path of the arm's tip. Shape (F, 3)."""
        return self.nominal.tip[0] if self.shift is None else self.nominal.tip[0] + self.shift

    @property
    def median(self) -> np.ndarray:
        """Path of the tip, the median of each coordinate, of sound futures. Shape (F, 3)."""
        return np.median(self.motion.tip[self.motion.sound], axis=0)

    @property
    def middle(self) -> int:
        """The future whose tip is nearest to the median on the whole: one that may be shown, its `qpos` is a pose."""
        away = np.linalg.norm(self.motion.tip - self.median, axis=2).mean(axis=1)
        return int(np.argmin(np.where(self.motion.sound, away, np.inf)))

    @property
    def spread(self) -> np.ndarray:
        """Distance from the median within which the tips of WITHIN of sound futures are, m. Shape (F,)."""
        away = np.linalg.norm(self.motion.tip[self.motion.sound] - self.median, axis=2)
        return np.quantile(away, WITHIN, axis=0)

    @property
    def stated(self) -> Stated:
        """Every EVERY s, as a page shows it; the last is of where the tip ends."""
        every = max(round(EVERY / FRAME), 1)
        radii = np.empty(0)
        if self.offsets is not None:
            futures = self.motion.tip[self.motion.sound] - self.nominal.tip[0]
            moved = futures[:, None, ::every] + self.offsets[self.motion.sound][:, :, None]
            radii = np.quantile(np.linalg.norm(moved, axis=3), WITHIN, axis=(0, 1))
        return Stated(self.motion.time[::every], self.shown[::every], radii)

    @property
    def probability(self) -> float | None:
        """Share of the futures that hold the object; one that MuJoCo warned of does not."""
        return None if self.success is None else float(self.success.mean())

    @property
    def interval(self) -> tuple[float, float] | None:
        """Of the probability, 95 %, Wilson's."""
        return None if self.success is None else wilson(int(self.success.sum()), len(self.success))


def nominal(twin: ComposedTwin, trajectory: CommandTrajectory) -> Iterator[Piece]:
    """The motion as it is believed, in pieces of a quarter of a second, each as soon as it is simulated."""
    return rollouts(twin, trajectory, nominal_sample())


def preview(
    twin: ComposedTwin,
    trajectory: CommandTrajectory,
    uncertainty: GraspUncertainty,
    holding: Criterion | None = None,
    count: int = 32,
    seed: int = 0,
    show: Callable[[Piece], None] = lambda piece: None,
    go_on: Callable[[], None] = lambda: None,
    tip: TipUncertainty | TipUnknown = TOUCHES,
) -> PlanPreview:
    """Try a plan in `count` futures.

    Args:
        holding: what is asked of the plan; None where nothing is grasped.
        show: called with each piece of the nominal motion, before any future is simulated.
        go_on: called before each piece, and after the last; what it raises ends the preview.
        tip: by how far it may be elsewhere at the plan's end, beside what is drawn; or why that is unknown.
    """
    begun, samples = [], sample(uncertainty, twin.arm, count, seed)
    for piece in interruptible(nominal(twin, trajectory), go_on):
        show(piece)
        begun.append(piece)
    motion = joined(list(interruptible(rollouts(twin, trajectory, samples), go_on)))
    success, believed = holding.holds(motion) if holding is not None else None, joined(begun)
    shift = None if tip.shift is None else tip.shift.at(believed.time)
    if isinstance(tip, TipUnknown):
        return PlanPreview(believed, motion, samples, success, None, tip.reason, shift)
    return PlanPreview(believed, motion, samples, success, offsets_of(tip, believed, count, seed), "", shift)


def offsets_of(tip: TipUncertainty, believed: Piece, count: int, seed: int) -> np.ndarray:
    """OFFSETS draws for each of `count` futures, where the nominal motion ends, m. Their own generator leaves the draws
    of everything else as they are. Shape (count, OFFSETS, 3)."""
    rng = np.random.default_rng([seed, OFFSETS])
    drawn = tip.offsets(believed.mount[0, -1], believed.tip[0, -1], count * OFFSETS, rng)
    return drawn.reshape(count, OFFSETS, 3)


def interruptible(pieces: Iterator[Piece], go_on: Callable[[], None]) -> Iterator[Piece]:
    """The pieces, `go_on` called before each and after the last."""
    go_on()
    for piece in pieces:
        yield piece
        go_on()


def joined(pieces: list[Piece]) -> Piece:
    """Pieces one after the other; sound is what is so at last."""
    along = {name: np.concatenate([getattr(piece, name) for piece in pieces], axis=1)
             for name in ("qpos", "tip", "mount", "object", "grip", "away")}  # fmt: skip
    return Piece(time=np.concatenate([piece.time for piece in pieces]), sound=pieces[-1].sound, **along)
