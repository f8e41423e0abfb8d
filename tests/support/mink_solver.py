"""mink on a Panda: an inverse kinematics that shares nothing with `trunkline.kinematics.panda`."""

import mink
import mujoco
import numpy as np

from trunkline.kinematics.panda.inverse import POSITION_TOLERANCE, ROTATION_TOLERANCE

STEPS = 60  # per start
PATIENCE = 12  # steps without getting a tenth nearer, after which a start is given up


class Mink:
    """mink on one Panda: joint angles that bring the mount to a point, straight down, any yaw, without collisions."""

    def __init__(self, model: mujoco.MjModel):
        self.configuration = mink.Configuration(model)
        self.task = mink.FrameTask(
            "mount", "site", position_cost=1.0, orientation_cost=[1.0, 1.0, 0.0], lm_damping=1e-3
        )
        self.limits = [mink.ConfigurationLimit(model)]

    def solve(self, point: np.ndarray, starts: int, seed: list[int]) -> np.ndarray | None:
        """Joint angles (7,), rad, at `point` (3,), m, from the first of `starts` random ones that ends there."""
        low, high = self.configuration.model.jnt_range.T
        rng = np.random.default_rng(seed)
        down = mink.SO3.from_matrix(np.diag([1.0, -1.0, -1.0]))
        self.task.set_target(mink.SE3.from_rotation_and_translation(down, point))
        ends = (self._descend(rng.uniform(low, high), point) for _ in range(starts))
        return next((q for q in ends if q is not None), None)

    def _descend(self, q: np.ndarray, point: np.ndarray) -> np.ndarray | None:
        self.configuration.update(q)
        best, since = np.inf, 0
        for _ in range(STEPS):
            away, tilt = errors(self.configuration.data, point)
            if away <= POSITION_TOLERANCE and tilt <= ROTATION_TOLERANCE:
                return self.configuration.q if self.holds(self.configuration.q, point, 1.0) else None
            best, since = (away + tilt, 0) if away + tilt < 0.9 * best else (best, since + 1)
            if since > PATIENCE:
                return None
            velocity = mink.solve_ik(self.configuration, [self.task], 1.0, "daqp", damping=1e-6, limits=self.limits)
            self.configuration.integrate_inplace(velocity, 1.0)
        return None

    def holds(self, q: np.ndarray, point: np.ndarray, looseness: float) -> bool:
        """Whether `q` (7,), rad, keeps the limits, brings the mount to `point` straight down, and nothing touches."""
        model = self.configuration.model
        data = mujoco.MjData(model)
        data.qpos[:] = q
        mujoco.mj_forward(model, data)
        low, high = model.jnt_range.T
        away, tilt = errors(data, point)
        near = away <= looseness * POSITION_TOLERANCE and tilt <= looseness * ROTATION_TOLERANCE
        return bool(near and ((q >= low - 1e-9) & (q <= high + 1e-9)).all() and data.ncon == 0)


def errors(data: mujoco.MjData, point: np.ndarray) -> tuple[float, float]:
    """Of the mount: distance to `point` in m, and angle off straight down in rad."""
    site = data.site("mount")
    axis = site.xmat.reshape(3, 3)[:, 2]
    return float(np.linalg.norm(site.xpos - point)), float(np.arctan2(np.hypot(axis[0], axis[1]), -axis[2]))
