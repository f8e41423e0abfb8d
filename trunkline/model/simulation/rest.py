"""Settling: heavily damped and without friction, MuJoCo is stepped until every joint is near rest, and led there.

Friction and the joints' branches and sliders are off, damping, of joints and tendons, is what settles soonest: nothing
of it moves the shape at rest, or it is the middle of a band of them; though which of several shapes an arm comes to
may depend on its way.
"""

import copy
from dataclasses import dataclass

import mujoco
import numpy as np
from mujoco.batch import Batch
from scipy.spatial.transform import Rotation

from trunkline.frames import wxyz_from_rotation
from trunkline.model.arm_model import CAPSTAN_FRICTION, ArmModel
from trunkline.model.simulation.motion import batch_of, hold

LONGEST_STEP = 0.005  # s
RELAXATION = 0.3  # s, damping over stiffness of each joint: about critical for the slowest swing of an arm
FIRST_SPAN = 0.5  # s until simulations are led to rest for the first time; each further span is twice as long
ROUNDS, STEPS = 4, 4  # of Newton's method: how often derivatives are taken at most, and steps with each
DIFFERENCE = 1e-6  # rad, of one hinge, for the derivatives
LEAP = 0.1  # rad that any hinge may be from rest; from farther, an arm might come to another of its shapes
ARRIVED = 1e-9  # rad, the last step
RAMP, RAMP_STEPS = 1.0, 50  # s in which tendons are drawn in, and in how many steps


@dataclass
class Settled:
    """B simulations at rest: position, m (B, 3), and quaternion, w first (B, 4), of the tip in the base frame, joint
    angles, rad (B, nq), tension, N (B, K), and whether each had come to rest in the time given (B,)."""

    position: np.ndarray
    quaternion: np.ndarray
    qpos: np.ndarray
    tensions: np.ndarray
    rested: np.ndarray


def settle(
    model: mujoco.MjModel,
    commands: np.ndarray,
    gravity: np.ndarray,
    seconds: float = 20.0,
    tip_site: str = "tip",
) -> Settled:
    """Let the model hang, draw its tendons in, and step until it rests: the reference for the statics.

    Args:
        commands: of the actuators, target path lengths, m, or tensions, N. Shape (B, K), K in their order.
        gravity: in the base frame, m/s². Shape (3,) or (B, 3).
        seconds: longest time to simulate once the tendons are drawn in.
    """
    model = copy.copy(model)
    model.opt.integrator = mujoco.mjtIntegrator.mjINT_IMPLICITFAST
    ArmModel(model).switch_off(CAPSTAN_FRICTION)
    batch = batch_of(model, len(commands))
    origin, to_world = base_frame(model)
    batch.expand("opt.gravity")[:] = gravity @ to_world.T
    straight = ArmModel(model).controls(np.zeros(model.nu))
    hold(batch, model, straight)
    timestep = relax(batch, model)
    control = batch.bind("ctrl")
    for share in np.arange(1, RAMP_STEPS + 1) / RAMP_STEPS:
        control[:] = straight + share * (commands - straight)
        batch.step(nstep=int(np.ceil(RAMP / RAMP_STEPS / timestep)))
    hold(batch, model, commands)
    moving, _ = come_to_rest(batch, timestep, seconds)
    site, turn, force = batch.bind("site_xpos"), batch.bind("site_xmat"), batch.bind("actuator_force")
    batch.forward()
    tip = model.site(tip_site).id
    rotation = Rotation.from_matrix(to_world.T @ turn[:, tip].reshape(-1, 3, 3))
    rested = np.ones(len(commands), dtype=bool)
    rested[moving] = False
    position = (site[:, tip] - origin) @ to_world
    return Settled(position, wxyz_from_rotation(rotation), batch.bind("qpos").copy(), -force.copy(), rested)


def base_frame(model: mujoco.MjModel) -> tuple[np.ndarray, np.ndarray]:
    """Position in the world, m, and rotation matrix to it of the body that carries the arm: a mount may be turned."""
    base = model.body_parentid[np.flatnonzero(model.body_jntnum)[0]]
    data = mujoco.MjData(model)
    mujoco.mj_kinematics(model, data)
    return data.xpos[base].copy(), data.xmat[base].reshape(3, 3).copy()


