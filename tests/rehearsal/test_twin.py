"""The twin that plans are tried on: it leans as the robot does, and what stands does so on its board."""

from dataclasses import replace

import mujoco
import numpy as np
import pytest
from scipy.spatial.transform import Rotation

from rehearsal import settings
from tests.ar.hybrid.conftest import hybrid_settings, rubbing_arm
from trunkline.ar.hybrid.rollout_batch import joined
from trunkline.ar.hybrid.rollouts import CommandTrajectory, rollouts
from trunkline.ar.hybrid.tip_uncertainty import BaseAlignment
from trunkline.ar.hybrid.uncertainty import GraspUncertainty, nominal_sample
from trunkline.ar.preview.preview_twin import RobotModel, compose_twin
from trunkline.ar.teleop.messages import Obstacle, World, WorldObject
from trunkline.kinematics.panda.kinematics import mount_pose
from trunkline.kinematics.panda.mounts import PandaRobot
from trunkline.model.arm.spiral import spiral_chain

READY = np.array([0.0, -0.4, 0.0, -2.2, 0.0, 1.8, 0.785])
BASKET = WorldObject("the basket", "basket", 0.03, 0.06, 0.2, (0.5, 0.4, 0.05), support="standing")
STAND = Obstacle("stand", (0.4, 0.3, -0.03), (0.6, 0.5, 0.0))
WORLD = World("w", (Obstacle("floor", (-3, -3, -2), (3, 3, -0.75)), STAND))


@pytest.fixture(scope="module")
def world_model() -> RobotModel:
    arm = rubbing_arm(spiral_chain(length=0.2, base_width=0.05, tip_width=0.02, units=6), 3)
    robot = hybrid_settings(robot="panda").robot
    assert isinstance(robot, PandaRobot)
    return RobotModel(arm, GraspUncertainty(), robot, BaseAlignment(0.0, 0.0))


def composed(world_model: RobotModel, object: WorldObject, lean: Rotation, left=None):
    arm = world_model.arm.copy().compile()
    straight = arm.tendon_length0[arm.actuator_trnid[:, 0]]
    return compose_twin(world_model, WORLD, object, READY, straight, settings.previewing(), lean, left), straight


def tip_of(twin, world_model: RobotModel) -> np.ndarray:
    """In the frame of the mount without its lean, m."""
    data = mujoco.MjData(twin.model)
    data.qpos[:] = twin.start
    mujoco.mj_kinematics(twin.model, data)
    place, turn = (part[0] for part in mount_pose(READY[None], world_model.robot.mount_offset))
    return (data.site("tip").xpos - place) @ turn * [1, -1, -1]


def test_the_twin_hangs_as_the_robot_was_seen_to(world_model):
    twin, _ = composed(world_model, BASKET, Rotation.identity())
    plain = tip_of(twin, world_model)
    tip_seen = plain + [0.004, -0.002, 0.0]
    lean = world_model.lean(tip_seen)
    assert 0.01 < lean.magnitude() < 0.05
    leaning, _ = composed(world_model, BASKET, lean)
    np.testing.assert_allclose(tip_of(leaning, world_model)[:2], tip_seen[:2], atol=2e-4)


@pytest.mark.parametrize("high", [-0.004, 0.0, 0.006])
def test_what_stands_stays_where_it_is_seen(world_model, high):
    """On a board that the client takes for higher or lower than it is; its bar seen not quite level."""
    x, y, _ = BASKET.position
    turn = Rotation.from_euler("zx", [0.3, 0.005]).as_quat(scalar_first=True)
    object = replace(BASKET, position=(x, y, BASKET.position[2] + high), quaternion=tuple(map(float, turn)))
    twin, straight = composed(world_model, object, Rotation.identity())
    way = CommandTrajectory(0.1, np.tile(READY, (6, 1)), np.tile(straight, (6, 1)))
    motion = joined(list(rollouts(twin, way, nominal_sample())))
    assert np.abs(motion.object[0, :, :3] - object.position).max() < 1e-3
    upright = Rotation.from_quat(motion.object[0, -1, 3:], scalar_first=True).as_matrix()[2, 2]
    assert upright > 1 - 1e-5


def test_a_hand_over_begins_as_the_grasp_ended(world_model):
    hanging = replace(BASKET, shape="cylinder", diameter=0.04, support="hanging", position=(0.5, 0.4, 0.3))
    first, straight = composed(world_model, hanging, Rotation.identity())
    assert first.start is not None
    pose = first.start + np.linspace(0.0, 0.01, first.model.nq)
    then, _ = composed(world_model, replace(hanging, support="held"), Rotation.identity(), pose)
    assert then.model.nq < first.model.nq  # there is no string
    names = [then.model.joint(number).name for number in range(then.model.njnt)]
    assert names == [first.model.joint(number).name for number in range(then.model.njnt)]
    np.testing.assert_array_equal(then.start, pose[: then.model.nq])
