"""The rehearsal's settings, read from conf/rehearse/."""

from dataclasses import dataclass
from pathlib import Path
from typing import Annotated, Literal, TypeVar

from omegaconf import OmegaConf
from pydantic import Field

from rehearsal.operator.hands import HumanOperator
from rehearsal.robot.stand_in import StandIn
from trunkline.ar.preview.settings import Previewing
from trunkline.pipeline.config import validated
from trunkline.settings import read_yaml

CONF = Path(__file__).parent / "conf/rehearse"
Metres = Annotated[float, Field(ge=-5, le=5)]
Positive = Annotated[float, Field(gt=0, le=100)]
Zero = Annotated[float, Field(ge=0, le=100)]
Share = Annotated[float, Field(ge=0, le=1)]
Kind = TypeVar("Kind")


@dataclass
class Free:
    """Reaching a hanging object and following a moving one: see conf/rehearse/experiments/free.yaml."""

    mount_ready: Annotated[list[Metres], Field(min_length=3, max_length=3)]
    near: Positive
    far: Positive
    side_deg: Positive
    low: Metres
    high: Metres
    band: Positive
    diameter: Positive
    mass: Positive
    string: Positive
    tip_units: Annotated[int, Field(ge=1, le=50)]
    path: Positive
    path_seconds: Positive
    path_hz: Positive
    interruption: Positive


Shape = Literal["cylinder", "sphere", "basket"]


@dataclass
class Sizes:
    """Between which an object of a shape is drawn: see conf/rehearse/experiments/grasp.yaml."""

    thin: Positive
    wide: Positive
    light: Positive
    heavy: Positive
    height: Positive
    low: Metres
    high: Metres


@dataclass
class Grasped:
    """Grasping what hangs or stands, and handing over what stands: see conf/rehearse/experiments/grasp.yaml."""

    shapes: Annotated[dict[Shape, Sizes], Field(min_length=1)]
    string: Positive
    stand: Annotated[list[Positive], Field(min_length=3, max_length=3)]
    yaw_deg: Zero
    near: Positive
    far: Positive
    side_deg: Positive
    hold: Positive
    slip: Positive
    lifted: Positive
    accept: Share
    table: Annotated[list[Positive], Field(min_length=3, max_length=3)]
    table_top: Metres
    table_azimuth_deg: Positive
    table_radius: Positive
    drop: Positive
    calm: Positive


def stand_in() -> StandIn:
    return _read(StandIn, "robot/stand_in.yaml")


def person() -> HumanOperator:
    return _read(HumanOperator, "operator/typical.yaml")


def free() -> Free:
    return _read(Free, "experiments/free.yaml")


def grasped() -> Grasped:
    return _read(Grasped, "experiments/grasp.yaml")


def previewing() -> Previewing:
    return _read(Previewing, "preview/batch.yaml")


def _read(kind: type[Kind], file: str) -> Kind:
    values = OmegaConf.to_container(read_yaml(CONF / file))
    assert isinstance(values, dict)
    return validated(kind, values, CONF / file)
