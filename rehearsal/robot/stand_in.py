"""The stand-in for the physical robot: send commands, let time pass, look.

It knows nothing of the twin. Time passes in ticks of 1 ms, at which commands are taken, the rate of the Franka Control
Interface. Between them the engine makes steps of 1/6000 s, as the stranger on the bench does: a test halves them.
"""

from dataclasses import dataclass
from functools import lru_cache
from typing import Annotated

import numpy as np
from pydantic import Field
from scipy.spatial.transform import Rotation

from demo.plants.stranger import CALM, LONGEST_REST, REST_STEP, STILL, Stranger
from demo.plants.stranger_kernel import LinkState, come_to_rest, work_for
from rehearsal.robot.flange import Mount, Servos, carry
from rehearsal.robot.kernel import COLUMNS, OBJECT, TIP, TIP_AXES, look, run
from rehearsal.robot.rigid_object import rotation
from rehearsal.robot.scene import LabScene, String, make_rigid_object
from rehearsal.robot.sensors import Instruments, Readings, Sensors
from rehearsal.robot.shapes import nearest
from rehearsal.robot.touch_settings import Touch, make_touch
from trunkline.errors import InputError
from trunkline.frames import STANDARD_GRAVITY
from trunkline.kinematics.panda.kinematics import FLANGE, Q_MAX, Q_MIN
from trunkline.kinematics.panda.limits import ACCELERATION, VELOCITY
from trunkline.model.arm.mjcf import unit_name

TICK = 1e-3  # s
SUBSTEPS = 6  # of a tick
GRAVITY = np.array([0.0, 0.0, -STANDARD_GRAVITY])
FASTEST = 20.0  # m/s of the object; nothing here throws it so
MOST_PULL = 1.0  # m, beyond which a command is a mistake


@dataclass
class Panda:
    """How the Panda carries the arm and follows.

    mount_offset: m, from the flange to the arm along the flange's z. azimuth: rad, of tendon 1 about the arm's axis.
    bandwidth: Hz, at which a joint follows with -3 dB. damping_ratio: of its servo. dead_time: s, of the connection.
    """

    mount_offset: Annotated[float, Field(ge=0, le=1)]
    azimuth: Annotated[float, Field(ge=-7, le=7)]
    bandwidth: Annotated[float, Field(gt=0, le=1000)]
    damping_ratio: Annotated[float, Field(gt=0, le=10)]
    dead_time: Annotated[float, Field(ge=0, le=1)]


@dataclass
class StandIn:
    """All that is set of the stand-in beside its arm and its scene."""

    panda: Panda
    touch: Touch
    sensors: Sensors
    string: String


@dataclass
class TrueState:
    """What is so at this moment, for scoring alone; Panda's base frame.

    tip (3,), object (3,), grip (3,): m; of the object, its centre of mass and the middle of what the arm wraps of it.
    tip_axes (3, 3), quaternion (4,): of the tip and of the object. speed (3,): m/s, its own.
    arm_object (U, 3), arm_world (U, W, 3), object_world (W, 3): forces on the first of the two, N; W in the order of
    `LabScene.names`. hanging: whether the object's string is on the hook.
    """

    time: float
    joints: np.ndarray
    tip: np.ndarray
    tip_axes: np.ndarray
    object: np.ndarray
    grip: np.ndarray
    quaternion: np.ndarray
    speed: np.ndarray
    arm_object: np.ndarray
    arm_world: np.ndarray
    object_world: np.ndarray
    hanging: bool


