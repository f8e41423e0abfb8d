"""Poses at rest as an arm is driven later: drawn as `train_ik` draws them, with those dropped in which it cannot rest.

One or two neighbouring motors of every section pull by random amounts, the others are loose (`as_controls`). Mounts are
tilted by random angles to random sides. A lab turns a mount by hand, so several poses share one.
"""

from dataclasses import dataclass

import mujoco
import numpy as np

from trunkline.errors import InputError
from trunkline.frames import STANDARD_GRAVITY, downwards
from trunkline.identification.parameters.spool_scale import wound
from trunkline.kinematics.dataset.sampling import COARSE_POWER, COARSE_STEPS
from trunkline.kinematics.ik.as_controls import NEAR_LIMIT, PULL_SHARE, draw_commands
from trunkline.model.arm_model import ArmModel
from trunkline.model.statics.chain import Chain
from trunkline.model.statics.equilibria import equilibrium_paths
from trunkline.report.certificate.arms import arm_of
from trunkline.report.certificate.poses import StaticPoses

LOOKS = 16  # directions of gravity of the data set, under which the deepest pulls are looked for
AT_ONCE = 8  # poses drawn together, at least
ROUNDS = 30  # of draws for one mount, after which poses that can be recorded are too rare
STEP = 1e-4  # m, to which pulls are rounded
SPARE, MARGIN = 1.25, 0.02  # a loose cable is let out by so many times what a pose needs, and so much more, m
OUT_STEP = 0.01  # m, to which that is rounded up


@dataclass(frozen=True)
class Mounts:
    """How a lab can hold the arm.

    count: mounts, at most. tilt_deg: largest. sides_deg: to which they tilt; empty for any. standing: whether the arm
    stands on its mount where that is not tilted, and does not hang. weightless: whether gravity counts for nothing.
    """

    count: int
    tilt_deg: float = 0.0
    sides_deg: tuple[float, ...] = ()
    standing: bool = False
    weightless: bool = False

    def draw(self, count: int, rng: np.random.Generator) -> np.ndarray:
        """Angle and azimuth of mounts for `count` poses, whole degrees; one where all would be alike. Shape (M, 2)."""
        if not self.tilt_deg:
            return np.zeros((1, 2))
        mounts = min(self.count, count)
        tilts = np.minimum(np.round(rng.uniform(0, self.tilt_deg, mounts)), self.tilt_deg)
        sides = rng.choice(self.sides_deg, mounts) if self.sides_deg else np.round(rng.uniform(0, 360, mounts))
        return np.column_stack([tilts, sides % 360])

    def gravity(self, mounts: np.ndarray) -> np.ndarray:
        """What pulls at the arm on `mounts` (M, 2), m/s², in the frame of the tracked base. Shape (M, 3)."""
        tilts, sides = np.radians(mounts).T
        down = downwards(tilts, sides) * [1, 1, -1 if self.standing else 1]
        return np.zeros((len(mounts), 3)) if self.weightless else STANDARD_GRAVITY * down

    def inputs(self, place: np.ndarray) -> np.ndarray:
        """Gravity's angle on the mount at `place` (2,), as `draw_commands` takes it. Shape (1, 0 or 1)."""
        angle = np.radians([place[:1]])
        return angle[:, :0] if self.weightless else np.pi - angle if self.standing else angle


@dataclass(frozen=True)
class PosesToRecord:
    """N poses.

    mounts: angle and azimuth of the mount, deg. Shape (N, 2). pulls: that each motor is sent, from the straight arm, m;
    less than zero where it is loose. Shape (N, K). tips: where the twin's tip then rests, in the frame of the tracked
    base, m. Shape (N, 3). near_limit, unrested: how many others were dropped as a motor was near its limit, or as the
    twin did not rest.
    """

    mounts: np.ndarray
    pulls: np.ndarray
    tips: np.ndarray
    near_limit: int
    unrested: int

    def __len__(self) -> int:
        return len(self.pulls)

    def __getitem__(self, rows: np.ndarray) -> "PosesToRecord":
        return PosesToRecord(self.mounts[rows], self.pulls[rows], self.tips[rows], self.near_limit, self.unrested)


