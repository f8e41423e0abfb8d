"""All settings of conf/live/config.yaml."""

from dataclasses import dataclass
from pathlib import Path
from typing import Annotated

from pydantic import Field

from trunkline.ar.correction.correction import CorrectionSettings
from trunkline.ar.preview.settings import Previewing
from trunkline.ar.session.arm_cameras import ArmCameraSettings
from trunkline.ar.teleop.messages import Obstacle, WorldObject
from trunkline.pipeline.config import PROJECT, load_folder
from trunkline.settings import settings

RENAMED = {"boxes": "obstacles", "thing": "object"}  # keys of the release before
Metres = Annotated[float, Field(ge=-5, le=5)]


@dataclass(frozen=True)
class LogSettings:
    """folder: for the logs. period: s of a session that may be lost where its process is killed."""

    folder: Annotated[str, Field(min_length=1, max_length=4096)]
    period: Annotated[float, Field(ge=0.05, le=0.8)]


@dataclass(frozen=True)
class AlignmentSettings:
    """by_eye: whether the base may be put in place by eye. places: that are touched, `apart` m from each other at
    least. limit: m, of the expected error, and of the touch with which a session begins. level_deg: by which the
    headset's vertical may differ from the robot's. mark: what is touched, m, in the flange's frame. at: where the
    expected error is told, m, in the base. anchors: file in which they are kept."""

    by_eye: bool
    places: Annotated[int, Field(ge=4, le=20)]
    apart: Annotated[float, Field(ge=0.01, le=1)]
    limit: Annotated[float, Field(gt=0, le=0.1)]
    level_deg: Annotated[float, Field(gt=0, le=10)]
    mark: tuple[Metres, Metres, Metres]
    at: tuple[Metres, Metres, Metres]
    anchors: Annotated[str, Field(min_length=1, max_length=4096)]


@settings
class SessionConfig:
    """rate: Hz. ready: of the mount at first, m. floor: its height, m. obstacles: that stand there. object: what
    may be grasped, or None."""

    rate: Annotated[float, Field(ge=20, le=240)]
    ready: Annotated[tuple[Metres, Metres, Metres], Field()]
    floor: Metres
    obstacles: tuple[Obstacle, ...]
    object: WorldObject | None
    journal: LogSettings
    alignment: AlignmentSettings
    cameras: ArmCameraSettings
    correction: CorrectionSettings
    preview: Previewing


def read_session_config(folder: Path = PROJECT / "conf/live") -> SessionConfig:
    """The settings of a folder, also under the names of the release before; errors as of `load_folder`."""
    return load_folder(SessionConfig, folder, RENAMED)
