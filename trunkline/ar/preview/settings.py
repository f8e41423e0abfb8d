"""How plans are previewed, by whoever shows them before they are confirmed."""

from dataclasses import dataclass
from typing import Annotated

from pydantic import Field

from trunkline.ar.hybrid.tip_uncertainty import BaseAlignment
from trunkline.ar.hybrid.worlds import Material

Positive = Annotated[float, Field(gt=0, le=100)]
Zero = Annotated[float, Field(ge=0, le=100)]
Share = Annotated[float, Field(ge=0, le=1)]


@dataclass
class Previewing:
    """Previews of grasps, and the assistant: see rehearsal/conf/rehearse/preview/batch.yaml."""

    futures: Annotated[int, Field(ge=1, le=1000)]
    assistant: Annotated[int, Field(ge=0, le=1000)]
    sure: Share
    step: Annotated[float, Field(gt=0, le=0.01)]
    hold: Zero
    sag: Annotated[float, Field(gt=0, le=1)]
    slip: Annotated[float, Field(gt=0, le=1)]
    lifted: Share
    friction: Share
    place: Annotated[list[Share], Field(min_length=3, max_length=3)]
    turn_deg: Zero
    alignment: BaseAlignment
    material: Material
    string: Positive