class StandInRobot:
    """The stranger on the Panda in a scene, at rest at first, its tendons just straight or at `wound` (K,) m of pull.

    Args:
        ready: the Panda's joints at first, rad. Shape (7,).
        seed: of friction, of the alignment and of noise. The arm's own scatter is the stranger's.
        substeps: engine steps a tick.
    """

    def __init__(
        self, arm: Stranger, scene: LabScene, settings: StandIn, ready: np.ndarray, seed: int,
        wound: np.ndarray | None = None, substeps: int = SUBSTEPS,
    ) -> None:  # fmt: skip
        rough, measuring = np.random.default_rng(seed).spawn(2)
        self.scene, self.settings, self.arm, self.substeps = scene, settings, arm, substeps
        self.joints = np.zeros((3, 7))
        self.joints[0] = self._checked(ready, 7, "ready")
        self.servos, self.mount = servos_of(settings.panda), _mount(settings.panda, arm)
        self.object, self.motion = make_rigid_object(scene.object, scene.hook, settings.string)
        self.discs, self.world, self.contacts = make_touch(
            arm.chain, arm.links, scene, self.object, settings.touch, rough
        )
        self.instruments = Instruments(settings.sensors, measuring)
        pulled = np.zeros(arm.tendons) if wound is None else np.array(wound, dtype=float)
        self.state = self._rest(pulled)
        self._refuse_touch()
        self.ticks, self.owed = 0, 0.0
        self.sent = [(0, self.joints[0].copy())]  # tick of arrival, command
        self.pulled = [(0, pulled)]
        self.rows = [self._row()]
        self.history = 1 + round(max(settings.sensors.pose_delay, settings.sensors.joint_delay) / TICK)

    @property
    def time(self) -> float:
        """s since the beginning."""
        return self.ticks * TICK

    def send(self, joint_positions: np.ndarray, tendon_commands: np.ndarray) -> None:
        """Command the Panda's joints (7,), rad, and the motors (K,), m of pull; they hold until the next command.

        Raises:
            InputError: a number is missing or not finite, a joint's is beyond its range, or a pull is no pull. Then
                nothing is sent, and the robot holds what it had.
        """
        joints = self._checked(joint_positions, 7, "joint_positions")
        pulls = np.array(tendon_commands, dtype=float)
        if pulls.shape != (self.arm.tendons,) or not (np.abs(pulls) <= MOST_PULL).all():
            expected = f"{self.arm.tendons} within ±{MOST_PULL} m"
            raise InputError(f"tendon_commands: found {np.array2string(pulls)}, expected {expected}")
        panda, motors = self.settings.panda.dead_time, self.arm.settings.motors.dead_time
        self.sent.append((self.ticks + round(panda / TICK), joints))
        self.pulled.append((self.ticks + round((panda + motors) / TICK), pulls))

    def advance(self, dt: float) -> None:
        """Let dt s pass; what is less than a tick waits for the next call."""
        if not 0 <= dt <= 3600:
            raise InputError(f"dt: found {dt} s, expected 0 to 3600 s")
        self.owed += dt
        count = int(self.owed / TICK + 1e-6)
        if count == 0:
            return
        self.owed -= count * TICK
        rows, arm = np.empty((count, COLUMNS)), self.arm
        pulls, targets = _arriving(self.pulled, self.ticks, count), _arriving(self.sent, self.ticks, count)
        run(
            count, self.substeps, TICK, arm.links, self.state, arm.straight, pulls, GRAVITY, self.servos, self.mount,
            self.joints, targets, self.discs, self.world, self.object, self.motion, self.contacts, rows,
        )  # fmt: skip
        if not (np.isfinite(rows[-1]).all() and np.linalg.norm(self.motion.speed) < FASTEST):
            raise FloatingPointError("the stand-in's engine diverged: its steps are too long")
        self.ticks += count
        self.rows = [*self.rows, *rows][-self.history :]

    def readings(self) -> Readings:
        """What the client is told now. Every call draws noise."""
        s = self.settings.sensors
        joints, poses = (min(round(delay / TICK), len(self.rows) - 1) for delay in (s.joint_delay, s.pose_delay))
        return self.instruments.read(
            self.rows[-1 - joints], self.rows[-1 - poses], self.time - joints * TICK, self.time - poses * TICK
        )

    def truth(self) -> TrueState:
        """What is so."""
        row, c = self.rows[-1], self.contacts
        object, quaternion = row[OBJECT][:3].copy(), row[OBJECT][3:].copy()
        grip = object + np.array(rotation(quaternion)) @ self.scene.object.grip
        return TrueState(
            time=self.time, joints=self.joints[0].copy(), tip=row[TIP].copy(),
            tip_axes=row[TIP_AXES].reshape(3, 3).copy(), object=object, grip=grip, quaternion=quaternion,
            speed=self.motion.speed.copy(),
            arm_object=c.arm_object.copy(), arm_world=c.arm_world.copy(), object_world=c.object_world.copy(),
            hanging=bool(self.motion.hanging[0]),
        )  # fmt: skip

    def base(self) -> tuple[np.ndarray, np.ndarray]:
        """Axes (3, 3), in columns, and origin (3,), m, of the arm's frame now."""
        turn, place, *_ = carry(self.mount, self.joints)
        return np.array(turn), np.array(place)

    def links(self) -> tuple[np.ndarray, np.ndarray]:
        """Centres (U, 3), m, and axes (U, 3) of the units' discs now: for pictures."""
        work = work_for(self.arm.links, self.arm.tendons)
        look(self.arm.links, self.state, work, self.mount, self.joints, self.motion, np.empty(COLUMNS))
        turn, place = self.base()
        axes = work.frames[self.discs.link][:, :, 2]
        return (work.joints[self.discs.link] + self.discs.height[:, None] * axes) @ turn.T + place, axes @ turn.T

    def _row(self) -> np.ndarray:
        row = np.empty(COLUMNS)
        work = work_for(self.arm.links, self.arm.tendons)
        look(self.arm.links, self.state, work, self.mount, self.joints, self.motion, row)
        return row

    def _rest(self, wound: np.ndarray):
        """The arm's state long after it was left alone, away from all contacts."""
        turn, _ = self.base()
        rest = _rest(self.arm, tuple(map(float, GRAVITY @ turn)), tuple(map(float, wound)))
        return LinkState(*(part.copy() for part in rest))

    def _refuse_touch(self) -> None:
        """The arm's rest was found without contacts, so it must begin free of them."""
        world = self.world
        shapes = zip(self.scene.names(), world.kind, world.half, world.edge, world.place, strict=True)
        solid = [(name, kind, half, edge, place, np.eye(3)) for name, kind, half, edge, place in shapes]
        object, pose = self.object, np.array(rotation(self.motion.quaternion))
        for kind, half, edge, shift, turn in zip(
            object.kind, object.half, object.edge, object.shift, object.turn, strict=True
        ):
            solid.append(("the object", kind, half, edge, self.motion.place + pose @ shift, pose @ turn))
        for unit, (centre, axis) in enumerate(zip(*self.links(), strict=True)):
            radius, rim = self.discs.radius[unit], self.discs.edge[unit]
            for name, kind, half, edge, place, turn in solid:
                inside = tuple((centre - place) @ turn)
                _, away, _ = nearest(kind, half, edge, inside, tuple(axis @ turn), radius, (0.0, 0.0, 0.0))
                if away < rim:
                    fault = f"{unit_name(unit)} {1000 * (rim - away):.0f} mm inside {name}"
                    raise InputError(f"ready: found {fault}, expected an arm that touches nothing at the start")

    @staticmethod
    def _checked(joints: np.ndarray, count: int, name: str) -> np.ndarray:
        angles = np.array(joints, dtype=float)
        if angles.shape != (count,):
            raise InputError(f"{name}: found shape {angles.shape}, expected ({count},)")
        for j, (angle, low, high) in enumerate(zip(angles, Q_MIN, Q_MAX, strict=True), start=1):
            if not low <= angle <= high:
                raise InputError(f"{name}: joint_{j}: found {angle} rad, expected {low} to {high} rad")
        return angles


