"""The lab's arm and the stand-in's settings, as the rehearsal takes them."""

from functools import cache

from omegaconf import OmegaConf
from pydantic import TypeAdapter

from demo.plants.choice import plant_of
from demo.plants.stranger import Stranger
from demo.rig import ROOT, Config
from rehearsal.first_grasp import SETTINGS
from rehearsal.robot.stand_in import StandIn
from trunkline.pipeline.config import load_config
from trunkline.settings import read_yaml


def settings() -> StandIn:
    return TypeAdapter(StandIn).validate_python(OmegaConf.to_container(read_yaml(SETTINGS)))


@cache
def stranger() -> Stranger:
    plant = plant_of(load_config(Config, "record", ROOT))
    assert isinstance(plant, Stranger)
    return plant
