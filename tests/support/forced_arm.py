"""An arm whose motors are commanded by force, and trials at rest under them, as plain MuJoCo settles."""

from dataclasses import replace
from pathlib import Path

import mujoco
import numpy as np

from tests.model.arm.test_sections import ACTUATION, SOLVER, arm
from trunkline.frames import STANDARD_GRAVITY
from trunkline.model.arm.mjcf import Actuation
from trunkline.model.arm.tendons import Tendon
from trunkline.model.arm_model import ArmModel
from trunkline.recordings.trials.recording import FORCE
from trunkline.recordings.trials.trial import Trial

MOTORS = Actuation(friction=0.0, max_force=20.0, time_constant=0.02, commands="force")
FOUR = [Tendon(angle, 0.012, end) for angle, end in ((0.0, 2), (120.0, 0), (-120.0, 0), (60.0, 0))]
DOWN = np.array([0.0, 0.0, -STANDARD_GRAVITY])
MARKERS = tuple(f"unit_{k:02d}" for k in range(1, 6))


def forced_spec(**motors) -> mujoco.MjSpec:
    return arm(tendons=FOUR).build(replace(MOTORS, **motors), SOLVER, Path()).spec


def forced_model(**motors) -> mujoco.MjModel:
    return forced_spec(**motors).compile()


def holding_model() -> mujoco.MjModel:
    """The same arm, its motors commanded by length."""
    return arm(tendons=FOUR).build(ACTUATION, SOLVER, Path()).spec.compile()


def rest_of(model: mujoco.MjModel, tensions: np.ndarray) -> mujoco.MjData:
    """At rest under tensions (K,), N, which act as forces on tendons, by no actuator of ours."""
    model, data = model.__copy__(), mujoco.MjData(model)
    model.opt.gravity[:] = DOWN
    model.opt.disableflags |= mujoco.mjtDisableBit.mjDSBL_ACTUATION
    model.dof_damping[:] = 0.1 * model.jnt_stiffness[model.dof_jntid]
    jacobian = np.zeros((model.ntendon, model.nv))
    for step in range(5000):
        mujoco.mj_fwdPosition(model, data)
        mujoco.mju_sparse2dense(jacobian, data.ten_J, model.ten_J_rownnz, model.ten_J_rowadr, model.ten_J_colind)
        data.qfrc_applied[:] = -tensions @ jacobian[ArmModel(model).cables]
        mujoco.mj_step(model, data)
        if step > 100 and np.abs(data.qvel).max() < 1e-9:
            break
    mujoco.mj_forward(model, data)
    return data


def forced_pull(
    model: mujoco.MjModel, tensions, split: str = "identify", scale: float = 1.0, markers: tuple[str, ...] = MARKERS
) -> Trial:
    """A static pull that logs `tensions`, N, of which motors pull with `scale` times as much."""
    data = rest_of(model, scale * np.asarray(tensions, dtype=float))
    places = np.array([data.site(f"{name}_center").xpos for name in markers])[None]
    pulls, names = np.array([tensions], dtype=float), ArmModel(model).cable_names
    return Trial(
        name="pull_" + "_".join(f"{tension:g}" for tension in tensions) + f"_{split}", experiment="static_pull",
        split=split, level=None, gravity=DOWN, time=np.zeros(1), markers=markers, positions=places, quaternions=None,
        measured=np.ones((1, len(markers)), bool), tendons=tuple(names), commands=pulls, tendon_positions=pulls,
        command_unit=FORCE,
    )  # fmt: skip
