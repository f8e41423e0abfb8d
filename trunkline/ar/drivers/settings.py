"""All settings of conf/execution/config.yaml."""

from pathlib import Path

from trunkline.ar.drivers.driver_client import PandaSettings
from trunkline.ar.drivers.motors import MotorSettings
from trunkline.ar.drivers.ros_settings import RosSettings
from trunkline.pipeline.config import PROJECT, load_folder
from trunkline.settings import settings

RENAMED = {"arm": "panda"}  # keys of the release before


@settings
class ExecutionConfig:
    """Of real machines: the `panda` (or an FR3), or a controller of `ros`; the tendons' `motors`."""

    panda: PandaSettings
    ros: RosSettings
    motors: MotorSettings


def read_execution_config(folder: Path = PROJECT / "conf/execution") -> ExecutionConfig:
    """The settings of a folder, also under the names of the release before; errors as of `load_folder`."""
    return load_folder(ExecutionConfig, folder, RENAMED)
