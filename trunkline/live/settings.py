"""All settings of conf/live/config.yaml."""

from typing import Annotated

from pydantic import Field

from trunkline.foresight.settings import Previewing
from trunkline.settings import settings
from trunkline.teleop.messages import Thing

Metres = Annotated[float, Field(ge=-5, le=5)]


@settings
class Config:
    """rate: Hz. ready: of the mount at first, m. floor: its height, m. thing: what hangs there, or None."""

    rate: Annotated[float, Field(ge=20, le=240)]
    ready: Annotated[tuple[Metres, Metres, Metres], Field()]
    floor: Metres
    thing: Thing | None
    preview: Previewing
