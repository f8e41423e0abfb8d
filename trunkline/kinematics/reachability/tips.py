"""Tips of the soft arm at any gravity angle, and the tendon lengths that bring it there."""

from collections.abc import Callable
from dataclasses import dataclass
from typing import NamedTuple

import numpy as np

from trunkline.frames import gravity_in_base
from trunkline.kinematics.dataset.sampling import sample_at, sections
from trunkline.kinematics.residual.residual_map import ResidualMap
from trunkline.model.statics.chain import Chain

LOOK_EVERY = 4  # rays: along those between, a sample is at most a twentieth of the way from where it would else be


class Tips(NamedTuple):
    """`positions` (N, 3) in the arm's base frame and the tendons' path `lengths` (N, K), in m."""

    positions: np.ndarray
    lengths: np.ndarray


TipSource = Callable[[float], Tips]  # from a gravity angle in rad


@dataclass
class ArmTips:
    """A `TipSource`: the samples at the sampled angles, fresh equilibria at the others.

    `angles` (A,) in rad, ascending, and `samples` at each; `directions` and `steps` as in
    `dataset.sampling.sample_at`; `seed` of the fresh ones, the same for an angle whatever others are asked. `largest`:
    rad, of gravity from any side, if the samples have that; then `angles` are those that are shown. `unseen`: of an arm
    without gravity, whose one angle stands for all: samples that no map is made of. `deepest` and
    `learnt` as for `sample_at`.
    """

    chain: Chain
    angles: np.ndarray
    samples: list[Tips]
    directions: int
    steps: int
    seed: int
    largest: float | None = None
    unseen: Tips | None = None
    deepest: np.ndarray | None = None
    learnt: ResidualMap | None = None

    def __call__(self, angle: float) -> Tips:
        if self.unseen is not None:
            return self.samples[0]
        sampled = np.flatnonzero(np.abs(self.angles - angle) < 1e-6)
        if sampled.size:
            return self.samples[sampled[0]]
        return self.fresh(angle)

    def fresh(self, angle: float) -> Tips:
        """Equilibria under gravity at `angle` (rad), the mount tilting about base +y."""
        rng = np.random.default_rng([self.seed, round(1e6 * angle)])
        gravity = gravity_in_base(angle)
        how = self.directions, self.steps, rng, LOOK_EVERY, self.deepest, self.learnt
        rest = sample_at(self.chain, gravity, *how).equilibrium
        return Tips(rest.position, held_by(self.chain, rest.lengths, rest.tensions))


def held_by(chain: Chain, lengths: np.ndarray, tensions: np.ndarray) -> np.ndarray:
    """Lengths (N, K), m, of cables that hold equilibria of path `lengths`: of an arm of several sections, what is slack
    is paid out, as cables that run at one distance from the axis are else drawn in against each other."""
    return lengths + (tensions == 0) * chain.length if len(sections(chain)) > 1 else lengths
