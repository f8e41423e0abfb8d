"""Driving: from the straight arm, commands are sent and the model moves as it does until it rests."""

import copy
from dataclasses import dataclass

import mujoco
import numpy as np

from trunkline.model.arm_model import BACKLASH, CAPSTAN_FRICTION, ArmModel
from trunkline.model.simulation.motion import batch_of, hold, move
from trunkline.model.simulation.rest import base_frame, come_to_rest, longest_step, relax
from trunkline.model.simulation.winch import Winches

LOOK = 0.25  # s between looks at the tips
WINDOW = 4  # looks in which a tip has moved no more than STILL: a swing of up to 2 s shows in them
STILL = 1e-4  # m
NEAR = 1e-3  # m, from its end, within which a tip counts as there
ROW = 0.01  # s between rows of a trajectory of commands
CALM = 15.0  # s in which a damped arm must come to rest


@dataclass
class Driven:
    """B drives.

    Attributes:
        tips: in the base frame at every LOOK s, held once at rest, m. Shape (B, F, 3). NaN once MuJoCo has warned.
            If calmed, the last one is where the damped arm came to rest.
        rested: whether the tip came to rest in the time given. Shape (B,).
        calmed: whether the arms were damped at last.
    """

    tips: np.ndarray
    rested: np.ndarray
    calmed: bool = False

    @property
    def end(self) -> np.ndarray:
        """Where the tips were at last, m. Shape (B, 3)."""
        return self.tips[:, -1]

    @property
    def seconds_to_rest(self) -> np.ndarray:
        """From when on each tip stayed within NEAR of its end by itself, s; NaN where it never did. Shape (B,)."""
        away = np.linalg.norm(self.tips - self.tips[:, -1:], axis=2) > NEAR
        last = np.where(away.any(axis=1), away.shape[1] - np.argmax(away[:, ::-1], axis=1), 0)
        return np.where(self.rested & (last < away.shape[1] - self.calmed), LOOK * last, np.nan)


def has_friction(model: mujoco.MjModel) -> bool:
    """Whether where the model rests depends on how it came there: friction of tendons or hinges, sliders, holes,
    backlash of winches."""
    arm = ArmModel(model)
    sliding = any(model.tendon_stiffness[slider.tendon].any() for slider in arm.sliders)
    sliding = sliding or arm.capstan_friction or arm.backlash
    return bool(sliding or model.tendon_frictionloss.any() or model.dof_frictionloss.any())


def drive(
    model: mujoco.MjModel,
    commands: np.ndarray,
    gravity: np.ndarray,
    seconds: float,
    friction: bool = True,
    tip_site: str = "tip",
    calm: bool = False,
) -> Driven:
    """Send commands to the straight arm and step it until its tip rests, with the model's own damping.

    The time step is the longest that joint limits allow: where the arm comes to rest does not depend on it. Drives in
    which MuJoCo warns are done again with half the step, down to the model's own.

    Args:
        commands: of the actuators, m or N, sent at once. Shape (B, K), K in the order of the actuators. Or
            trajectories, a row every ROW s and the last one held. Shape (B, T, K).
        gravity: in the base frame, m/s². Shape (3,) or (B, 3).
        seconds: longest time to simulate.
        friction: whether tendons and joints have the model's dry friction, and its sliders, and cables rub, and winches
            have backlash.
        calm: whether arms are damped after these `seconds` until they rest. That does not change where, if there is no
            friction.

    Raises:
        ValueError: to calm an arm with friction.
    """
    model_step, model = model.opt.timestep, copy.copy(model)
    model.opt.integrator = mujoco.mjtIntegrator.mjINT_IMPLICITFAST
    model.opt.timestep = longest_step(model)
    if not friction:
        model.tendon_frictionloss[:], model.dof_frictionloss[:] = 0, 0
        arm = ArmModel(model)
        arm.switch_off(CAPSTAN_FRICTION, BACKLASH)
        for slider in arm.sliders:
            model.tendon_stiffness[slider.tendon] = 0
    if calm and has_friction(model):
        raise ValueError("found friction in a model to be calmed, expected none: where it rests depends on its way")
    gravity = np.broadcast_to(gravity, (len(commands), 3))
    driven = _drive(model, commands, gravity, seconds, tip_site, calm)
    while model.opt.timestep > model_step and len(warned := np.flatnonzero(~np.isfinite(driven.end).all(axis=1))):
        model.opt.timestep = max(model.opt.timestep / 2, model_step)
        again = _drive(model, commands[warned], gravity[warned], seconds, tip_site, calm)
        driven.tips[warned], driven.rested[warned] = again.tips, again.rested
    return driven


def _drive(
    model: mujoco.MjModel, commands: np.ndarray, gravity: np.ndarray, seconds: float, tip_site: str, calm: bool
) -> Driven:
    """As `drive`, with about the model's time step."""
    model.opt.timestep = LOOK / np.ceil(LOOK / model.opt.timestep)
    every, looks = round(LOOK / model.opt.timestep), round(seconds / LOOK)
    origin, to_world = base_frame(model)
    batch = batch_of(model, len(commands))
    trajectories = commands if commands.ndim == 3 else commands[:, None]
    last = (trajectories.shape[1] - 1) * ROW
    batch.expand("opt.gravity")[:] = gravity @ to_world.T
    straight = np.tile(ArmModel(model).controls(np.zeros(model.nu)), (len(commands), 1))
    hold(batch, model, straight)
    winches = Winches(batch, straight)
    site = model.site(tip_site).id
    tips = np.full((len(commands), looks + calm, 3), np.nan)
    moving = np.arange(len(commands), dtype=np.int32)
    for look in range(looks):
        sent = _sent(trajectories[moving], (look * every + np.arange(every)) * model.opt.timestep)
        controls = winches.deliver(sent, moving)
        places = move(batch, controls, ("site_xpos",), every, every - 1, ids=moving)["site_xpos"][:, 0, site]
        tips[moving, look] = (places - origin) @ to_world
        sound = ~batch.warning[moving].any(axis=(1, 2))
        moving, wound = moving[sound], np.ptp(controls[sound], axis=1).max(axis=1)
        if (look - WINDOW) * LOOK >= last:
            spread = np.ptp(tips[moving, look - WINDOW : look + 1], axis=1)
            still = (np.linalg.norm(spread, axis=1) <= STILL) & (wound <= STILL)
            tips[moving[still], look + 1 :] = tips[moving[still], look, None]
            moving = moving[~still]
        if not len(moving):
            break
    if calm:
        timestep, places = relax(batch, model), batch.bind("site_xpos")
        batch.bind("qvel")[:] = 0
        if not winches.idle:
            batch.bind("ctrl")[:] = trajectories[:, -1]
        sound = np.flatnonzero(~batch.warning.any(axis=(1, 2)))
        moving, _ = come_to_rest(batch, timestep, CALM, sound)
        batch.forward()
        tips[:, -1] = (places[:, site] - origin) @ to_world
    warned = batch.warning.any(axis=(1, 2))
    tips[warned, -1] = np.nan
    rested = ~warned
    rested[moving] = False
    return Driven(tips, rested, calm)


def _sent(trajectories: np.ndarray, time: np.ndarray) -> np.ndarray:
    """Commands at `time`, s, on straight lines between the rows of trajectories (B, T, K). Shape (B, len(time), K)."""
    place = np.minimum(time / ROW, trajectories.shape[1] - 1)
    before = place.astype(int)
    after = np.minimum(before + 1, trajectories.shape[1] - 1)
    share = (place - before)[:, None]
    return (1 - share) * trajectories[:, before] + share * trajectories[:, after]
