"""The arm to describe: a model, or a description of which none was made yet."""

from pathlib import Path

import mujoco
from omegaconf import OmegaConf

from trunkline.errors import InputError
from trunkline.model.arm.from_file import read_arm
from trunkline.model.arm.kinds import Arm
from trunkline.model.arm.mjcf import Actuation, Solver
from trunkline.pipeline.config import own_or_project, validated
from trunkline.settings import read_yaml, settings

STAGE = "build_mjcf"
TIMESTEP = 0.001  # s; nothing is simulated


@settings
class Drawing:
    arm: Arm
    actuation: Actuation
    solver: Solver


def read_drawing(path: Path, root: Path) -> mujoco.MjModel:
    """The model in a file of MJCF, or that of an arm's YAML as `build_mjcf` makes it, with the guesses of the motors in
    conf/build_mjcf/config.yaml below `root`, or the project's.

    Raises:
        InputError: one line with the file and the key.
    """
    if path.suffix in (".yaml", ".yml"):
        conf = own_or_project(root, "conf")
        common = OmegaConf.to_container(read_yaml(conf / STAGE / "config.yaml"))
        assert isinstance(common, dict)
        values = {"arm": OmegaConf.to_container(read_yaml(path)), "actuation": common["actuation"],
                  "solver": common["solver"] | {"timestep": TIMESTEP}}  # fmt: skip
        drawn = validated(Drawing, values, path)
        return drawn.arm.build(drawn.actuation, drawn.solver, conf / STAGE / "mjcf").spec.compile()
    if path.suffix != ".xml":
        raise InputError(f"{path}: expected an arm's description, .yaml, or a model in MJCF, .xml")
    return read_arm(path).compile()
