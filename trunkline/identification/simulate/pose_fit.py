"""Joint angles that put the model's markers where motion capture saw them, and those from which a trial starts."""

from dataclasses import dataclass

import mujoco
import numpy as np
from mujoco import minimize

from trunkline.errors import InputError
from trunkline.frames import rotation_from_wxyz
from trunkline.model.arm_model import ArmModel
from trunkline.recordings.trials.experiments import is_static
from trunkline.recordings.trials.trial import Trial

POSITION_SIGMA = 0.5e-3  # m, what a tracked position is trusted to
ROTATION_SIGMA = np.radians(1.0)  # what a tracked orientation is trusted to, axis misalignment included
BEND_CHANGE_SIGMA = np.radians(6.0)  # how much neighbouring joints differ in a smooth bend
LIMIT_GIVE = 1.5  # a limit is soft: units give when they are pressed on each other
UNLIMITED = 2 * np.pi  # rad, of hinges without limits
STEP_TOLERANCE = 1e-5  # relative step at convergence
GRADIENT_TOLERANCE = 1e-3  # of the cost in units of sigma², with columns of unit length
AT_A_TIME = 3  # markers: half the time of one by one, to the same poses
QUIET_FRAMES = 3  # before the start: there the low-pass has not yet smeared the motion into the hold
REACH = 2  # frames to either side for the velocity at the start; the low-pass leaves nothing finer
SWAY_FRAMES = 8  # between the poses that tell how a hand moves the arm that it is about to let go
LOOK_BACK = 30  # frames in which to look for a start pose that enough cameras saw
MEASURED_SHARE = 0.6  # of the markers that must be measured in the frame of the start pose


@dataclass
class PoseFit:
    """Joint angles of one frame.

    qpos: of the arm's hinges, rad, shape (n,). residuals: distance of each marker from its measurement, m, shape (S,).
    iterations: of the last descent, on all markers. converged: whether it ended before they ran out.
    """

    qpos: np.ndarray
    residuals: np.ndarray
    iterations: int
    converged: bool


