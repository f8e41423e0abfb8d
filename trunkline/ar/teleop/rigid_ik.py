"""The rigid robot's inverse kinematics from where it is, by mink: the nearest pose that holds the mount as asked."""

import mink
import mujoco
import numpy as np

from trunkline.ar.teleop.alignment import base_quaternion, flange_turn
from trunkline.ar.teleop.vectors import Vector, conjugate, multiply
from trunkline.errors import InputError
from trunkline.frames import rotation_from_wxyz
from trunkline.kinematics.panda.collision import clearance
from trunkline.kinematics.panda.kinematics import Q_MAX, Q_MIN
from trunkline.kinematics.panda.mjcf import panda_spec

POSITION = 1e-4  # m
ROTATION = 1e-3  # rad
STEPS, RATE = 150, 1.0  # most steps, each a whole Gauss-Newton step
LARGEST = 0.2  # rad, of a joint in a step, so that the nearest solution is found
POSTURE = 1e-3  # cost of leaving the pose from which it starts, beside 1 of missing the target
NEAR = 1e-3  # rad from a limit at which a joint counts as at it


class RigidIK:
    """For a Panda whose mount is `mount_offset` m from the flange."""

    def __init__(self, mount_offset: float) -> None:
        self._offset = mount_offset
        self._configuration = mink.Configuration(panda_spec(mount_offset).compile())

    def solve(self, start: np.ndarray, mount: Vector, pointing: Vector, heading: float) -> np.ndarray:
        """Joints (7,), rad, that bring the mount to `mount` (m), the arm pointing and turned as asked, from `start`
        (7,).

        Raises:
            InputError: naming what is in the way: a joint at its limit, the robot itself, or its reach.
        """
        turn = multiply(base_quaternion(pointing, heading), conjugate(flange_turn()))
        target = mink.SE3.from_rotation_and_translation(
            mink.SO3.from_matrix(rotation_from_wxyz(np.array(turn)).as_matrix()), np.array(mount)
        )
        configuration = self._configuration
        task = mink.FrameTask("mount", "site", position_cost=1.0, orientation_cost=0.3, lm_damping=1e-3)
        task.set_target(target)
        posture = mink.PostureTask(configuration.model, cost=POSTURE)
        posture.set_target(np.clip(start, Q_MIN, Q_MAX))
        limits = [
            mink.ConfigurationLimit(configuration.model),
            mink.VelocityLimit(configuration.model, {_joint(configuration.model, i): LARGEST for i in range(7)}),
        ]
        configuration.update(np.clip(start, Q_MIN, Q_MAX))
        for count in range(STEPS):
            error = task.compute_error(configuration)
            if np.linalg.norm(error[:3]) <= POSITION and np.linalg.norm(error[3:]) <= ROTATION:
                break
            # what is left of the wish to stay would keep the mount off its target: it fades
            tasks = [task, posture] if count < STEPS // 2 else [task]
            velocity = mink.solve_ik(configuration, tasks, RATE, "daqp", damping=1e-6, limits=limits)
            configuration.integrate_inplace(velocity, RATE)
        else:
            self._refuse(configuration.q, error)
        q = configuration.q.copy()
        gap = float(clearance(q[None], self._offset)[0])
        if gap <= 0:
            raise InputError(f"self-collision: the robot would touch itself at the target, by {-1e3 * gap:.0f} mm")
        return q

    def _refuse(self, q: np.ndarray, error: np.ndarray) -> None:
        at = [i + 1 for i in range(7) if q[i] <= Q_MIN[i] + NEAR or q[i] >= Q_MAX[i] - NEAR]
        missed = f"{1e3 * np.linalg.norm(error[:3]):.0f} mm and {np.degrees(np.linalg.norm(error[3:])):.0f}°"
        if at:
            names = ", ".join(map(str, at))
            raise InputError(f"limit: joint {names} of the rigid robot is at its limit, {missed} off the target")
        raise InputError(f"out of reach: the rigid robot comes no nearer to its target than {missed}")


def _joint(model: mujoco.MjModel, index: int) -> str:
    return model.joint(index).name
