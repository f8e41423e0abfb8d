"""What the maps are set by."""

from dataclasses import dataclass
from typing import Annotated

import numpy as np
from pydantic import Field


@dataclass(frozen=True)
class RigidSettings:
    """See conf/reachability/config.yaml; lengths in m, smoothing in lattice steps."""

    mount_offset: Annotated[float, Field(ge=0, le=0.5)]
    self_collision: bool
    poses: Annotated[int, Field(ge=1000, le=2**24)]
    profile_voxel: Annotated[float, Field(ge=0.001, le=0.1)]
    voxel: Annotated[float, Field(ge=0.005, le=0.1)]
    closing: Annotated[float, Field(gt=0, le=0.2)]
    smoothing: Annotated[float, Field(ge=0, le=5)]
    smallest: Annotated[int, Field(ge=1, le=1_000_000)]


@dataclass(frozen=True)
class HybridMapSettings:
    """See conf/reachability/config.yaml; voxel in m, smoothing in lattice steps."""

    voxel: Annotated[float, Field(ge=0.007, le=0.1)]
    smoothing: Annotated[float, Field(ge=0, le=5)]
    smallest: Annotated[int, Field(ge=1, le=1_000_000)]
    tilts_deg: list[Annotated[float, Field(gt=0, le=120)]]
    tilted_poses: Annotated[int, Field(ge=1000, le=2**22)]

    def __post_init__(self) -> None:
        if len(set(self.tilts_deg)) < len(self.tilts_deg):
            raise ValueError(f"tilts_deg: found {self.tilts_deg}, expected different angles")

    @property
    def tilts(self) -> list[float]:
        """Of the end effector off straight down, rad."""
        return np.radians(self.tilts_deg).tolist()
