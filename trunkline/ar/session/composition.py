"""A session made of a package: core, processes, scene. Everything comes out of the package's file."""

from contextlib import ExitStack
from dataclasses import dataclass, replace
from pathlib import Path

import mujoco
import numpy as np

from trunkline.ar.preview.package import Package, read_package
from trunkline.ar.preview.preview_twin import compose_twin, robot_model_of
from trunkline.ar.preview.world_model import make_world
from trunkline.ar.session import preview_process, simulated
from trunkline.ar.session.arm_cameras import (
    MOUNT,
    ArmCameras,
    ArmCameraSettings,
    SimulatedArmCameras,
    markers_of,
    real_cameras,
)
from trunkline.ar.session.bodies import drawn_bodies
from trunkline.ar.session.camera_alignment import CameraAlignment
from trunkline.ar.session.certificate import certificate_of
from trunkline.ar.session.controller import SessionController
from trunkline.ar.session.hanging import HangingWatch
from trunkline.ar.session.hardware import Hardware
from trunkline.ar.session.log_format import SIMULATED, Subject
from trunkline.ar.session.log_writer import LogWriterProcess, new_path
from trunkline.ar.session.preview_process import PreviewProcess
from trunkline.ar.session.robot_process import RobotProcess
from trunkline.ar.session.scene import Shells, scene
from trunkline.ar.session.settings import SessionConfig
from trunkline.ar.session.simulated import Simulation
from trunkline.ar.teleop.base_frames import base_frames
from trunkline.ar.teleop.config import TeleoperationConfig as Teleop
from trunkline.ar.teleop.core import Teleoperation
from trunkline.ar.teleop.messages import Obstacle
from trunkline.ar.teleop.rigid_ik import RigidIK
from trunkline.ar.teleop.trajectory import limits_of
from trunkline.ar.teleop.vectors import DOWN
from trunkline.kinematics.panda.maker_model import JOINTS
from trunkline.model.arm_model import ArmModel
from trunkline.unity import unpacked
from trunkline.version import __version__

SEARCH = np.array([0.0, -0.4, 0.0, -2.2, 0.0, 1.8, 0.785])  # rad, where the search for the ready pose begins
BELOW, AROUND = 1.0, 3.0  # m, of the floor as an obstacle


@dataclass(frozen=True)
class SessionParts:
    """What a server serves, and the processes behind it. certificate: the twin's page, empty without one."""

    controller: SessionController
    package: str
    scene: dict
    shells: Shells | None
    robot: RobotProcess
    previewer: PreviewProcess
    log_writer: LogWriterProcess
    certificate: bytes
    cameras: ArmCameras | None = None

    def close(self) -> None:
        self.robot.close()  # first: it may be moving
        if self.cameras is not None:
            self.cameras.close()
        self.previewer.close()
        self.log_writer.close()


def make(
    path: Path,
    teleop: Teleop,
    config: SessionConfig,
    hardware: Hardware | None = None,
    cameras: str = "",
) -> SessionParts:
    """Of the package at `path`, the robot simulated, or as `hardware` has it. cameras: of CAMERAS, "" for none. Where
    it raises, no process is left.

    Raises:
        InputError: there is no package, or it cannot be previewed with, or cameras do not answer.
    """
    package = read_package(path)
    joints = RigidIK(teleop.mount_offset).solve(SEARCH, config.ready, DOWN, 0.0)
    simulation, maps = simulation_of(package, teleop, config, joints), unpacked.maps_of(package.files)
    world = make_world(obstacles(config), () if config.object is None else (config.object,))
    setup = path.resolve(), teleop, config.preview, simulation.bodies, world
    with ExitStack() as begun:  # what closes where something fails
        previewer = PreviewProcess(preview_process.run, setup)  # first: it takes longest until it is ready
        begun.callback(previewer.close)
        drawing = scene(simulation.twin.model, simulation.bodies, maps, package.geometry.length)
        subject = subject_of(simulation, hardware)
        arm_cameras = cameras_of(cameras, simulation, subject, config.cameras)
        if arm_cameras is not None:
            begun.callback(arm_cameras.close)
            subject = measured_subject(subject, arm_cameras, simulation)
        log_writer = LogWriterProcess(new_path(Path(config.journal.folder)), subject, config.journal.period)
        begun.callback(log_writer.close)
        robot = robot_of(simulation, hardware)
        begun.callback(robot.close)
        core = Teleoperation(teleop.core, package.reach, package.digest, teleop.mount_offset)
        lift = teleop.handling.least_lift
        alignment = hanging = None
        if arm_cameras is not None and arm_cameras.sees_mount:
            offset, limits = teleop.mount_offset, config.correction
            alignment = CameraAlignment(arm_cameras, offset, limits.misplaced)
            hanging = HangingWatch(arm_cameras, package.straight, hanging_tip(simulation), offset, limits.astray)
        controller = SessionController(
            core, robot, previewer, world, lift, log_writer, package.period, arm_cameras, config.correction, alignment,
            hanging,
        )
        controller.begin(config.rate, __version__)
        log_writer.await_begun()
        certificate = certificate_of(path, package.files)
        parts = SessionParts(
            controller, package.digest, drawing, Shells.of(maps), robot, previewer, log_writer, certificate, arm_cameras
        )
        begun.pop_all()
    return parts


