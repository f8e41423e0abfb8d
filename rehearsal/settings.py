"""The rehearsal's settings, read from conf/rehearse/."""

from dataclasses import dataclass
from pathlib import Path
from typing import Annotated, TypeVar

from omegaconf import OmegaConf
from pydantic import Field

from rehearsal.operator.hands import Person
from rehearsal.robot.stand_in import StandIn
from trunkline.pipeline.config import validated
from trunkline.settings import read_yaml

CONF = Path(__file__).parent / "conf/rehearse"
Metres = Annotated[float, Field(ge=-5, le=5)]
Positive = Annotated[float, Field(gt=0, le=100)]
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


def stand_in() -> StandIn:
    return _read(StandIn, "robot/stand_in.yaml")


def person() -> Person:
    return _read(Person, "operator/typical.yaml")


def free() -> Free:
    return _read(Free, "experiments/free.yaml")


def _read(kind: type[Kind], file: str) -> Kind:
    values = OmegaConf.to_container(read_yaml(CONF / file))
    assert isinstance(values, dict)
    return validated(kind, values, CONF / file)
