"""How far the twin's tip is from the measured one in the held-out trials at rest, and what can be learnt of that."""

import mujoco
import numpy as np

from trunkline.identification.evaluation.evaluation import marker_positions
from trunkline.identification.parameters.per_session import model_in
from trunkline.kinematics.residual.residual_map import FEWEST, ResidualMap, RestingPoses
from trunkline.recordings.trials.experiments import is_static
from trunkline.recordings.trials.splits import VALIDATE
from trunkline.recordings.trials.trial import Trial, sessions_of
from trunkline.report.certificate.arms import arm_of
from trunkline.report.certificate.poses import StaticPoses, posed

MOST = 300  # different poses that a map is learnt from, evenly taken: its network has a column for each


def at_rest(trials: list[Trial]) -> list[Trial]:
    """Of `trials` those held out, at rest, without a load, that were seen."""
    rested = [t for t in trials if t.split == VALIDATE and is_static(t.experiment) and not t.load]
    return [t for t in rested if t.measured[-1].any()]


def tip_residuals(model: mujoco.MjModel, trials: list[Trial], tip: int) -> np.ndarray:
    """From the twin's marker of number `tip` to where `trials` at rest saw it, m, in the frame of the twin's mount, NaN
    where they did not see it. Shape (N, 3)."""
    residuals = np.full((len(trials), 3), np.nan)
    for session in sessions_of(trials):
        arm = arm_of(model_in(session, model))
        places = [i for i, trial in enumerate(trials) if trial.session == session]
        equilibria = arm.rest(posed([trials[i] for i in places], arm.model))
        for i, qpos, rested in zip(places, equilibria.qpos, equilibria.converged, strict=True):
            if rested and trials[i].measured[-1, tip]:
                place = marker_positions(arm.model, trials[i].markers, qpos)[tip]
                residuals[i] = (trials[i].positions[-1, tip] - place) @ arm.turn
    return residuals


def learnt_from(
    model: mujoco.MjModel, poses: StaticPoses, residuals: np.ndarray
) -> tuple[ResidualMap | None, np.ndarray]:
    """What held-out trials tell of by how far the tip rests beside the twin's, and by how much each is missed with
    that learnt from other poses alone, m (N, 3). None, and the residuals, where there are too few different poses, or
    the tip is no nearer with it.

    Args:
        residuals: as `tip_residuals` has them, finite ones. Shape (N, 3).
    """
    arm = arm_of(model)
    resting = arm.resting(poses)
    rested = np.flatnonzero(np.isfinite(resting.pulls).all(axis=1))
    groups = [rested[rows] for rows in resting[rested].repeats()]
    if len(groups) < FEWEST:
        return None, residuals
    few = [groups[i] for i in np.linspace(0, len(groups) - 1, min(len(groups), MOST)).round().astype(int)]
    different = RestingPoses(*(np.array([part[rows].mean(axis=0) for rows in few])
                               for part in (resting.pulls, resting.gravity)))  # fmt: skip
    means = np.array([residuals[rows].mean(axis=0) for rows in few])
    learnt = ResidualMap.fit(different, means, arm.chain.length)
    if not learnt.is_worth_it:
        return None, residuals
    missed = residuals.copy()
    missed[rested] -= learnt.mean(resting[rested])
    for rows, mean, left_out in zip(few, means, learnt.left_out(), strict=True):
        missed[rows] = residuals[rows] - mean + left_out
    return learnt, missed
