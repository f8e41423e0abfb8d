"""A chain that somebody else drew: any MJCF that MuJoCo loads, with the names that later stages look for."""

from dataclasses import dataclass
from pathlib import Path
from typing import Annotated, Literal

import mujoco
import numpy as np
from pydantic import Field

from trunkline.errors import InputError
from trunkline.model.arm.cad import CadArm
from trunkline.model.arm.mjcf import Actuation, Solver, pull_with
from trunkline.model.arm_model import FORCE_SCALE, ArmModel
from trunkline.model_files import read_spec

CENTER = "_center"  # ends the name of a tracked point's site


@dataclass
class FromFile:
    """file: MJCF below the folder of models, taken as it is, with its own tendons, actuators and time step."""

    kind: Literal["mjcf"]
    file: Annotated[str, Field(min_length=1)]

    def build(self, actuation: Actuation, solver: Solver, models: Path) -> CadArm:
        """The chain in `models / file`; `actuation` and `solver` are idle.

        Raises:
            InputError: one line that says what the file lacks, or why MuJoCo refuses it.
        """
        path = models / self.file
        if not path.resolve().is_relative_to(models.resolve()):
            raise InputError(f"build_mjcf.arm.file: found {self.file}, expected a file in {models}, which DVC watches")
        if not path.is_file():
            raise InputError(f"build_mjcf.arm.file: {path}: no such file")
        spec = read_arm(path)
        return CadArm(spec, _metrics(spec.compile()))


def read_arm(path: Path) -> mujoco.MjSpec:
    """The MJCF at `path`, of an arm with what later stages look for.

    Raises:
        InputError: there is none, MuJoCo refuses it, or one line that says what it lacks.
    """
    if not path.is_file():
        raise InputError(f"{path}: no such file, expected a model in MJCF")
    spec = read_spec(path)
    model = spec.compile()
    if fault := _missing(model) or _unlike(model) or _take_motors(spec, model):
        raise InputError(f"{path}: {fault}")
    return spec


def _take_motors(spec: mujoco.MjSpec, model: mujoco.MjModel) -> str | None:
    """Let every motor, an actuator that exerts its control times a constant, be sent the tension with which it pulls,
    in place; returns why that cannot be."""
    named = {model.actuator(index).name: index for index in range(model.nu)}
    muscles = model.actuator_gaintype == mujoco.mjtGain.mjGAIN_MUSCLE
    if muscles.any():
        muscle = model.actuator(int(np.argmax(muscles))).name
        return f"actuator {muscle!r}: found a muscle, expected `position`, or `motor`: its force depends on its length"
    fixed = model.actuator_gaintype == mujoco.mjtGain.mjGAIN_FIXED
    forced = fixed & (model.actuator_biastype == mujoco.mjtBias.mjBIAS_NONE)
    if not forced.any():
        return None
    if not forced.all():
        motor, other = (model.actuator(int(np.flatnonzero(kind)[0])).name for kind in (forced, ~forced))
        return f"actuator {motor!r}: found a motor beside {other!r}, which is none, expected motors alone, or none"
    for name, index in named.items():
        gear, (low, high) = model.actuator_gear[index, 0], (-np.inf, np.inf)
        if model.actuator_ctrllimited[index]:
            low, high = sorted(gear * model.actuator_gainprm[index, 0] * model.actuator_ctrlrange[index])
        if model.actuator_forcelimited[index]:
            least, most = sorted(gear * model.actuator_forcerange[index])
            low, high = max(low, least), min(high, most)
        if not -np.inf < low < 0 or high > 0:
            problem = f"found a motor that shortens its tendon by {0.0 - high:g} to {0.0 - low:g} N"
            return f"actuator {name!r}: {problem}, expected 0 to F: a ctrlrange or forcerange by which it only pulls"
        pull_with(spec.actuator(name), -low)
    if not ArmModel(model).places(FORCE_SCALE).size:
        spec.add_numeric(name=FORCE_SCALE, data=[1.0], size=1)
    return None


def _missing(model: mujoco.MjModel) -> str | None:
    """What the files that later stages write and read would have no name for."""
    for count, what in ((model.nmesh, "meshes"), (model.nhfield, "height fields"), (model.ntex, "textures")):
        if count:
            return f"found {count} {what}, expected none: the model goes on as one file"
    counts = {"joint": model.njnt, "site": model.nsite, "tendon": model.ntendon, "actuator": model.nu}
    for kind, count in counts.items():
        for index in range(count):
            if not getattr(model, kind)(index).name:
                article = "an" if kind == "actuator" else "a"
                return f"found {article} {kind} without a name (number {index + 1}), expected names for all"
    if "base" not in [model.body(index).name for index in range(model.nbody)]:
        return "found no body `base`, expected one: the mount, which carries the first unit"
    sites = [model.site(index).name for index in range(model.nsite)]
    for name, where in (("base_center", "in the mount"), ("tip", "on the last unit")):
        if name not in sites:
            return f"found no site {name!r}, expected one {where}"
    if not any(name.endswith(CENTER) and name != "base_center" for name in sites):
        return f"found no site <marker>{CENTER}, expected one for every marker"
    return None


def _unlike(model: mujoco.MjModel) -> str | None:
    """Where the model is none of a chain that hangs from `base` by hinges in pairs."""
    if not model.njnt:
        return "found no hinges, expected two on each unit"
    count = ArmModel(model).hinge_count  # those of Maxwell branches, which a fitted model has, come behind
    for body in range(1, model.nbody):
        name, hinges = model.body(body).name, np.flatnonzero(model.jnt_bodyid[:count] == body)
        joints, types = len(hinges), model.jnt_type[hinges]
        if joints not in (0, 2) or np.any(types != mujoco.mjtJoint.mjJNT_HINGE):
            return f"body {name!r}: found {joints} joints, expected two hinges, or none to be part of its parent"
    weak = np.flatnonzero((model.jnt_stiffness[:count] <= 0) | (model.dof_damping[:count] <= 0))
    if len(weak):
        name = model.joint(int(weak[0])).name
        return f"joint {name!r}: found no stiffness or no damping, expected a guess to begin with"
    data = mujoco.MjData(model)
    mujoco.mj_kinematics(model, data)
    mount = data.site("base_center")
    if not (np.allclose(mount.xpos, 0, atol=1e-9) and np.allclose(mount.xmat, np.eye(3).ravel(), atol=1e-9)):
        return "site 'base_center': found it moved or turned, expected it in the world's origin and along its axes"
    return None


def _metrics(model: mujoco.MjModel) -> dict[str, float]:
    data = mujoco.MjData(model)
    mujoco.mj_kinematics(model, data)
    metrics = {
        "length_m": np.linalg.norm(data.site("tip").xpos - data.site("base_center").xpos),
        "mass_kg": model.body_mass[model.body_weldid > 0].sum(),
        "units": np.count_nonzero(model.body_jntnum),
        "stiffness_base": model.jnt_stiffness[0],
        "damping_base": model.dof_damping[0],
    }
    return metrics | ({"joint_range_deg": np.degrees(model.jnt_range[0, 1])} if model.jnt_limited[0] else {})