def relax(batch: Batch, model: mujoco.MjModel) -> float:
    """Take friction and what joints remember from all simulations, damp them so that they settle soon.

    Args:
        model: the one of the batch, whose fields each simulation may have changed before.

    Returns:
        Their time step, s.
    """
    timestep = longest_step(model)
    batch.expand("opt.timestep")[:] = timestep
    for name in ("dof_frictionloss", "tendon_frictionloss", "dof_dampingpoly"):
        batch.expand(name)[:] = 0
    batch.expand("dof_damping")[:] = RELAXATION * batch.expand("jnt_stiffness")[:, model.dof_jntid]
    # a step never throws the arm past where its motors pull; their own damping ends where a tendon is slack
    pull = np.maximum(batch.expand("actuator_gainprm")[:, :, 0], 0)  # N/m; a tension that is held has no stiffness
    batch.expand("tendon_damping")[:, model.actuator_trnid[:, 0]] = timestep * pull
    arm = ArmModel(model)
    for group in (*arm.branches, *arm.sliders):
        batch.expand("tendon_stiffness")[:, group.tendon] = 0
    return timestep


def come_to_rest(
    batch: Batch, timestep: float, seconds: float, moving: np.ndarray | None = None
) -> tuple[np.ndarray, int]:
    """Step relaxed simulations, each until it can be led to rest; positions then hold.

    Args:
        seconds: longest time to simulate.
        moving: which of them, all by default.

    Returns:
        Which simulations found no rest, and how many steps were taken; to compute the forces of a pose counts as one.
    """
    begun = np.array(range(batch.nsim) if moving is None else moving, dtype=np.int32)
    moving, steps, span = begun, 0, FIRST_SPAN
    while len(moving) and seconds > 0:
        count = round(span / timestep)
        batch.step(ids=moving, nstep=count)
        steps += count * len(moving)
        moving, looks = lead_to_rest(batch, moving)
        steps += looks
        seconds, span = seconds - span, 2 * span
    batch.forward(ids=begun, stage=mujoco.mjtStage.mjSTAGE_POS)
    return moving, steps


def lead_to_rest(batch: Batch, ids: np.ndarray) -> tuple[np.ndarray, int]:
    """Put simulations where nothing accelerates their arms any more, if that is near: Newton's method.

    A simulation stays where it is, without its speed, if the way is long, does not end, or ends where the arm would
    fall from.

    Returns:
        Those that stay, and how often forces were computed.
    """
    hinges, looks = ArmModel(batch.model).hinge_count, 0
    place, push = batch.bind("qpos"), batch.bind("qacc")
    batch.bind("qvel")[ids] = 0
    begun, there, going = place[ids].copy(), np.zeros(len(ids), dtype=bool), np.arange(len(ids))
    for _ in range(ROUNDS):
        now = ids[going]
        slopes = _slopes(batch, now, hinges)
        sound = np.isfinite(np.linalg.slogdet(slopes).logabsdet)
        going, now, slopes = going[sound], now[sound], slopes[sound]
        back = np.linalg.inv(-slopes)
        looks += len(sound) * (1 + hinges)
        for _ in range(STEPS):
            batch.forward(ids=now)
            looks += len(now)
            step = (back @ push[now, :hinges, None])[..., 0]
            near = np.abs(place[now, :hinges] + step - begun[going, :hinges]).max(axis=1) < LEAP
            going, now, slopes, back, step = going[near], now[near], slopes[near], back[near], step[near]
            place[now, :hinges] += step
        arrived = np.abs(step).max(axis=1) < ARRIVED
        there[going[arrived]] = np.linalg.eigvals(slopes[arrived]).real.max(axis=1) < 0
        going = going[~arrived]
        if not len(going):
            break
    place[ids[~there]] = begun[~there]
    return ids[~there], looks


def _slopes(batch: Batch, ids: np.ndarray, hinges: int) -> np.ndarray:
    """How the accelerations of simulations answer each hinge's angle, 1/s². Shape (B, n, n)."""
    place, push = batch.bind("qpos"), batch.bind("qacc")
    batch.forward(ids=ids)
    here, slopes = push[ids, :hinges], np.empty((len(ids), hinges, hinges))
    for hinge in range(hinges):
        angle = place[ids, hinge]
        place[ids, hinge] = angle + DIFFERENCE
        batch.forward(ids=ids)
        slopes[:, :, hinge] = (push[ids, :hinges] - here) / DIFFERENCE
        place[ids, hinge] = angle
    return slopes


def longest_step(model: mujoco.MjModel) -> float:
    """Time step, s, for an arm that is damped so that it settles: the rest shape is the same as at any smaller one.

    MuJoCo softens a joint limit whose time constant is less than two steps (flag refsafe).
    """
    constants = np.append(model.jnt_solref[:, 0], model.tendon_solref_lim[model.tendon_limited.astype(bool), 0])
    return min([LONGEST_STEP, *constants[constants > 0] / 2])  # the others are in another format