@lru_cache(maxsize=16)  # runs of a rehearsal begin alike, and to come to rest is a fifth of what they cost
def _rest(arm: Stranger, gravity: tuple[float, ...], wound: tuple[float, ...]) -> LinkState:
    """Of an arm under `gravity`, m/s² in its base, whose motors are at `wound`, m."""
    pulled, steps = np.array(wound), round(LONGEST_REST / REST_STEP)
    state = straight_state(arm, pulled)
    come_to_rest(arm.links, state, np.array(gravity), 0.0, pulled, arm.straight, REST_STEP, steps, CALM, STILL)
    state.v[:] = 0.0
    return state


def straight_state(arm: Stranger, wound: np.ndarray) -> LinkState:
    """Straight, nothing bears, the motors at `wound` (K,) m."""
    joints, units = len(arm.links.lengths), len(arm.links.hole_link)
    return LinkState(
        q=np.zeros((joints, 2)), v=np.zeros((joints, 2)), branches=np.zeros((len(arm.links.branch_time), joints, 2)),
        sliders=np.zeros((len(arm.links.slider_yield), joints, 2)), slips=np.zeros((arm.tendons, units + 1)),
        motors=wound.copy(), winches=wound.copy(),
    )  # fmt: skip


def _arriving(queue: list, first: int, count: int) -> np.ndarray:
    """The command that holds in each of `count` ticks from `first` on; what has been passed leaves the queue."""
    rows = np.empty((count, len(queue[0][1])))
    for t in range(count):
        while len(queue) > 1 and queue[1][0] <= first + t:
            queue.pop(0)
        rows[t] = queue[0][1]
    return rows


def servos_of(panda: Panda) -> Servos:
    """|G| = 1/√2 of G = ω² / (s² + 2 ζ ω s + ω²) at the bandwidth: ω_b = ω √(1 - 2 ζ² + √((1 - 2 ζ²)² + 1))."""
    inner = 1 - 2 * panda.damping_ratio**2
    frequency = 2 * np.pi * panda.bandwidth / np.sqrt(inner + np.sqrt(inner**2 + 1))
    return Servos(float(frequency), panda.damping_ratio, Q_MIN, Q_MAX, VELOCITY, ACCELERATION)


def _mount(panda: Panda, arm: Stranger) -> Mount:
    """The arm's z points into the flange; it leans on its mount as on the bench."""
    turn = Rotation.from_euler("x", np.pi) * Rotation.from_euler("z", panda.azimuth) * arm.mount
    return Mount(np.ascontiguousarray(turn.as_matrix()), np.array([0.0, 0.0, FLANGE + panda.mount_offset]))
