"""By how far the twin's tip may be elsewhere at rest: friction counts once, in the futures or beside them."""

from dataclasses import replace

import mujoco
import numpy as np
import pytest

from tests.ar.hybrid.conftest import hybrid_settings
from tests.support.operator import READY_JOINTS
from tests.support.residual import everywhere
from tests.support.small_arm import small_spec
from trunkline.ar.hybrid.rollout_batch import preview
from trunkline.ar.hybrid.rollouts import CommandTrajectory
from trunkline.ar.hybrid.tip_uncertainty import BaseAlignment, TipShift, TipUncertainty, TipUnknown
from trunkline.ar.hybrid.uncertainty import GraspUncertainty
from trunkline.ar.preview.preview_twin import RobotModel, compose_twin
from trunkline.ar.session.settings import SessionConfig
from trunkline.ar.teleop.messages import World
from trunkline.kinematics.panda.kinematics import mount_pose
from trunkline.kinematics.panda.mounts import PandaRobot
from trunkline.model.arm.guide_holes import GuideHoles, add_holes
from trunkline.model.arm_model import ArmModel
from trunkline.pipeline.config import PROJECT, load_folder
from trunkline.twin.discrepancy import Discrepancy, Lacking

SETTINGS = replace(load_folder(SessionConfig, PROJECT / "conf/live").preview, step=0.002)
PULL, STEP = np.array([0.04, 0.0, 0.0]), 0.01
LACKING = Lacking("", Discrepancy(np.zeros((1, 3)), 16), 180.0, 180.0, 1.0, 1.0)  # nothing, of any pose
CASES = {"rubbing": GuideHoles(0.12, 2), "no friction on the holes": GuideHoles(0.0, 2), "no holes": GuideHoles()}


def robot_model(holes: GuideHoles) -> RobotModel:
    """Of a small arm whose cables have some friction of their own too."""
    arm = small_spec()
    add_holes(arm, holes)
    robot = hybrid_settings(robot="panda").robot
    assert isinstance(robot, PandaRobot)
    return RobotModel(arm, GraspUncertainty(), robot, BaseAlignment(0.0, 0.0), LACKING)


def pull(arm: mujoco.MjModel) -> CommandTrajectory:
    """Drawn in within half a second, and held."""
    share = np.clip(np.arange(100) / 50, 0, 1)[:, None]
    straight = arm.tendon_length0[arm.actuator_trnid[:, 0]]
    return CommandTrajectory(STEP, np.tile(READY_JOINTS, (100, 1)), straight - share * PULL)


@pytest.mark.parametrize("holes", CASES.values(), ids=CASES)
def test_the_friction_band_is_left_out_where_the_model_that_is_stepped_rubs(holes):
    """With 0 beside the band, the radius is that of the futures alone, else wider by nine tenths of half the band."""
    made = robot_model(holes)
    trajectory = pull(made.arm.copy().compile())
    twin = compose_twin(made, World("w"), None, trajectory.joints[0], trajectory.commands[0], SETTINGS)
    tip = made.tip_uncertainty(trajectory, None)
    assert isinstance(tip, TipUncertainty)
    half = float(np.linalg.norm(tip.friction))
    assert (half == 0) == ArmModel(twin.model).rubs == (holes == CASES["rubbing"])
    assert half == 0 or half > 1e-3
    radius = preview(twin, trajectory, made.uncertainty, None, 2, tip=tip).stated.radii[-1]
    assert radius == pytest.approx(0.9 * half, rel=0.1, abs=1e-6)


def test_poses_of_the_arm_move_the_tip_that_is_stated_and_not_its_radius():
    """By a map in the arm's base frame, whose y and z are opposite to the flange's. Where it tells all, the friction
    band and what the twin lacks are in its poses."""
    knows = replace(LACKING, residual_map=everywhere([0.0, 0.0, 0.001]), left=Discrepancy(np.full((1, 3), 1e-9), 16))
    dry = replace(robot_model(CASES["no friction on the holes"]), lacking=knows)
    uncertain = dry.tip_uncertainty(pull(dry.arm.copy().compile()), None)
    assert isinstance(uncertain, TipUncertainty)
    assert uncertain.unknown < 1e-6
    elsewhere = replace(dry, lacking=replace(knows, residual_map=replace(
        knows.residual_map, numbers=np.array([1.0, 1e-6, 1e-3, 1e-3, 1e3])
    )))  # fmt: skip
    without, session = (elsewhere.tip_uncertainty(pull(dry.arm.copy().compile()), None, learnt)
                        for learnt in (None, knows.residual_map))  # fmt: skip
    assert session.unknown == without.unknown > 0.5  # a few rests of one session make none surer
    drawn = uncertain.offsets(np.zeros(3), np.array([0.0, 0.0, -0.3]), 50, np.random.default_rng(0))
    assert np.linalg.norm(drawn, axis=1).max() < 1e-4 < np.linalg.norm(uncertain.friction)
    made = robot_model(CASES["rubbing"])
    trajectory = pull(made.arm.copy().compile())
    twin = compose_twin(made, World("w"), None, trajectory.joints[0], trajectory.commands[0], SETTINGS)
    shift = np.array([0.004, 0.002, -0.001])
    knows = replace(made, lacking=replace(LACKING, residual_map=everywhere(list(shift))))
    beyond = replace(knows, lacking=replace(knows.lacking, pull=0.0))  # plans take the shift there as well
    stated = []
    for robot, session in ((made, None), (knows, None), (beyond, None), (made, everywhere(list(shift)))):
        tip = robot.tip_uncertainty(trajectory, None, session)
        assert isinstance(tip, TipUnknown if robot is beyond else TipUncertainty)
        foreseen = preview(twin, trajectory, made.uncertainty, None, 2, tip=tip)
        stated.append(foreseen.stated)
        np.testing.assert_allclose(foreseen.shown[-1] - foreseen.nominal.tip[0, -1],
                                   tip.shift.shifts[-1] if tip.shift else np.zeros(3))  # fmt: skip
    flange = mount_pose(np.array([READY_JOINTS]), made.robot.mount_offset)[1][0]
    expected = flange @ (shift * [1, -1, -1])
    np.testing.assert_allclose(stated[1].tips - stated[0].tips, np.tile(expected, (len(stated[0].tips), 1)), atol=1e-6)
    np.testing.assert_array_equal(stated[1].radii, stated[0].radii)
    np.testing.assert_array_equal(stated[2].tips, stated[1].tips)
    np.testing.assert_array_equal(stated[3].tips, stated[1].tips)
    np.testing.assert_array_equal(stated[3].radii, stated[0].radii)  # a few rests of one session make none surer
    assert len(stated[2].radii) == 0


def test_a_shift_is_taken_where_the_plan_is():
    shift = TipShift(np.array([0.0, 1.0]), np.array([[0.0, 0.0, 0.0], [0.002, 0.0, -0.004]]))
    np.testing.assert_allclose(shift.at(np.array([0.5, 2.0])), [[0.001, 0, -0.002], [0.002, 0, -0.004]])
