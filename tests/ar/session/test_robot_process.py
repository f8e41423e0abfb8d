"""The simulated robot: what was previewed is what it does, and it holds whenever nobody says that it may go on."""

import multiprocessing
import queue
import time
from functools import cache

import mujoco
import numpy as np
import pytest

from tests.support.live import WAIT
from tests.support.operator import PACKAGE, config
from tests.support.small_arm import small_spec
from trunkline.ar.hybrid.rollout_batch import joined, nominal
from trunkline.ar.hybrid.rollouts import CommandTrajectory
from trunkline.ar.hybrid.settings import HybridModelSettings
from trunkline.ar.hybrid.tip_uncertainty import BaseAlignment
from trunkline.ar.hybrid.uncertainty import GraspUncertainty
from trunkline.ar.preview.preview_twin import RobotModel, compose_twin
from trunkline.ar.preview.world_model import make_world
from trunkline.ar.session import simulated
from trunkline.ar.session.bodies import BodyPoses, drawn_bodies
from trunkline.ar.session.composition import SEARCH, subject_of
from trunkline.ar.session.log_reader import tip_path
from trunkline.ar.session.robot_process import (
    DEAD_MAN,
    FRESH,
    MODE,
    MODES,
    PERMIT,
    PERMITTED,
    POSE,
    STOPS,
    TELLS,
    RobotChannel,
    RobotProcess,
    next_report_time,
)  # fmt: skip
from trunkline.ar.session.settings import SessionConfig
from trunkline.ar.session.simulated import Loop, Simulation, TwinPlant, drive
from trunkline.ar.teleop.executor import PlanFollower
from trunkline.ar.teleop.following import Following
from trunkline.ar.teleop.plan import Plan
from trunkline.ar.teleop.trajectory import gentle, limits_of, point_to_point
from trunkline.pipeline.config import PROJECT, load_folder

LATE = 0.1  # s that a busy machine may take to schedule a process


@cache
def simulation():
    live, robot = (
        load_folder(SessionConfig, PROJECT / "conf/live"),
        load_folder(HybridModelSettings, PROJECT / "conf/hybrid").robot,
    )
    spec = small_spec()
    arm = spec.compile()
    straight = arm.tendon_length0[arm.actuator_trnid[:, 0]]
    robot_model = RobotModel(spec, GraspUncertainty(), robot, BaseAlignment(0.0, 0.0))
    twin = compose_twin(robot_model, make_world(()), None, SEARCH, straight, live.preview)
    limits, offset = limits_of(config().motors), config().mount_offset
    return Simulation(twin, SEARCH, straight, drawn_bodies(twin.model), limits, PACKAGE, offset)


@cache
def plan():
    """The first joint turns by 0.5 rad, then the first cable is pulled by 30 mm, as calmly as a hand-over."""
    s = simulation()
    here = np.append(s.joints, s.commands)
    turned, pulled = here + np.eye(10)[0] * 0.5, here + np.eye(10)[0] * 0.5 - np.eye(10)[7] * 0.03
    first, second = (gentle(a, b, s.limits, 0.002, 2.0) for a, b in ((here, turned), (turned, pulled)))
    rows = np.concatenate([first, second[1:], np.tile(pulled, (250, 1))])
    return Plan(0.002, rows[:, :7], rows[:, 7:], (("approach", 0), ("curl", len(first) - 1)), PACKAGE, "world")


def test_the_robot_does_what_the_preview_shows():
    s, plant = simulation(), TwinPlant(simulation())
    shown = joined(list(nominal(s.twin, CommandTrajectory(plan().step, plan().joints, plan().commands))))
    poses, tip = BodyPoses(s.twin.model, s.bodies), s.bodies.index("unit_08")
    time, away = 0.0, []
    for row, until in enumerate(shown.time + s.twin.model.opt.timestep):  # of the step that ends with a frame
        while time < until - plant.tick / 2:
            time += plant.tick
            plant.move(*plan().at(time), smooth=True)
        away.append(np.linalg.norm(plant.poses()[tip, :3] - poses.of(shown.qpos[0, row])[tip, :3]))
    travelled = np.linalg.norm(np.diff(shown.tip[0], axis=0), axis=1).sum()
    assert travelled > 0.1
    assert np.median(away) < 5e-4
    assert max(away) < 1e-3