class PoseSampler:
    """Where poses of `model` are drawn.

    Args:
        downs: directions of gravity of the data set. Shape (G, 3).
        stroke: m, that no motor draws in further; None for as far as its force goes.

    Raises:
        InputError: a motor draws nothing in, or a cable does not bend the arm from its mount on.
    """

    def __init__(self, model: mujoco.MjModel, downs: np.ndarray, stroke: float | None) -> None:
        self._arm = arm_of(model)
        self.names = ArmModel(model).cable_names
        late = [name for name, first in zip(self.names, self._arm.chain.crosses[0], strict=True) if not first]
        if late:
            problem = f"found cables that bend it only behind its first unit, such as {late[0]}"
            raise InputError(f"model: {problem}, expected none: poses of such arms cannot be drawn")
        straight = model.tendon_length0[model.actuator_trnid[:, 0]]
        sent = (straight - wound(model, np.stack([straight, straight - 1.0])))[:, ArmModel(model).actuators]
        self._zero, self._scale = sent[0], sent[1] - sent[0]  # of cable drawn in, where 0 and for each m that is sent
        looks = np.linspace(0, len(downs) - 1, min(LOOKS, len(downs))).astype(int)
        deepest = deepest_pulls(self._arm.chain, STANDARD_GRAVITY * downs[looks])
        self._deepest = deepest if stroke is None else np.minimum(deepest, stroke)
        if not (self._deepest > 0).all():
            short = ", ".join(name for name, deep in zip(self.names, self._deepest, strict=True) if not deep > 0)
            raise InputError(f"model: {short}: found no pull by which its motor's force draws it in, expected one")

    @property
    def deepest(self) -> np.ndarray:
        """By which each motor, alone, is sent to draw in with all its force, m. Shape (K,)."""
        return (self._deepest - self._zero) / self._scale

    def draw(self, count: int, mounts: Mounts, pull: float | None, rng: np.random.Generator) -> PosesToRecord:
        """`count` poses, mounts one after another.

        Args:
            pull: m, that a motor is sent at most; None for `PULL_SHARE` of the deepest.

        Raises:
            InputError: too few of the poses that were drawn can be recorded.
        """
        reach = PULL_SHARE * self._deepest
        if pull is not None:
            reach = np.minimum(self._zero + self._scale * pull, self._deepest)
        places = mounts.draw(count, rng)
        shares = count // len(places) + (np.arange(len(places)) < count % len(places))
        parts = [self._of_mount(place, share, mounts, reach, rng) for place, share in zip(places, shares, strict=True)]
        sent, loose, tips, longer = map(np.concatenate, zip(*(rows for rows, _ in parts), strict=True))
        needed = float(longer[loose].max(initial=0.0))
        out = (-(SPARE * needed + MARGIN) - self._zero) / self._scale
        sent = np.where(loose, np.floor(out.min() / OUT_STEP) * OUT_STEP, sent)
        near_limit, unrested = np.sum([dropped for _, dropped in parts], axis=0).tolist()
        return PosesToRecord(np.repeat(places, shares, axis=0), sent, tips, near_limit, unrested)

    def _of_mount(
        self, place: np.ndarray, count: int, mounts: Mounts, reach: np.ndarray, rng: np.random.Generator
    ) -> tuple[tuple[np.ndarray, ...], np.ndarray]:
        """Of `count` poses on the mount at `place` (2,): what is sent, m, which cables are loose, tips, m, and by how
        much paths are longer than in the straight arm, m. And how many were dropped near the limit and at no rest."""
        chain, rows, dropped = self._arm.chain, [], np.zeros(2, int)
        for _ in range(ROUNDS):
            missing = count - sum(len(tips) for _, _, tips, _ in rows)
            sent, loose = self._drawn(mounts.inputs(place), reach, max(2 * missing, AT_ONCE), rng)
            gravity = np.repeat(mounts.gravity(place[None]), len(sent), axis=0)
            rest = self._arm.rest(StaticPoses(gravity, chain.straight_lengths - sent))
            rested = rest.converged & ~rest.snapped
            near_limit = ~(rest.tensions < NEAR_LIMIT * chain.max_tension).all(axis=1)
            good = np.flatnonzero(rested & ~near_limit)[:missing]
            looked = slice(None) if len(good) < missing else slice(good[-1] + 1)
            dropped += [(rested & near_limit)[looked].sum(), (~rested)[looked].sum()]
            longer = rest.lengths - chain.straight_lengths
            rows.append(tuple(values[good] for values in (sent, loose, self._arm.placed(rest), longer)))
            if len(good) == missing:
                return tuple(np.concatenate(values) for values in zip(*rows, strict=True)), dropped
        problem = f"found {count - missing + len(good)} poses that can be recorded, expected {count}"
        raise InputError(f"the mount at {place[0]:g}° towards {place[1]:g}°: {problem}: a smaller --pull or --tilt")

    def _drawn(
        self, gravity: np.ndarray, reach: np.ndarray, count: int, rng: np.random.Generator
    ) -> tuple[np.ndarray, np.ndarray]:
        """What motors are sent, m, loose cables let out by the arm's length, and which are loose. Shapes (N, K).
        gravity: as `Mounts.inputs`."""
        chain = self._arm.chain
        _, commands = draw_commands(chain, gravity, reach, count, rng, others_pay_out=True)
        pulls = chain.straight_lengths - commands
        return np.floor((pulls - self._zero) / self._scale / STEP) * STEP, pulls < -0.99 * chain.length


def deepest_pulls(chain: Chain, gravities: np.ndarray) -> np.ndarray:
    """By which each motor, none of the others pulling, draws its tendon in with all its force, m: under which gravity
    it does most. Shape (K,).

    Args:
        gravities: m/s². Shape (G, 3).
    """
    shares, deepest = np.linspace(0, 1, COARSE_STEPS) ** COARSE_POWER, np.zeros(chain.tendons)
    for tendon in range(chain.tendons):
        ways = np.zeros((len(gravities), COARSE_STEPS, chain.tendons))
        ways[..., tendon] = shares * chain.max_tension[tendon]
        paths = equilibrium_paths(chain, ways, gravities)
        steady = paths.converged & ~paths.snapped
        drawn_in = (chain.straight_lengths - paths.commands)[steady, tendon]
        deepest[tendon] = drawn_in.max(initial=0.0)
    return deepest
