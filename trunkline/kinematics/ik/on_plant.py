"""What a user gets on the lab's own arm: the network's commands sent to it, for tips of the twin and for its own.

The tips that one or two motors of a section reach are a surface. The arm's lies beside the twin's, and no command takes
the tip across it: so that part of an error is stated too. Targets that are tips of the arm itself have no such part but
where the surface bends.
"""

from collections.abc import Callable
from dataclasses import dataclass

import mujoco
import numpy as np

from trunkline.kinematics.dataset.sampling import sections
from trunkline.kinematics.ik.as_controls import Ask, Reached, reached
from trunkline.kinematics.ik.inputs import gravity_of, position_of
from trunkline.kinematics.residual.residual_map import FEWEST, ResidualMap, RestingPoses
from trunkline.model.simulation.rest import base_frame
from trunkline.model.statics.chain import Chain
from trunkline.model.statics.equilibria import actuated
from trunkline.model.statics.sensitivity import sensitivity

MOTORS = 2  # of a section that pull at once, at most


@dataclass
class Rig:
    """The arm that a model is of.

    Attributes:
        reach: from pulls of the motors from the straight arm, m (N, K), and gravity in the tracked base's frame, m/s²
            (N, 3), to tips at rest in that frame, m (N, 3), NaN where the arm did not come to rest.
        pulls: m, the largest sum of pulls in the session's trials at rest.
    """

    reach: Callable[[np.ndarray, np.ndarray], np.ndarray]
    pulls: float


def score_on_plant(
    model: mujoco.MjModel,
    chain: Chain,
    ask: Ask,
    targets: np.ndarray,
    commands: np.ndarray,
    rig: Rig,
    others: dict[str, Ask] | None = None,
) -> dict:
    """The network's commands on the arm itself, for `targets`, and for tips at which the arm itself rests under the
    `commands` of these ("own_surface"; turned as the twin's).

    Each of all targets, and "within": where the commands' pulls add up to no more than in the session. Beyond, where
    the tip is counts as doubted: a package has what its session went up to, and previews say so.

    Args:
        ask: the network, targets to its answer. others: further networks by name, scored on `targets`.
        targets, commands: as `as_controls.Drawn` has them.
    """
    reach = _in_base_frame(model, rig)
    tips = reach(chain.straight_lengths - commands, gravity_of(targets))
    rested = np.isfinite(tips).all(axis=1)
    own_targets = targets[rested].copy()
    position_of(own_targets)[:] = tips[rested]
    own_surface: dict = _score(chain, ask, own_targets, reach, rig.pulls) if rested.any() else {"targets": 0}
    own_surface["left_out"] = {"unrested": int((~rested).sum())}
    result = _score(chain, ask, targets, reach, rig.pulls) | {"own_surface": own_surface}
    return result | {name: _score(chain, other, targets, reach, rig.pulls) for name, other in (others or {}).items()}


def record(
    model: mujoco.MjModel, chain: Chain, targets: np.ndarray, commands: np.ndarray, rig: Rig
) -> ResidualMap | None:
    """What poses at rest of the arm itself tell of by how far its tip rests beside the twin's, under `commands` and the
    gravity of `targets`; None where too few of them rest."""
    gravity = gravity_of(targets)
    rest = actuated(chain, commands, gravity)
    off = _in_base_frame(model, rig)(chain.straight_lengths - commands, gravity) - rest.position
    usable = np.isfinite(off).all(axis=1) & rest.converged
    if usable.sum() < FEWEST:
        return None
    return ResidualMap.fit(RestingPoses.of(chain, rest, gravity)[usable], off[usable], chain.length)


def _in_base_frame(model: mujoco.MjModel, rig: Rig) -> Callable[[np.ndarray, np.ndarray], np.ndarray]:
    """`rig.reach` with gravity and tips in the base frame of `model`: a rig knows the tracked base, in which the arm's
    mount is turned."""
    origin, turn = base_frame(model)
    return lambda pulls, gravity: (rig.reach(pulls, gravity @ turn.T) - origin) @ turn


def _score(chain: Chain, ask: Ask, targets: np.ndarray, reach, most: float) -> dict:
    """Of all `targets`, of those within `most` m of pulls in all, of those of them that the network does not doubt
    ("trusted"), and of those of them of which it is sure."""
    answer = ask(targets)
    pulls = chain.straight_lengths - answer["commands"]
    tips = reach(pulls, gravity_of(targets))
    end = reached(targets, answer, tips)
    end.rested = np.isfinite(tips).all(axis=1)
    across = across_surface(chain, answer["commands"], gravity_of(targets), tips - position_of(targets))
    within = np.maximum(pulls, 0).sum(axis=1) <= most
    trusted = ~end.doubtful & within
    sure = trusted & ~answer["unsure"]
    end.doubtful = ~sure
    summary = _summary(end, across, chain.length)
    for name, part in (("within", within), ("trusted", trusted), ("sure", sure)):
        summary[name] = _summary(end[part], across[part], chain.length) if part.any() else {"targets": 0}
    return summary


def _summary(end: Reached, across: np.ndarray, length: float) -> dict:
    median, p95 = np.quantile(np.where(np.isfinite(across), across, length), (0.5, 0.95)) * 1e3
    return {"targets": len(across)} | end.metrics(length) | {"across_mm": {"median": median, "p95": p95}}


def across_surface(chain: Chain, commands: np.ndarray, gravity: np.ndarray, error: np.ndarray) -> np.ndarray:
    """How much of an error no command mends, to first order: its part across the twin's surface of tips at the same
    command, m. Shape (N,). NaN where there is no error or no equilibrium.

    The surface is of the two motors of each section that pull most, or are nearest to it. Of several sections, tips
    fill a volume, and all of an error can be mended.

    Args:
        commands: m. Shape (N, K).
        gravity: m/s². Shape (N, 3).
        error: of the tip, m. Shape (N, 3).
    """
    rest = actuated(chain, commands, gravity)
    slopes = sensitivity(chain, rest.qpos, rest.tensions, gravity).tip_by_tension
    taut = chain.gain * (rest.lengths - commands)  # N, less than 0 where a cable hangs loose
    chosen = [part[np.argsort(-taut[:, part], axis=1)[:, :MOTORS]] for part in sections(chain)]
    columns = np.take_along_axis(slopes, np.concatenate(chosen, axis=1)[:, None], axis=2)
    along, _ = np.linalg.qr(columns)  # (N, 3, 2), or (N, 3, 3)
    left = error - np.einsum("nij,nkj,nk->ni", along, along, error)
    return np.where(rest.converged, np.linalg.norm(left, axis=1), np.nan)