@pytest.fixture(scope="module")
def robot():
    s = simulation()
    process = RobotProcess(simulated.run, (s,), len(s.commands), len(s.bodies), s.limits, s.package)
    until(lambda: process.ready, 2 * WAIT)
    yield process
    process.close()


def until(happens, seconds=WAIT, each=lambda: None):
    end = time.monotonic() + seconds
    while not happens():
        assert time.monotonic() < end, "it did not happen"
        each()
        time.sleep(0.005)


@pytest.mark.realtime
def test_a_robot_whose_session_ends_comes_to_rest_on_its_way_first():
    s = simulation()
    process = RobotProcess(simulated.run, (s,), len(s.commands), len(s.bodies), s.limits, s.package)
    until(lambda: process.ready, 2 * WAIT)
    way = back(process)
    until(lambda: np.abs(process.robot_state().joints - way.joints[0]).max() > 0.05, each=process.permit)
    process.close()
    numbers, _ = process.channel.hear()
    assert MODES[int(numbers[MODE])] == "idle"
    assert np.abs(way.joints - process.robot_state().joints).sum(axis=1).min() < 0.02


def back(robot):
    """A plan from where the robot is to where it began, and it runs."""
    s, now = simulation(), robot.robot_state()
    here, there = np.append(now.joints, now.commands), np.append(s.joints, s.commands)
    rows = point_to_point(
        here, there + np.eye(10)[0] * (0.0 if abs(here[0] - there[0]) > 0.2 else 0.5), s.limits, 0.002
    )
    plan = Plan(0.002, rows[:, :7], rows[:, 7:], (("approach", 0),), PACKAGE, "world")
    assert robot.start(plan, plan.digest()) == ""
    until(lambda: robot.state().mode == "running", 10.0, robot.permit)
    return plan


@pytest.mark.realtime
def test_it_runs_a_plan_to_its_end_while_it_is_permitted(robot):
    plan = back(robot)
    until(lambda: robot.state().mode == "done", 20.0, robot.permit)
    assert robot.state().digest == plan.digest()
    np.testing.assert_allclose(robot.robot_state().joints, plan.joints[-1], atol=1e-9)
    link = simulation().bodies.index("link_7")
    assert np.isfinite(robot.robot_state().bodies[link]).all()
    np.testing.assert_allclose(robot.robot_state().lengths, plan.commands[-1], atol=0.01)  # servos are springs
    np.testing.assert_allclose(robot.robot_state().measured, plan.joints[-1], atol=5e-3)
    assert not np.array_equal(robot.robot_state().measured, robot.robot_state().joints)


def test_a_log_is_about_the_simulated_robot():
    subject, s = subject_of(simulation()), simulation()
    assert (subject.bodies, subject.joints[0], subject.tendons) == (
        s.bodies,
        "joint_1",
        ("tendon_1", "tendon_2", "tendon_3"),
    )
    assert subject.tip[0] == "unit_08"
    assert "base" in subject.bodies
    model, data = s.twin.model, mujoco.MjData(s.twin.model)
    data.qpos[:] = s.twin.start
    mujoco.mj_kinematics(model, data)
    body = data.body(subject.tip[0])
    np.testing.assert_allclose(
        tip_path(np.append(body.xpos, body.xquat)[None], subject.tip[1])[0], data.site("tip").xpos
    )


@pytest.mark.realtime
def test_it_holds_when_it_is_stopped_and_goes_on_by_no_permit(robot):
    back(robot)
    pressed = time.monotonic()
    robot.stop()
    until(lambda: robot.robot_state().hold_time >= pressed)
    assert robot.robot_state().hold_time - pressed < LATE
    until(lambda: robot.state().mode == "idle", each=robot.permit)
    joints = robot.robot_state().joints
    for _ in range(40):
        robot.permit()
        time.sleep(0.01)
    np.testing.assert_array_equal(robot.robot_state().joints, joints)


