"""MJCF files of arms: there and readable, or one line that says what was expected."""

from pathlib import Path

import mujoco

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
