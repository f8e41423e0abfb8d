"""The maps and how good they are, in one call."""

from collections.abc import Callable
from dataclasses import dataclass
from typing import Annotated

from pydantic import Field

from trunkline.reachability.checks import Check, LabelSettings, SpotCheckSettings, check_maps
from trunkline.reachability.maps import Maps, blend_angles, build_maps
from trunkline.reachability.settings import HybridSettings, RigidSettings
from trunkline.reachability.soft import SoftSettings
from trunkline.reachability.tips import ArmTips
from trunkline.settings import Seed


@dataclass
class Survey:
    """See conf/reachability/config.yaml. seed: of poses, of the points that are checked and of the solver's starts."""

    most_triangles: Annotated[int, Field(ge=100, le=10_000_000)]
    seed: Seed
    rigid: RigidSettings
    labels: LabelSettings
    soft: SoftSettings
    hybrid: HybridSettings
    spot_check: SpotCheckSettings

    def parts(self, tips_at: ArmTips) -> int:
        """How often `survey` calls `done`."""
        fields = len(blend_angles(tips_at.angles, self.soft.angle_step))
        return 2 * fields + 4 + len(self.hybrid.tilts)


def survey(tips_at: ArmTips, settings: Survey, done: Callable[[str], None]) -> tuple[Maps, Check]:
    """Rigid, soft and hybrid maps, and their check. `done` hears of each part."""
    soft, seed = settings.soft, settings.seed
    maps = build_maps(
        tips_at,
        tips_at.angles,
        settings.rigid,
        soft,
        settings.hybrid,
        soft_voxel=soft.voxel,
        step=soft.angle_step,
        most_triangles=settings.most_triangles,
        seed=seed,
        done=done,
    )
    return maps, check_maps(maps, tips_at.chain, tips_at, settings.labels, settings.spot_check, seed=seed, done=done)
