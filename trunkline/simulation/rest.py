"""The reference for the statics: MuJoCo stepped until it rests, friction off."""

import copy
from dataclasses import dataclass

import mujoco
import mujoco.batch
import numpy as np

from trunkline.threads import thread_count

LONGEST_STEP = 0.005  # s
RETARDATION = 0.25  # s, damping over stiffness of each joint while settling: about critical for the arm's slowest swing
CHUNK = 0.5  # s between looks at whether all simulations rest
REST_SPEED = 5e-6  # rad/s, of the fastest joint: at this retardation it has about as many rad still to go


@dataclass
class Settled:
    """B simulations at rest: tip position in the base frame, m (B, 3), joint angles, rad (B, nq), tension, N (B, K),
    and whether each had come to rest in the time given (B,)."""

    position: np.ndarray
    qpos: np.ndarray
    tensions: np.ndarray
    rested: np.ndarray


def settle(
    model: mujoco.MjModel,
    commands: np.ndarray,
    gravity: np.ndarray,
    seconds: float = 40.0,
    ramp: float = 2.0,
    tip_site: str = "tip",
) -> Settled:
    """Let the model hang, draw its tendons in over `ramp` seconds, and step until every joint rests.

    Friction is off, and damping is what settles soonest: neither moves the rest position.

    Args:
        commands: target path lengths of the position actuators, m. Shape (B, K), K in the order of the actuators.
        gravity: in the base frame, m/s². Shape (3,) or (B, 3).
        seconds: longest time to simulate.
        ramp: time over which the commands go from the straight arm's path lengths to `commands`, s.
    """
    model = _frictionless(model)
    count = len(commands)
    simulation = mujoco.batch.Batch(model, nsim=count, nthread=thread_count())
    base = model.body_parentid[np.flatnonzero(model.body_jntnum)[0]]
    data = mujoco.MjData(model)
    mujoco.mj_kinematics(model, data)
    to_world = data.xmat[base].reshape(3, 3)  # an identified mount may be turned
    simulation.expand("opt.gravity")[:] = gravity @ to_world.T
    slack = _straight_commands(model)
    qvel, ctrl = simulation.bind("qvel"), simulation.bind("ctrl")
    site = simulation.bind("site_xpos")
    force, qpos = simulation.bind("actuator_force"), simulation.bind("qpos")
    if model.na:
        simulation.bind("act")[:] = slack
    ramp_steps = 50
    for step in range(ramp_steps):
        ctrl[:] = slack + (step + 1) / ramp_steps * (commands - slack)
        simulation.step(nstep=int(np.ceil(ramp / ramp_steps / model.opt.timestep)))
    for _ in range(int(np.ceil((seconds - ramp) / CHUNK))):
        simulation.step(nstep=int(np.ceil(CHUNK / model.opt.timestep)))
        if np.abs(qvel).max() < REST_SPEED:
            break
    simulation.forward()
    position = (site[:, model.site(tip_site).id] - simulation.bind("xpos")[:, base]) @ to_world
    return Settled(position, qpos.copy(), -force.copy(), np.abs(qvel).max(axis=1) < REST_SPEED)


def _frictionless(model: mujoco.MjModel) -> mujoco.MjModel:
    model = copy.copy(model)
    model.dof_frictionloss[:] = 0
    model.tendon_frictionloss[:] = 0
    joints = model.dof_jntid
    model.dof_damping[:] = RETARDATION * model.jnt_stiffness[joints]
    model.dof_dampingpoly[:] = 0
    model.opt.timestep = longest_step(model)
    model.opt.integrator = mujoco.mjtIntegrator.mjINT_IMPLICITFAST
    return model


def _straight_commands(model: mujoco.MjModel) -> np.ndarray:
    """Path length of each actuator's tendon when the arm is straight, m. Shape (K,)."""
    return model.tendon_length0[model.actuator_trnid[:, 0]]


def longest_step(model: mujoco.MjModel) -> float:
    """Time step, s, for an arm that is damped so that it settles: the rest shape is the same as at any smaller one.

    MuJoCo softens a joint limit whose time constant is less than two steps (flag refsafe).
    """
    constants = model.jnt_solref[:, 0][model.jnt_solref[:, 0] > 0]  # the others are in another format
    return min([LONGEST_STEP, *constants / 2])
