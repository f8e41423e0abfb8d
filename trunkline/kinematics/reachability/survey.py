"""The maps and how good they are, in one call."""

from collections.abc import Callable
from dataclasses import dataclass
from typing import Annotated

import numpy as np
from pydantic import Field

from trunkline.kinematics.dataset.gravities import spread
from trunkline.kinematics.reachability.checks import Check, LabelSettings, SpotCheckSettings, check_maps
from trunkline.kinematics.reachability.maps import Maps, blend_angles, build_maps
from trunkline.kinematics.reachability.settings import HybridMapSettings, RigidSettings
from trunkline.kinematics.reachability.soft import SoftSettings
from trunkline.kinematics.reachability.tips import ArmTips
from trunkline.kinematics.reachability.workspace_surface import build_surfaces
from trunkline.settings import Seed


@dataclass
class SurveySettings:
    """See conf/reachability/config.yaml. seed: of poses, of the points that are checked and of the solver's starts."""

    most_triangles: Annotated[int, Field(ge=100, le=10_000_000)]
    seed: Seed
    rigid: RigidSettings
    labels: LabelSettings
    soft: SoftSettings
    hybrid: HybridMapSettings
    spot_check: SpotCheckSettings

    def parts(self, tips_at: ArmTips) -> int:
        """How often `survey` calls `done`."""
        fields = len(blend_angles(tips_at.angles, self.step(tips_at)))
        if tips_at.largest is not None:
            fields, checks = fields + self.soft.sheets.directions, self.soft.sheets.heldout
        else:
            checks = max(1, fields - 1)
        return fields + checks + 5 + len(self.hybrid.tilts)

    def step(self, tips_at: ArmTips) -> float:
        """Between soft fields, at most, rad: those between the angles that are shown are for blending alone."""
        return self.soft.angle_step if tips_at.largest is None else np.pi


def survey(tips_at: ArmTips, settings: SurveySettings, done: Callable[[str], None]) -> tuple[Maps, Check]:
    """Rigid, soft and hybrid maps, and their check. `done` hears of each part."""
    soft, seed = settings.soft, settings.seed
    maps = build_maps(
        tips_at,
        tips_at.angles,
        settings.rigid,
        soft,
        settings.hybrid,
        soft_voxel=soft.voxel,
        step=settings.step(tips_at),
        most_triangles=settings.most_triangles,
        seed=seed,
        done=done,
    )
    if tips_at.largest is not None:
        surfaces = soft.sheets
        downs = spread(surfaces.directions, tips_at.largest, crowd=True)
        maps.surfaces = build_surfaces(
            tips_at.chain, downs, surfaces.around, surfaces.along, soft.tolerance, lambda: done("sheet"),
            tips_at.learnt,
        )
    return maps, check_maps(maps, tips_at, soft, settings.labels, settings.spot_check, seed=seed, done=done)
