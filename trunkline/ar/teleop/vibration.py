"""The arm's own swings: the model linearised about a pose in which it rests, and how much a command excites each.

With q the joint angles, v their rates and u the commands of the motors, about rest

    d/dt [δq, δv] = A [δq, δv] + B δu,    A = [[0, 1], [∂v̇/∂q, ∂v̇/∂v]],    B = [0, ∂v̇/∂u],

by central differences of MuJoCo's accelerations. An eigenvalue λ of A, with right and left vectors r and l (l r = 1),
is a swing of period 2π / |Im λ| and damping ratio -Re λ / |λ|; a step δu at once makes the tip swing by |C r (l B δu)
/ λ|, C the tip's Jacobian. The motors' lag is not in it: it delays all swings alike. MuJoCo's own `mjd_transitionFD`
refuses models with delays.
"""

import copy
from functools import lru_cache
from typing import NamedTuple

import mujoco
import numpy as np

from trunkline.ar.teleop.planner import ShaperOf
from trunkline.ar.teleop.shaping import Shaper, Shaping, shaper_of
from trunkline.frames import STANDARD_GRAVITY
from trunkline.model.arm_model import ArmModel
from trunkline.model.simulation.rest import base_frame, settle

STEP = 1e-5  # rad, rad/s and m, of the differences
STILL = 0.1  # rad/s, swings slower than that are creep
SHARE = 0.1  # of the largest swing of the tip; smaller ones are not worth a longer way
ALIKE = 0.05  # share by which periods differ that one shaper suits: ZVD leaves 0.6 % of such a swing
SHAPERS = 16  # of last, that are not computed again
HEAVY = 0.2  # damping ratio from which on a swing dies within a period


class VibrationModes(NamedTuple):
    """Of n swings, the one that moves the tip most first: `periods` (n,), s, damped; `dampings` (n,), ratios; `sizes`
    (n,), m, by which the tip swings after the step of command. `tip` (3,): where it rests in the base frame, m."""

    periods: np.ndarray
    dampings: np.ndarray
    sizes: np.ndarray
    tip: np.ndarray


def vibration_modes(
    model: mujoco.MjModel, command: np.ndarray, step: np.ndarray | None, gravity: np.ndarray, tip_site: str = "tip"
) -> VibrationModes:
    """Of the arm at rest under `command` (nu,), m.

    Args:
        step: by which the command has come there all at once, m. Shape (nu,). None: the mount has begun to accelerate
        by
            1 m/s² instead, along each axis; sizes are the root of the sum of squares of the three.
        gravity: in the base frame, m/s². Shape (3,).
    """
    rest = settle(model, command[None], gravity[None])
    model = copy.copy(model)
    model.opt.gravity[:] = base_frame(model)[1] @ gravity
    data = mujoco.MjData(model)
    pose = rest.qpos[0]
    ArmModel(model).unload_branches(pose)
    data.qpos[:] = pose
    inputs = data.act if model.na else data.ctrl
    with_state = model.actuator_actadr >= 0 if model.na else np.ones(model.nu, dtype=bool)
    inputs[:] = command[with_state]
    data.ctrl[:] = command
    count = model.nv

    def slopes(values: np.ndarray) -> np.ndarray:
        """∂v̇/∂values, (nv, len(values)); `values` is a field of `data`."""
        slope = np.empty((count, len(values)))
        for index, here in enumerate(values.copy()):
            for sign in (1, -1):
                values[index] = here + sign * STEP
                mujoco.mj_forward(model, data)
                slope[:, index] = data.qacc if sign == 1 else (slope[:, index] - data.qacc) / (2 * STEP)
            values[index] = here
        return slope

    a = np.block([[np.zeros((count, count)), np.eye(count)], [slopes(data.qpos), slopes(data.qvel)]])
    push = slopes(model.opt.gravity) if step is None else (slopes(inputs) @ step[with_state])[:, None]
    mujoco.mj_forward(model, data)
    site, jacobian = model.site(tip_site).id, np.zeros((3, count))
    mujoco.mj_jacSite(model, data, jacobian, None, site)
    values, right = np.linalg.eig(a)
    pace, fall = np.imag(values), -np.real(values)
    weights = np.linalg.solve(right, np.concatenate([np.zeros_like(push), push]))
    tips = (jacobian @ right[:count])[:, :, None] * (weights / values[:, None])  # (3, modes, pushes)
    sizes = 2 * np.sqrt((np.abs(tips) ** 2).sum(axis=(0, 2)))  # each with its conjugate
    chosen = np.flatnonzero(pace > STILL)
    chosen = chosen[np.argsort(-sizes[chosen], kind="stable")]
    dampings = fall[chosen] / np.hypot(fall[chosen], pace[chosen])
    return VibrationModes(2 * np.pi / pace[chosen], dampings, sizes[chosen], rest.position[0])


def slowest(modes: VibrationModes, count: int) -> VibrationModes:
    """The `count` slowest of those that move the tip by at least SHARE of what the largest does, slowest first. Of
    swings that are ALIKE, as those of a straight arm in two directions, one stands for all: a shaper ends them
    together."""
    chosen: list[int] = []
    for index in np.argsort(-modes.periods, kind="stable"):
        matters = modes.sizes[index] >= SHARE * modes.sizes.max() and modes.dampings[index] < HEAVY
        if matters and all(modes.periods[index] < (1 - ALIKE) * modes.periods[other] for other in chosen):
            chosen.append(int(index))
    able = chosen[:count]
    return VibrationModes(modes.periods[able], modes.dampings[able], modes.sizes[able], modes.tip)


def shaper_for(model: mujoco.MjModel, settings: Shaping) -> ShaperOf:
    """What a `Planner` shapes with: the swings of `model` under the gravity, and where the commands end. Those of last
    are kept: ways to one target differ in little else than joints."""

    @lru_cache(SHAPERS)
    def shaper(*arrays: bytes) -> Shaper:
        if settings.kind == "none":
            return Shaper(np.zeros(1), np.ones(1))
        gravity, command, change = (np.frombuffer(array) for array in arrays)
        step = change if np.abs(change).max() > 0 else None
        modes = slowest(vibration_modes(model, command, step, STANDARD_GRAVITY * gravity), settings.modes)
        return shaper_of(modes.periods, modes.dampings, settings.kind)

    return lambda *arrays: shaper(*(array.astype(float).tobytes() for array in arrays))
