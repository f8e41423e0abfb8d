"""What corrections have measured, from which the next plan begins: rests at known commands, and where the tip was.

By how far the tip rests beside the twin's is a Gaussian process (`trunkline/kinematics/residual/residual_map.py`), here
conditioned on these rests as well. Far from them it tells nothing new, and plans are as before. What a preview states
of how far the tip may be off stays the package's: a few rests of one session are no measure of that.

As the steps of a correction pull farther, a twin that bends more than the arm comes to be stopped by its last loose
cable, which is still loose in the arm. So the residual seems to vanish along the steps; but no plan leaves tension that
all cables of a section share, and the process counts a cable that is let out as none. Such a rest tells nothing.
"""

from collections.abc import Iterable, Sequence
from dataclasses import dataclass, replace

import numpy as np
from scipy.spatial.transform import Rotation

from trunkline.ar.session.correction_steps import DOWN
from trunkline.ar.teleop.base_frames import base_frames
from trunkline.ar.teleop.messages import Pose
from trunkline.frames import rotation_from_wxyz
from trunkline.kinematics.dataset.sampling import sections
from trunkline.kinematics.residual.residual_map import ResidualMap, RestingPoses
from trunkline.model.statics.chain import Chain
from trunkline.model.statics.equilibria import Equilibrium, actuated

MOST = 60  # rests, the newest: statics of so many take some 20 ms of a processor, for a plan and for its preview
SHARED = 0.01  # of the largest tension: where all cables of a section have more, it moves the twin's tip by some 0.1 mm


@dataclass(frozen=True)
class MeasuredRest:
    """The robot rests at `joints` (7,), rad, and `commands` (K,), m, its tip measured at `tip` (3,), m, in its base."""

    joints: np.ndarray
    commands: np.ndarray
    tip: np.ndarray


def realigned(rests: Iterable[MeasuredRest], before: Pose, after: Pose) -> list[MeasuredRest]:
    """The same, their tips as cameras have them whose frame is not where it was `before` in the base, but `after`."""
    back, turn = rotation_from_wxyz(np.array(before.quaternion)).inv(), rotation_from_wxyz(np.array(after.quaternion))
    place, origin = np.array(after.position), np.array(before.position)
    return [replace(rest, tip=turn.apply(back.apply(rest.tip - origin)) + place) for rest in rests]


def learnt_from(
    rests: Sequence[MeasuredRest],
    chain: Chain,
    mount_offset: float,
    before: ResidualMap | None,
    lean: Rotation | None = None,
) -> ResidualMap | None:
    """What is learnt of the arm `before` these rests, and by them, beside a twin that leans on its mount by `lean`."""
    if not rests:
        return before
    places, bases = base_frames(np.array([rest.joints for rest in rests]), mount_offset)
    tips = np.einsum("nji,nj->ni", bases, np.array([rest.tip for rest in rests]) - places)
    gravity = np.einsum("nji,j->ni", bases, DOWN)
    return learnt_in_base(chain, np.array([rest.commands for rest in rests]), gravity, tips, before, lean)


def leaning_rest(
    chain: Chain, commands: np.ndarray, gravity: np.ndarray, lean: Rotation | None
) -> tuple[Equilibrium, np.ndarray]:
    """Rests without friction of a twin that leans on its mount by `lean`, and its tips, NaN where it finds none, m (N,
    3). Arguments as of `learnt_in_base`."""
    by = Rotation.identity() if lean is None else lean
    rest = actuated(chain.smooth, commands, by.inv().apply(gravity))
    return rest, np.where(rest.converged[:, None], by.apply(rest.position), np.nan)


def learnt_in_base(
    chain: Chain,
    commands: np.ndarray,
    gravity: np.ndarray,
    tips: np.ndarray,
    before: ResidualMap | None = None,
    lean: Rotation | None = None,
) -> ResidualMap | None:
    """As `learnt_from`. Where the twin finds no rest, or snaps on its way there, or has tension that a section's cables
    share, nothing is learnt.

    Args:
        commands: m (N, K). gravity: m/s², tips: measured, m, both in the arm's base frame. Shapes (N, 3).
    """
    twin, places = leaning_rest(chain, commands, gravity, lean)
    residuals = tips - places
    taut = twin.tensions > SHARED * twin.tensions.max(axis=1, keepdims=True)
    stopped = np.any([taut[:, section].all(axis=1) for section in sections(chain) if len(section) > 2], axis=0)
    tells = ~twin.snapped & np.isfinite(residuals).all(axis=1) & ~stopped
    if not tells.any():
        return before
    poses, residuals = RestingPoses.of(chain, twin, gravity)[tells], residuals[tells]
    return ResidualMap.supposed(poses, residuals, chain.length) if before is None else before.extended(poses, residuals)
