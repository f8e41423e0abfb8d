"""The network's answer made exact: a few steps nearer to the target, and where the arm then really comes to rest.

Up to three Gauss-Newton steps of `ik.refine` bring the tip nearer, its orientation left free. Tension that all tendons
share is then released: it hardly moves the tip, as it bends an arm with evenly spread tendons nowhere, but where a
target is a little out of reach the steps find it, and it makes friction and motors decide where the tip ends. What is
said of the tip is the equilibrium under the commands themselves, as they are sent (`statics.equilibria.actuated`).
"""

from typing import NamedTuple

import numpy as np

from trunkline.ar.teleop.vectors import IDENTITY, Vector
from trunkline.frames import STANDARD_GRAVITY
from trunkline.kinematics.dataset.sampling import sections
from trunkline.kinematics.ik.refine import refine
from trunkline.kinematics.residual.residual_map import ResidualMap, RestingPoses
from trunkline.model.statics.chain import Chain
from trunkline.model.statics.equilibria import actuated

LEVER = 1e-6  # m that a turn of the tip by 1 rad counts: nothing
ROUNDS = 2  # with a residual map: the network's answer knows of it, so that commands hardly change in the second
SURPRISE = 5e-3  # m by which the tip may be further from its target than foreseen before another start is tried


class Bent(NamedTuple):
    """`commands` of the motors and the tendons' `lengths` (K,), m, and where the `tip` is foreseen, m, (3,), in the
    base frame."""

    commands: np.ndarray
    lengths: np.ndarray
    tip: np.ndarray


def corrected(
    chain: Chain, first: Bent, tip: Vector, gravity: Vector, learnt: ResidualMap | None = None
) -> Bent | None:
    """An answer by which the tip rests nearer to `tip` (m) than by the `first`, where it can; None where the arm finds
    no rest. `gravity` is a unit vector; all in the soft arm's base frame.

    Tendons slide without friction: real ones stay within what it holds on either side. With a residual map, what is
    said of tips is of the arm, whose twin is then to come to the target less the map.
    """
    if learnt is None:
        return _corrected(chain, first, np.array(tip), gravity)
    bent = first
    for _ in range(ROUNDS):
        shift = shift_of(learnt, chain, bent.commands, gravity)
        nearer = _corrected(chain, first._replace(tip=first.tip - shift), np.array(tip) - shift, gravity)
        if nearer is None:
            return None
        bent = nearer
    return bent._replace(tip=bent.tip + shift_of(learnt, chain, bent.commands, gravity))


def shift_of(learnt: ResidualMap, chain: Chain, commands: np.ndarray, gravity: Vector) -> np.ndarray:
    """By how far the tip rests beside that of the twin `chain` under `commands` (K,), m, and `gravity`, a unit vector,
    in the soft arm's base frame. Shape (3,), m."""
    pull = STANDARD_GRAVITY * np.array([gravity])
    return learnt.mean(RestingPoses.of_commands(chain, commands[None], pull))[0]


def _corrected(chain: Chain, first: Bent, tip: np.ndarray, gravity: Vector) -> Bent | None:
    """Of the twin's tip."""
    chain, pull, target = chain.smooth, STANDARD_GRAVITY * np.array(gravity), np.array([[*gravity, *tip, *IDENTITY]])

    def sent(lengths: np.ndarray) -> Bent | None:
        better = refine(chain, target, lengths[None], lever=LEVER)
        return _released(chain, better.commands if better.converged[0] else first.commands[None], pull)

    foreseen, improved = np.linalg.norm(first.tip - tip), sent(first.lengths)
    if improved is not None and np.linalg.norm(improved.tip - tip) <= foreseen + SURPRISE:
        return improved
    # cables of lengths that do not belong together may hold another shape than motors with those commands do
    at_rest = _released(chain, first.commands[None], pull)
    again = [bent for bent in (improved, at_rest and sent(at_rest.lengths), at_rest) if bent is not None]
    return min(again, key=lambda bent: float(np.linalg.norm(bent.tip - tip)), default=None)


def _released(chain: Chain, commands: np.ndarray, pull: np.ndarray) -> Bent | None:
    """Where the arm rests under `commands` (1, K), once every tendon of a section of three or more has less tension by
    that of the section's slackest. None where it finds no rest."""
    rest = actuated(chain, commands, pull)
    shared = np.zeros_like(commands)
    for section in (tendons for tendons in sections(chain) if len(tendons) > 2):
        shared[:, section] = rest.tensions[:, section].min(axis=1, keepdims=True)
    if rest.converged[0] and shared.any():
        commands = rest.lengths - (rest.tensions - shared) / chain.gain
        rest = actuated(chain, commands, pull)
    return Bent(commands[0], rest.lengths[0], rest.position[0]) if rest.converged[0] else None