def cameras_of(kind: str, simulation: Simulation, subject: Subject, settings: ArmCameraSettings) -> ArmCameras | None:
    """They see the arm from now on; None where `kind` is "".

    Raises:
        InputError: they do not answer.
    """
    if not kind:
        return None
    simulated_arm = kind == "simulated"
    cameras = SimulatedArmCameras(simulation, subject.tip, settings) if simulated_arm else real_cameras(kind, settings)
    try:
        cameras.connect()
    except BaseException:
        cameras.close()
        raise
    return cameras


def measured_subject(subject: Subject, cameras: ArmCameras, simulation: Simulation) -> Subject:
    """The subject of a session in which `cameras` see the arm."""
    mount = cameras.names[0] if cameras.sees_mount else ""
    names = [MOUNT if name == mount else name for name in cameras.names]
    return replace(
        subject, measured=cameras.names, markers=markers_of(simulation.twin.model, names), mount=mount
    )  # fmt: skip


def hanging_tip(simulation: Simulation) -> np.ndarray:
    """Where the tip of the twin hangs as all begins, in the arm's base frame, m (3,)."""
    data = mujoco.MjData(simulation.twin.model)
    if simulation.twin.start is not None:
        data.qpos[:] = simulation.twin.start
    mujoco.mj_kinematics(simulation.twin.model, data)
    place, turn = base_frames(simulation.joints, simulation.mount_offset)
    return (data.site("tip").xpos - place) @ turn


def subject_of(simulation: Simulation, hardware: Hardware | None = None) -> Subject:
    """Whom a log is about: the simulated robot, or the real one, of which a twin is drawn."""
    model = simulation.twin.model
    tendons = tuple(model.tendon(number).name for number in model.actuator_trnid[ArmModel(model).actuators, 0])
    site = model.site("tip")
    x, y, z = (float(value) for value in site.pos)
    tip = model.body(site.bodyid[0]).name, (x, y, z)
    words = SIMULATED if hardware is None else hardware.words()
    return Subject(simulation.bodies, tuple(JOINTS), tendons, simulation.commands, tip, words)


def robot_of(simulation: Simulation, hardware: Hardware | None) -> RobotProcess:
    """The simulated robot's process, or the real one's."""
    if hardware is not None:
        from trunkline.ar.session.hardware_process import RealRobot  # with what hardware needs installed

        return RealRobot(hardware, simulation)
    tendons, bodies = len(simulation.commands), len(simulation.bodies)
    return RobotProcess(simulated.run, (simulation,), tendons, bodies, simulation.limits, simulation.package)


def simulation_of(package: Package, teleop: Teleop, config: SessionConfig, joints: np.ndarray) -> Simulation:
    """The simulated robot, at rest at `joints` (7,), rad, with its arm straight."""
    robot_model = robot_model_of(config.preview, package.files)
    world = make_world(obstacles(config))
    twin = compose_twin(robot_model, world, config.object, joints, package.straight, config.preview)
    limits = limits_of(teleop.motors, package.rate_limit, len(package.straight))
    bodies, offset = drawn_bodies(twin.model), teleop.mount_offset
    return Simulation(twin, joints, package.straight, bodies, limits, package.digest, offset)


def obstacles(config: SessionConfig) -> tuple[Obstacle, ...]:
    """What stands around the robot: the floor, and the other obstacles."""
    floor = Obstacle("the floor", (-AROUND, -AROUND, config.floor - BELOW), (AROUND, AROUND, config.floor))
    return floor, *config.obstacles
