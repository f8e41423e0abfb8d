"""What a lab could record next, and what it costs: see conf/suggest/config.yaml."""

from dataclasses import dataclass
from typing import Annotated

from pydantic import Field

from trunkline.settings import settings

Angles = list[Annotated[float, Field(gt=0, le=180)]]
Turns = list[Annotated[float, Field(gt=0, le=1000)]]
Sides = Annotated[int, Field(ge=1, le=72)]
Shares = list[Annotated[float, Field(gt=0, lt=1)]]
Share = Annotated[float, Field(gt=0, lt=1)]
Offset = Annotated[float, Field(gt=-1, lt=1)]
Frequencies = Annotated[list[Annotated[float, Field(gt=0, le=50)]], Field(min_length=1, max_length=20)]
Minutes = Annotated[float, Field(gt=0, le=10_000)]


@dataclass
class Sines:
    """frequencies: Hz. amplitude, offset: of the pulls, over the arm's length."""

    frequencies: Frequencies
    amplitude: Share
    offset: Offset


@dataclass
class Costs:
    """Minutes that a trial of each kind takes; load: more, with a mass at the tip."""

    static_tilt: Minutes
    release: Minutes
    static_pull: Minutes
    curl: Minutes
    motion: Minutes
    load: Minutes

    def of(self, kind: str, load: float) -> float:
        return getattr(self, kind) + (self.load if load else 0.0)


@settings
class Recordable:
    """Each field as conf/suggest/config.yaml says."""

    tilts_deg: Angles
    tilt_sides: Sides
    release_turns_deg: Turns
    release_sides: Sides
    pulls: Shares
    curls: Shares
    loads: Shares
    motions: list[Sines]
    frame_rate: Annotated[float, Field(ge=1, le=2000)]
    minutes: Costs
