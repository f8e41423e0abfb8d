"""MJCF files of arms: there and readable, or one line that says what was expected."""

from pathlib import Path

import mujoco
import numpy as np

from trunkline.errors import InputError, existing


def read_spec(path: str | Path) -> mujoco.MjSpec:
    """The MJCF at `path`, to be changed and compiled.

    Raises:
        InputError: there is none, or MuJoCo refuses it.
    """
    try:
        spec = mujoco.MjSpec.from_file(str(existing(path)))
        spec.compile()
        return spec
    except ValueError as error:
        raise InputError(f"{path}: not a model that MuJoCo reads: {str(error).splitlines()[0]}") from error


def read_model(path: str | Path) -> mujoco.MjModel:
    """The MJCF at `path`, of an arm with tendons, compiled.

    Raises:
        InputError: as `read_spec`, or the arm has no tendons.
    """
    model = read_spec(path).compile()
    if not model.nu:
        raise InputError(f"{path}: found no tendons, expected at least one: an arm without ends with identify_damping")
    return model


def marker_places(model: mujoco.MjModel) -> dict[str, np.ndarray]:
    """Where markers are on the straight arm, m in the base frame, each of shape (3,), by name; none without a base."""
    data = mujoco.MjData(model)
    mujoco.mj_kinematics(model, data)
    ends = "_center"  # as `trunkline.model.arm_model.CENTER`
    sites = {model.site(i).name.removesuffix(ends): i for i in range(model.nsite) if model.site(i).name.endswith(ends)}
    base = sites.pop("base", None)
    if base is None:
        return {}
    turn = data.site_xmat[base].reshape(3, 3)
    return {name: (data.site_xpos[site] - data.site_xpos[base]) @ turn for name, site in sites.items()}
