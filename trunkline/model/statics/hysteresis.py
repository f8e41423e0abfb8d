"""What dry friction adds to the statics: rest is a band of poses, its ends those reached by pulling and by letting go.

Quasi-statically, on the way to a sample in the direction in which its tensions grow in proportion, every tendon, every
joint and every slider of a joint slides; friction then is at its full value against the way of each (Coulomb). On the
way back it is the other way round. So the ends of the band are equilibria with the motors' commands of the sample and,
with dl and dq the changes on the way in, friction of tendons as tensions ±f sign(dl) and of joints as torques
∓c sign(dq). Capstan friction acts with μ where tendons were drawn in, and with -μ where all have slid back: its band is
the widest there is.
"""

from dataclasses import dataclass

import mujoco
import numpy as np

from trunkline.model.arm_model import ArmModel
from trunkline.model.statics.chain import Chain
from trunkline.model.statics.equilibria import Equilibrium, equilibrium_paths, follow

BACK = 0.98  # share of the tensions from which the direction of the way in is taken


@dataclass
class Band:
    """Tips at the band's ends, m, NaN where no equilibrium was found.

    Attributes:
        loaded: where the tip rests after pulling. Shape (N, 3).
        unloaded: where it rests after letting go. Shape (N, 3).
    """

    loaded: np.ndarray
    unloaded: np.ndarray

    @property
    def width(self) -> np.ndarray:
        """Distance between the ends, m. Shape (N,)."""
        return np.linalg.norm(self.loaded - self.unloaded, axis=1)


def model_friction(model: mujoco.MjModel) -> tuple[np.ndarray, np.ndarray]:
    """Dry friction of the tendons, N, shape (K,), and of the units' joints, N m, shape (n, 2). A joint's sliders count
    with the torque at which they slip: so much they bear against its way, once it has bent by more than their yield."""
    arm = ArmModel(model)
    joints = model.body_jntadr[arm.unit_bodies][:, None] + np.arange(2)
    torque = model.dof_frictionloss[model.jnt_dofadr]
    for slider in arm.sliders:
        torque[slider.hinge] += model.tendon_stiffness[slider.tendon] * model.tendon_springyield[slider.tendon]
    return model.tendon_frictionloss[arm.cables], torque[joints]


def friction_band(
    chain: Chain,
    tensions: np.ndarray,
    gravity: np.ndarray,
    tendon_friction: np.ndarray,
    joint_friction: np.ndarray,
    capstan: float = 0.0,
) -> Band:
    """Both ends of the band for N samples, their actuators' commands held.

    Args:
        tensions: of the samples at rest without friction, N. Shape (N, K).
        gravity: m/s². Shape (N, 3).
        tendon_friction: N. Shape (K,).
        joint_friction: N m. Shape (n, 2).
        capstan: μ of capstan friction.
    """
    chain = chain.smooth
    way = equilibrium_paths(chain, tensions[:, None] * np.array([BACK, 1.0])[:, None], gravity)
    before, here = way[0::2], way[1::2]
    commands = chain.commands(here.lengths, tensions)
    slides = np.sign(here.lengths - before.lengths), np.sign(here.qpos - before.qpos).reshape(-1, chain.units, 2)
    doubled = with_friction(chain)
    ends = []
    for side in (1, -1):
        slid = doubled._replace(capstan=side * capstan)
        torques = -side * joint_friction * slides[1]
        end = _fixed_commands(slid, commands, side * tendon_friction * slides[0], torques, gravity)
        solved = (here.converged & end.converged)[:, None]
        ends.append(np.where(solved, end.position, np.nan))
    return Band(*ends)


def with_friction(chain: Chain) -> Chain:
    """The chain with every tendon twice: the second one carries the friction, which does not end where it is slack."""
    twice = {name: np.concatenate([getattr(chain, name)] * 2, axis=1) for name in ("hole_in", "hole_out", "crosses")}
    twice |= {name: np.tile(getattr(chain, name), 2) for name in ("fixed_length", "gain", "max_tension")}
    return chain._replace(**twice)


def _fixed_commands(chain: Chain, commands, friction, torques, gravity) -> Equilibrium:
    """Equilibria under actuators that are sent `commands` (N, K), m or N, constant tensions `friction` (N, K), N, and
    torques at the joints (N, n, 2), N m."""
    tendons = commands.shape[1]
    pulls = chain._replace(gain=chain.gain[:tendons], max_tension=chain.max_tension[:tendons]).pulls(commands)
    tensions = np.concatenate([pulls[0], friction], axis=1)[:, None]
    lengths = np.concatenate([pulls[1], np.zeros_like(commands)], axis=1)[:, None]
    slope = np.concatenate([chain.gain[:tendons], np.zeros(tendons)])
    ceiling = np.concatenate([chain.max_tension[:tendons], np.full(tendons, np.inf)])
    return follow(chain, tensions, lengths, gravity, slope, ceiling, torques=torques)