@pytest.mark.realtime
def test_it_holds_when_nobody_says_that_it_may_go_on(robot):
    back(robot)
    silent = time.monotonic()
    until(lambda: robot.state().mode == "idle")
    assert robot.robot_state().hold_time - silent + 0.02 >= DEAD_MAN
    assert robot.robot_state().hold_time - silent < DEAD_MAN + LATE


def hearing(robot, axes, seconds, arrived=lambda: False):
    """What it follows, for so long, or until it has arrived."""
    begun = heard = time.monotonic()
    while (now := time.monotonic()) < begun + seconds and not arrived():
        robot.permit()
        if now >= heard:
            robot.hear(0.0, axes)
            heard = now + 0.1
        time.sleep(0.01)


@pytest.mark.realtime
def test_it_follows_what_it_hears_a_delay_later_and_brakes_when_it_is_stopped(robot):
    now = robot.robot_state()
    here = np.append(now.joints, now.commands)
    there = here + np.eye(10)[0] * 0.3

    def first():
        return robot.robot_state().joints[0]

    assert robot.follow(Following(0.6, 0.0, 0.05)) == ""
    until(lambda: robot.state().mode == "running", each=robot.permit)
    assert robot.follow(Following(0.6, 0.0, 0.05)).startswith("busy")
    hearing(robot, here, 0.25)
    hearing(robot, there, 0.2)
    np.testing.assert_allclose(robot.robot_state().joints, now.joints, atol=1e-3)  # its delay is longer
    hearing(robot, there, WAIT, lambda: abs(first() - there[0]) < 5e-4)
    np.testing.assert_allclose(robot.robot_state().joints, there[:7], atol=1e-3)
    assert robot.state().mode == "running"
    hearing(robot, here, WAIT, lambda: first() < there[0] - 0.02)
    pressed = time.monotonic()
    robot.stop()
    until(lambda: robot.state().mode == "idle", each=robot.permit)
    assert robot.robot_state().hold_time - pressed < LATE
    joints = robot.robot_state().joints
    assert here[0] < joints[0] < there[0]
    robot.hear(0.0, here)
    time.sleep(0.3)
    np.testing.assert_array_equal(robot.robot_state().joints, joints)


@pytest.mark.realtime
def test_a_process_that_ends_is_a_fault():
    s = simulation()
    process = RobotProcess(simulated.run, (s,), len(s.commands), len(s.bodies), s.limits, s.package)
    until(lambda: process.ready, 2 * WAIT)
    process._process.kill()
    until(lambda: process.state().mode == "fault")
    assert process.state().fault == "its process has ended"
    process.close()


class Still:
    """A plant without physics."""

    tick, fault = 0.002, ""

    def poses(self):
        return np.empty((0, POSE))

    def object(self):
        return np.full(POSE, np.nan)

    def measured(self):
        return np.zeros(7)

    def lengths(self):
        return np.zeros(3)


@pytest.mark.realtime
def test_where_its_server_is_gone_it_brakes_along_the_plan_before_it_ends():
    s, gone = simulation(), -1
    channel = RobotChannel(multiprocessing.get_context("spawn"), 3, 0)
    channel.plans = queue.Queue()
    robot = PlanFollower(s.joints, s.commands, s.limits, PACKAGE, lambda joints, commands, dt: None)
    loop = Loop(channel, robot, Still())
    drive(loop, gone)  # at rest, it ends at once
    channel.plans.put((1, plan().digest(), plan(), channel.requests[STOPS]))
    began = time.monotonic()
    channel.requests[PERMIT], channel.requests[PERMITTED] = began, 1
    loop.turn(time.monotonic())
    assert robot.state().mode == "running"
    drive(loop, gone)
    assert robot.state().mode == "idle"
    assert DEAD_MAN < loop.hold_time - began < DEAD_MAN + LATE
    assert np.abs(plan().joints - robot.joints).max(axis=1).min() < 1e-3
    assert DEAD_MAN < time.monotonic() - began < 2.0


def test_the_next_telling_is_the_first_from_when_it_is_wanted():
    for reported in (0.0, 0.9995, 1.0, 1.002, 3.0):
        after = next_report_time(1.0, reported) - FRESH
        assert 1.0 - 1e-9 <= after < 1.0 + TELLS
        assert (after - reported) / TELLS == pytest.approx(round((after - reported) / TELLS))
