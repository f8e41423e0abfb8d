"""Whether there is anything to do for the stages that need tendons."""

from pathlib import Path

import mujoco

from trunkline.errors import InputError, Skipped

CAD_MODEL = Path("artifacts/build_mjcf/arm.xml")  # has the tendons of every later model, and never depends on a log


def require_tendons(path: Path = CAD_MODEL) -> None:
    """Let a stage go on only if the arm at `path` (MJCF) has tendons.

    Raises:
        Skipped: if it has none.
        InputError: if there is no such file, or MuJoCo refuses it.
    """
    if not path.is_file():
        raise InputError(f"{path}: no such file, expected the model of build_mjcf (run `dvc repro`)")
    try:
        tendons = mujoco.MjModel.from_xml_path(str(path)).ntendon
    except ValueError as error:
        raise InputError(f"{path}: not a model that MuJoCo reads: {str(error).splitlines()[0]}") from error
    if not tendons:
        raise Skipped(f"{path}: the arm has no tendons")