class PoseProblem:
    """Residuals of joint angles: positions, orientations, and the change of bend from joint to joint.

    The last term decides what the markers leave open (units without any) and is weak beside them.

    Args:
        markers: names of the tracked bodies, whose frames are the sites `<name>_center`.
        positions: m, base frame. Shape (S, 3); rows that are not finite are left out.
        quaternions: wxyz. Shape (S, 4), or None for positions alone.

    Attributes:
        measured: indices of the measured markers, from the base on.
    """

    def __init__(
        self,
        model: mujoco.MjModel,
        markers: tuple[str, ...],
        positions: np.ndarray,
        quaternions: np.ndarray | None = None,
    ):
        self.model, self.data = model, mujoco.MjData(model)
        self.sites = ArmModel(model).marker_sites(markers)
        self.positions = positions
        visible = np.isfinite(positions).all(axis=1)
        measured = np.flatnonzero(visible)
        self._targets = None
        if quaternions is not None:
            sound = np.where(np.reshape(visible, (-1, 1)), quaternions, [1.0, 0, 0, 0])
            self._targets = rotation_from_wxyz(sound).as_matrix()
        # the chain numbers its bodies from the base
        self.measured = measured[np.argsort(model.site_bodyid[self.sites[measured]])]
        self.hinges = int(np.bincount(model.jnt_bodyid).max())  # of each joint
        self.angles = ArmModel(model).hinge_count
        # of each joint, its hinges about x and about y: in every second unit, the one about y may be the first
        order = np.argsort(np.abs(model.jnt_axis[: self.angles]).argmax(axis=1).reshape(-1, self.hinges), axis=1)
        self.by_axis = self.hinges * np.arange(len(order))[:, None] + order
        along = np.eye(self.angles)[self.by_axis.ravel()]
        rows = along[self.hinges :] - along[: -self.hinges]
        self._smooth = rows / BEND_CHANGE_SIGMA

    def linearise(self, qpos: np.ndarray, measured: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
        """Jacobian (R, n) and residuals (R,) in units of sigma, against the markers `measured`, by the arm's n angles.

        First the changes of bend; then of every marker three rows for its position, and three for its orientation
        if it has one.
        """
        model, data = self.model, self.data
        data.qpos[: self.angles] = qpos
        mujoco.mj_kinematics(model, data)
        mujoco.mj_comPos(model, data)
        rows, residuals = [self._smooth], [self._smooth @ qpos]
        jac_position, jac_rotation = np.empty((3, model.nv)), np.empty((3, model.nv))
        for index in measured:
            site = self.sites[index]
            mujoco.mj_jacSite(model, data, jac_position, jac_rotation, site)
            rows.append(jac_position[:, : self.angles] / POSITION_SIGMA)
            residuals.append((data.site_xpos[site] - self.positions[index]) / POSITION_SIGMA)
            if self._targets is not None:
                error = _rotation_vector(data.site_xmat[site].reshape(3, 3) @ self._targets[index].T)
                rows.append(jac_rotation[:, : self.angles] / ROTATION_SIGMA)
                residuals.append(error / ROTATION_SIGMA)
        return np.concatenate(rows), np.concatenate(residuals)

    def position_rows(self) -> np.ndarray:
        """Which residuals are those of the positions of all markers `measured`, M of them. Shape (M, 3)."""
        each = 3 if self._targets is None else 6
        return len(self._smooth) + each * np.arange(len(self.measured))[:, None] + np.arange(3)


def fit_pose(
    model: mujoco.MjModel,
    markers: tuple[str, ...],
    positions: np.ndarray,
    quaternions: np.ndarray | None = None,
    max_iterations: int = 300,
) -> PoseFit:
    """Least squares over the residuals of a `PoseProblem`, whose arguments these are, by `mujoco.minimize`."""
    problem = PoseProblem(model, markers, positions, quaternions)
    measured, hinges, angles = problem.measured, problem.hinges, problem.angles
    qpos = np.zeros(angles)
    # From the base on, a few markers at a time, each new joint first bent as the one before it: a coil of more
    # than one turn has many wrong answers near the straight arm, and none on this way.
    for count in [*range(AT_A_TIME, len(measured), AT_A_TIME), len(measured)]:
        free = model.jnt_bodyid[:angles] <= model.site_bodyid[problem.sites[measured[count - 1]]]
        first = int(free.sum())
        fit = _descend(problem, qpos, measured[:count], free, max_iterations)
        qpos = fit.qpos
        if 0 < first < angles:
            fitted = first // hinges
            qpos[problem.by_axis[fitted:]] = qpos[problem.by_axis[fitted - 1]]
    return fit


def _descend(
    problem: PoseProblem, qpos: np.ndarray, measured: np.ndarray, free: np.ndarray, max_iterations: int
) -> PoseFit:
    """Least squares over the hinges `free` (n,), against markers `measured`, from `qpos`, within the limits' give."""
    model = problem.model
    cache: dict[bytes, tuple[np.ndarray, np.ndarray]] = {}

    def linear(angles: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
        """Jacobian and residuals at some angles; MuJoCo asks for both at each iterate."""
        key = angles.tobytes()
        if key not in cache:
            while len(cache) > 1:  # the iterate and the step tried from it
                cache.pop(next(iter(cache)))
            pose = qpos.copy()
            pose[free] = angles
            cache[key] = problem.linearise(pose, measured)
        return cache[key]

    arm = len(free)
    limits = model.jnt_range[:arm].T * LIMIT_GIVE
    lower, upper = np.where(model.jnt_limited[:arm], limits, [[-UNLIMITED], [UNLIMITED]])
    angles, steps = minimize.least_squares(
        qpos[free],
        lambda columns: np.stack([linear(column)[1] for column in columns.T], axis=1),
        [lower[free], upper[free]],
        lambda column, _: linear(column[:, 0])[0][:, free],
        xtol=STEP_TOLERANCE,
        gtol=GRADIENT_TOLERANCE,
        max_iter=max_iterations,
        x_scale="jac",
        verbose=minimize.Verbosity.SILENT,
    )
    qpos = qpos.copy()
    qpos[free] = angles
    problem.data.qpos[: len(qpos)] = qpos
    mujoco.mj_kinematics(model, problem.data)
    offsets = np.linalg.norm(problem.data.site_xpos[problem.sites] - problem.positions, axis=1)
    return PoseFit(qpos, offsets, len(steps), len(steps) < max_iterations)


def _rotation_vector(matrix: np.ndarray) -> np.ndarray:
    quaternion, vector = np.empty(4), np.empty(3)
    mujoco.mju_mat2Quat(quaternion, matrix.ravel())
    mujoco.mju_quat2Vel(vector, quaternion, 1.0)
    return vector


def start_frames(trial: Trial) -> tuple[int, int]:
    """The last frame that is not compared, the arm being still held then, and the one of the pose to start from."""
    static = is_static(trial.experiment)
    last = 0 if static else max(int(np.searchsorted(trial.time, trial.start + 1e-9, side="right")) - 1, 0)
    start_frame = _measured_frame(trial, last if trial.in_motion else max(last - QUIET_FRAMES, 0))
    # of an arm in motion, pose and velocity hold in that frame
    return (start_frame if trial.in_motion else last), start_frame


def _measured_frame(trial: Trial, latest: int) -> int:
    """The last frame up to `latest` in which enough markers were measured."""
    for frame in range(latest, max(latest - LOOK_BACK, -1), -1):
        if trial.measured[frame].mean() >= MEASURED_SHARE:
            return frame
    raise InputError(
        f"trial {trial.name}: found {int(trial.measured[latest].sum())} of {len(trial.markers)} markers measured at "
        f"its start, {trial.time[latest]:.2f} s, expected {MEASURED_SHARE:.0%} of them"
    )


def start_of(trial: Trial, model: mujoco.MjModel, frame: int) -> tuple[PoseFit, np.ndarray, np.ndarray]:
    """The model's pose in `frame`, and joint angles, rad, and velocities, rad/s, to start from. Shape (n,)."""
    fit = _fit_frame(trial, model, frame)
    if trial.in_motion:
        return fit, fit.qpos, _velocity(trial, model, frame)
    if trial.swaying:
        return fit, *_extrapolated(trial, model, frame)
    return fit, fit.qpos, np.zeros(ArmModel(model).hinge_count)


def measured_pose(trial: Trial, frame: int) -> tuple[np.ndarray, np.ndarray | None]:
    """Positions (S, 3) of a frame, m, nan where not measured, and orientations (S, 4) if the trial has any."""
    positions = np.where(trial.measured[frame][:, None], trial.positions[frame], np.nan)
    return positions, None if trial.quaternions is None else trial.quaternions[frame]


def _fit_frame(trial: Trial, model: mujoco.MjModel, frame: int) -> PoseFit:
    return fit_pose(model, trial.markers, *measured_pose(trial, frame))


def _velocity(trial: Trial, model: mujoco.MjModel, frame: int) -> np.ndarray:
    """Joint velocities at a frame, rad/s, from the poses a few frames before and after it. Shape (nv,)."""
    before, after = max(frame - REACH, 0), min(frame + REACH, len(trial.time) - 1)
    turned = _fit_frame(trial, model, after).qpos - _fit_frame(trial, model, before).qpos
    return turned / (trial.time[after] - trial.time[before])


def _extrapolated(trial: Trial, model: mujoco.MjModel, frame: int) -> tuple[np.ndarray, np.ndarray]:
    """Joint angles, rad, and velocities, rad/s, at the start of an arm that a hand still moves then: a parabola through
    its poses up to `frame`, before the low-pass smears in what comes after. Each of shape (n,)."""
    apart = min(SWAY_FRAMES, frame // 2)
    if not apart:
        return _fit_frame(trial, model, frame).qpos, _velocity(trial, model, frame)
    frames = frame - apart * np.arange(3)
    poses = np.stack([_fit_frame(trial, model, frame).qpos for frame in frames.tolist()])
    parabola = np.polyfit(trial.time[frames] - trial.start, poses, 2)
    return parabola[2], parabola[1]
