"""Settling: heavily damped and without friction, MuJoCo is stepped until every joint rests.

Friction and the joints' branches and sliders are off, damping is what settles soonest: nothing of it moves the shape
at rest, or it is the middle of a band of them; though which of several shapes an arm comes to may depend on its way.
"""

import copy
from dataclasses import dataclass

import mujoco
import numpy as np
from mujoco.batch import Batch
from scipy.spatial.transform import Rotation

from trunkline.elements import BRANCH, SLIDER, all_elements
from trunkline.frames import wxyz_from_rotation
from trunkline.simulation.motion import batch_of, hold

LONGEST_STEP = 0.005  # s
RELAXATION = 0.3  # s, damping over stiffness of each joint: about critical for the slowest swing of an arm
CHUNK = 0.1  # s between looks at which simulations rest
FINE_SPEED = 5e-9  # rad/s of the fastest joint, where MuJoCo is the reference: tips are some 1e-9 m from rest
SPAN = 0.5  # s between the places from which the end of a slow motion is extrapolated
STRIDE = 0.95  # of a motion that shrinks by this share in SPAN or more slowly: no longer leaps than this gives
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
    seconds: float = 10.0,
    rest_speed: float = FINE_SPEED,
    tip_site: str = "tip",
    creep: float = 3.0,
) -> Settled:
    """Let the model hang, draw its tendons in, and step until it rests: the reference for the statics.

    Args:
        commands: target path lengths of the position actuators, m. Shape (B, K), K in the order of the actuators.
        gravity: in the base frame, m/s². Shape (3,) or (B, 3).
        seconds: longest time to simulate once the tendons are drawn in.
        rest_speed: rad/s of the fastest joint, at rest.
        creep: s, longest time after that, in which what still creeps is led to its end, see `creep_to_rest`.
    """
    model = copy.copy(model)
    model.opt.integrator = mujoco.mjtIntegrator.mjINT_IMPLICITFAST
    batch = batch_of(model, len(commands))
    origin, to_world = base_frame(model)
    batch.expand("opt.gravity")[:] = gravity @ to_world.T
    straight = model.tendon_length0[model.actuator_trnid[:, 0]]
    hold(batch, model, straight)
    timestep = relax(batch, model)
    control = batch.bind("ctrl")
    for share in np.arange(1, RAMP_STEPS + 1) / RAMP_STEPS:
        control[:] = straight + share * (commands - straight)
        batch.step(nstep=int(np.ceil(RAMP / RAMP_STEPS / timestep)))
    moving, _ = come_to_rest(batch, timestep, seconds, rest_speed)
    moving, _ = creep_to_rest(batch, timestep, moving, creep, rest_speed)
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


def relax(batch: Batch, model: mujoco.MjModel, step_factor: float = 1.0) -> float:
    """Take friction and what joints remember from all simulations, damp them so that they settle soon.

    Args:
        model: the one of the batch, whose fields each simulation may have changed before.
        step_factor: how much longer a step than `longest_step`.

    Returns:
        Their time step, s.
    """
    timestep = step_factor * longest_step(model)
    batch.expand("opt.timestep")[:] = timestep
    for name in ("dof_frictionloss", "tendon_frictionloss", "dof_dampingpoly"):
        batch.expand(name)[:] = 0
    batch.expand("dof_damping")[:] = RELAXATION * batch.expand("jnt_stiffness")[:, model.dof_jntid]
    for one in (*all_elements(model, BRANCH), *all_elements(model, SLIDER)):
        batch.expand("tendon_stiffness")[:, one.tendon] = 0
    return timestep


def come_to_rest(
    batch: Batch, timestep: float, seconds: float, rest_speed: float, moving: np.ndarray | None = None
) -> tuple[np.ndarray, int]:
    """Step relaxed simulations, each until its fastest joint is slower than `rest_speed`, rad/s; positions then hold.

    A mode that relaxes in RELAXATION has about that time times `rest_speed` still to go.

    Args:
        moving: which of them, all by default.

    Returns:
        Which simulations still move after `seconds`, and how many steps were taken.
    """
    moving, steps = np.array(range(batch.nsim) if moving is None else moving, dtype=np.int32), 0
    speed, chunk = batch.bind("qvel"), round(CHUNK / timestep)
    for _ in range(round(seconds / CHUNK)):
        if not len(moving):
            break
        batch.step(ids=moving, nstep=chunk, stage=mujoco.mjtStage.mjSTAGE_POS)
        steps += chunk * len(moving)
        moving = moving[~(np.abs(speed[moving]).max(axis=1) < rest_speed)]
    return moving, steps


def creep_to_rest(
    batch: Batch, timestep: float, moving: np.ndarray, seconds: float, rest_speed: float
) -> tuple[np.ndarray, int]:
    """Bring to rest what `come_to_rest` left `moving`, up to `seconds` later; arguments and returns as there.

    Pulls and loads that press on an arm take most of its stiffness against some bend, and in that it creeps long after
    all else rests. What is left of such a motion d shrinks by a factor λ in each SPAN, and its end is d λ / (1 - λ)
    ahead (Aitken). Simulations go there, and creep on from there.
    """
    steps, span, moving = 0, round(SPAN / timestep), np.array(moving, dtype=np.int32)
    place, speed = batch.bind("qpos"), batch.bind("qvel")
    for _ in range(round(seconds / (3 * SPAN))):
        if not len(moving):
            break
        places = [place[moving].copy()]
        for _ in range(2):
            batch.step(ids=moving, nstep=span)
            places.append(place[moving].copy())
        before, last = places[1] - places[0], places[2] - places[1]
        shrinks = np.sum(before * last, axis=1) / np.maximum(np.sum(before * before, axis=1), 1e-300)
        shrinks = np.clip(shrinks, 0.0, STRIDE)[:, None]
        place[moving] = places[2] + last * shrinks / (1 - shrinks)
        speed[moving] = 0.0
        batch.step(ids=moving, nstep=span, stage=mujoco.mjtStage.mjSTAGE_POS)
        steps += 3 * span * len(moving)
        moving = moving[~(np.abs(speed[moving]).max(axis=1) < rest_speed)]
    return moving, steps


def longest_step(model: mujoco.MjModel) -> float:
    """Time step, s, for an arm that is damped so that it settles: the rest shape is the same as at any smaller one.

    MuJoCo softens a joint limit whose time constant is less than two steps (flag refsafe).
    """
    constants = model.jnt_solref[:, 0][model.jnt_solref[:, 0] > 0]  # the others are in another format
    return min([LONGEST_STEP, *constants / 2])
