"""Joint angles that put the model's segments where motion capture saw them."""

from dataclasses import dataclass

import mujoco
import numpy as np

from trunkline.frames import rotation_from_wxyz

POSITION_SIGMA = 0.5e-3  # m, what a tracked position is trusted to
ROTATION_SIGMA = np.radians(1.0)  # what a tracked orientation is trusted to, axis misalignment included
BEND_CHANGE_SIGMA = np.radians(6.0)  # how much neighbouring joints differ in a smooth bend
LIMIT_GIVE = 1.5  # a limit is soft: units give when they are pressed on each other
COST_TOLERANCE = 1e-4  # relative decrease of the cost at convergence
STEP_TOLERANCE = 1e-5  # rad, largest change of an angle at convergence


@dataclass
class PoseFit:
    """Joint angles of one frame.

    qpos: rad, shape (nq,). residuals: distance of each segment from its measurement, m, shape (S,).
    iterations: Gauss-Newton steps. converged: whether the last one was below the tolerance.
    """

    qpos: np.ndarray
    residuals: np.ndarray
    iterations: int
    converged: bool


def fit_pose(
    model: mujoco.MjModel,
    segments: tuple[str, ...],
    positions: np.ndarray,
    quaternions: np.ndarray | None = None,
    max_iterations: int = 100,
) -> PoseFit:
    """Least squares over positions, orientations and the change of bend from joint to joint.

    The last term decides what the tracked segments leave open (units without markers) and is weak beside them.

    Args:
        segments: names of the tracked bodies, whose frames are the sites `<name>_center`.
        positions: m, base frame. Shape (S, 3); rows that are not finite are left out.
        quaternions: wxyz. Shape (S, 4), or None for positions alone.
    """
    data = mujoco.MjData(model)
    sites = np.array([model.site(f"{name}_center").id for name in segments])
    targets = None if quaternions is None else rotation_from_wxyz(quaternions).as_matrix()
    seen = np.flatnonzero(np.isfinite(positions).all(axis=1))
    bodies = model.site_bodyid[sites[seen]]
    seen = seen[np.argsort(bodies)]  # the chain numbers its bodies from the base on
    per_joint = int(np.bincount(model.jnt_bodyid).max())
    qpos = np.zeros(model.nq)
    # From the base on, a segment at a time, each new joint first bent as the one before it: a coil of more
    # than one turn has many wrong answers near the straight arm, and none on this way.
    for known in range(1, len(seen) + 1):
        free = model.jnt_bodyid <= model.site_bodyid[sites[seen[known - 1]]]
        first = int(free.sum())
        fit = _gauss_newton(model, data, qpos, sites, positions, targets, seen[:known], free, max_iterations)
        qpos = fit.qpos
        if 0 < first < model.nq:
            qpos[first:] = np.resize(qpos[first - per_joint : first], model.nq - first)
    return fit


def _gauss_newton(model, data, qpos, sites, positions, targets, seen, free, max_iterations) -> PoseFit:
    """Levenberg-Marquardt over the hinges `free` (nv,), against the segments `seen`, from `qpos`."""
    smooth = _smoothness(model)
    lower, upper = model.jnt_range.T * LIMIT_GIVE
    damping = 1e-3
    cost, jacobian, residual = _linearise(model, data, qpos, sites, positions, targets, seen, smooth)
    iteration, settled = 0, False
    while not settled and iteration < max_iterations:
        iteration += 1
        jacobian = jacobian[:, free]
        normal = jacobian.T @ jacobian
        normal += damping * np.diag(np.diag(normal))
        trial = qpos.copy()
        trial[free] += np.linalg.solve(normal, -jacobian.T @ residual)
        trial = np.where(model.jnt_limited, np.clip(trial, lower, upper), trial)
        change = np.abs(trial - qpos).max()
        trial_cost, trial_jacobian, trial_residual = _linearise(
            model, data, trial, sites, positions, targets, seen, smooth
        )
        settled = change < STEP_TOLERANCE or abs(cost - trial_cost) < COST_TOLERANCE * cost
        if trial_cost <= cost:
            qpos, cost, residual = trial, trial_cost, trial_residual
            damping = max(damping / 5, 1e-9)
            jacobian = trial_jacobian
        else:
            damping *= 8
            jacobian = _linearise(model, data, qpos, sites, positions, targets, seen, smooth)[1]
    data.qpos[:] = qpos
    mujoco.mj_kinematics(model, data)
    offsets = np.linalg.norm(data.site_xpos[sites] - positions, axis=1)
    return PoseFit(qpos, offsets, iteration, bool(settled))


def _smoothness(model: mujoco.MjModel) -> np.ndarray:
    """Rows (q_{i+1} - q_i)/σ along the chain, hinge by hinge of the same axis."""
    per_joint = int(np.bincount(model.jnt_bodyid).max())
    rows = np.eye(model.nq, k=per_joint)[:-per_joint] - np.eye(model.nq)[:-per_joint]
    return rows / BEND_CHANGE_SIGMA


def _linearise(model, data, qpos, sites, positions, targets, seen, smooth):
    """Cost, Jacobian (rows, nv) and residual (rows,), all in units of sigma."""
    data.qpos[:] = qpos
    mujoco.mj_kinematics(model, data)
    mujoco.mj_comPos(model, data)
    rows, residuals = [smooth], [smooth @ qpos]
    jac_position, jac_rotation = np.empty((3, model.nv)), np.empty((3, model.nv))
    for index in seen:
        site = sites[index]
        mujoco.mj_jacSite(model, data, jac_position, jac_rotation, site)
        rows.append(jac_position / POSITION_SIGMA)
        residuals.append((data.site_xpos[site] - positions[index]) / POSITION_SIGMA)
        if targets is not None:
            error = _rotation_vector(data.site_xmat[site].reshape(3, 3) @ targets[index].T)
            rows.append(jac_rotation / ROTATION_SIGMA)
            residuals.append(error / ROTATION_SIGMA)
    residual = np.concatenate(residuals)
    return float(residual @ residual), np.concatenate(rows), residual


def _rotation_vector(matrix: np.ndarray) -> np.ndarray:
    quaternion, vector = np.empty(4), np.empty(3)
    mujoco.mju_mat2Quat(quaternion, matrix.ravel())
    mujoco.mju_quat2Vel(vector, quaternion, 1.0)
    return vector
