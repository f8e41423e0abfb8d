"""Where markers sit beside the arm's axis, from measured poses and the arm's geometry alone, without any forces."""

import mujoco
import numpy as np

from trunkline.identification.simulate.experiment import arm_in
from trunkline.identification.simulate.pose_fit import (
    POSITION_SIGMA,
    PoseProblem,
    fit_pose,
    measured_pose,
    start_frames,
)
from trunkline.model.arm_model import ArmModel
from trunkline.recordings.trials.splits import IDENTIFY
from trunkline.recordings.trials.trial import Trial

MARKER_SIGMA = 2e-3  # m, how far beside the arm's axis a marker is expected; a prior where poses leave it open
ROUNDS = 3  # of fitting poses and moving markers; a round solves for both, but for what is not linear


def with_measured_markers(model: mujoco.MjModel, trials: list[Trial]) -> mujoco.MjModel:
    """A copy of `model` whose tracked sites are where the trials to identify from saw them in their start poses."""
    model = model.__copy__()
    fitted = [trial for trial in trials if trial.split == IDENTIFY]
    sites = ArmModel(model).marker_sites(fitted[0].markers)
    model.site_sameframe[sites] = mujoco.mjtSameFrame.mjSAMEFRAME_NONE  # else a site at its body's origin stays there
    moved = np.zeros((len(sites), 3))
    straight = model.site_pos[sites].copy()
    for _ in range(ROUNDS):
        moved += _offsets(model, fitted, moved)
        model.site_pos[sites] = straight + moved
    return model


def _offsets(model: mujoco.MjModel, trials: list[Trial], moved: np.ndarray) -> np.ndarray:
    """By how much further each marker is off its site, in its body's frame, m, `moved` by which it was moved. (S, 3).

    Least squares over the markers and the joint angles of every start pose together; the angles, each of one pose,
    are eliminated first.
    """
    size = moved.size
    normal = np.eye(size) / MARKER_SIGMA**2
    right = -moved.ravel() / MARKER_SIGMA**2
    for trial in trials:
        frame = start_frames(trial)[1]
        pose, arm = measured_pose(trial, frame), arm_in(trial, model, frame)
        problem = PoseProblem(arm, trial.markers, *pose)
        jacobian, residual = problem.linearise(fit_pose(arm, trial.markers, *pose).qpos, problem.measured)
        design = np.zeros((len(residual), size))
        for index, rows in zip(problem.measured, problem.position_rows(), strict=True):
            body = model.site_bodyid[problem.sites[index]]
            design[np.ix_(rows, 3 * index + np.arange(3))] = problem.data.xmat[body].reshape(3, 3) / POSITION_SIGMA
        basis = np.linalg.qr(jacobian)[0]
        design -= basis @ (basis.T @ design)
        normal += design.T @ design
        right -= design.T @ residual
    return np.linalg.solve(normal, right).reshape(-1, 3)
