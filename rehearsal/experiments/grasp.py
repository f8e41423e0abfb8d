"""Grasp what hangs, or a basket that stands: success is that it is lifted and held, without slip or drop.

For some seconds it must touch nothing but the arm.
"""

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np
from scipy.spatial.transform import Rotation

from rehearsal import settings
from rehearsal.experiments.bench import FLOOR, FLOOR_OBSTACLE, START, SessionFrame, SharedRun, Staged, executed
from rehearsal.experiments.result import Result
from rehearsal.operator.scripts import Ending, Operator
from rehearsal.robot.scene import LabScene, SceneObject
from rehearsal.robot.stand_in import StandInRobot
from rehearsal.session import RehearsedSession
from trunkline.ar.hybrid.grasps import object_in_base
from trunkline.ar.hybrid.worlds import SupportSurface
from trunkline.ar.preview.world_model import make_world
from trunkline.ar.teleop.messages import Obstacle, WorldObject
from trunkline.ar.teleop.rigid_ik import RigidIK
from trunkline.ar.teleop.vectors import DOWN
from trunkline.errors import InputError
from trunkline.frames import wxyz_from_rotation

NAME, TABLE, STAND = "the object", "the table", "the stand"


@dataclass
class Offered:
    """An object that hangs or stands, what it `stands` on, and the horizontal direction from the arm to it that suits
    it, (3,)."""

    object: SceneObject
    towards: np.ndarray
    stands: SupportSurface | None

    @property
    def name(self) -> str:
        return f"{'standing' if self.stands else 'hanging'} {self.object.shape}"

    @property
    def way(self) -> str:
        """By which it is grasped: `trunkline.ar.teleop.object_shapes.way_of_grasping`."""
        return "basket" if self.object.shape == "basket" else "hanging"


def offered(
    bench: SharedRun, s: settings.Grasped, rng: np.random.Generator, shapes: Sequence[settings.Shape] = ()
) -> Offered:
    """A random object at a random place, no heavier than what may be grasped at its width. What is gripped of it is at
    that place: a basket's bar. `shapes`: of which it is one, all of the settings by default.

    Raises:
        InputError: the settings have none of these shapes.
    """
    kinds: list[settings.Shape] = [shape for shape in s.shapes if not shapes or shape in shapes]
    if not kinds:
        raise InputError(f"shapes: found {', '.join(s.shapes)}, expected {' or '.join(shapes)} as well")
    shape = kinds[rng.integers(len(kinds))]
    of, stands = s.shapes[shape], shape == "basket"
    diameter = float(rng.uniform(of.thin, of.wide))
    heaviest = min(of.heavy, bench.config.handling.heaviest(shape, diameter))
    radius, azimuth = np.sqrt(rng.uniform(s.near**2, s.far**2)), np.radians(rng.uniform(-s.side_deg, s.side_deg))
    place = np.array([radius * np.cos(azimuth), radius * np.sin(azimuth), rng.uniform(of.low, of.high)])
    yaw = azimuth + (np.radians(rng.uniform(-s.yaw_deg, s.yaw_deg)) if shape != "sphere" else 0.0)
    towards = np.array([np.cos(yaw), np.sin(yaw), 0.0])
    level = Rotation.from_euler("x", 0.0 if stands else np.pi / 2)  # a cylinder's axis, as a basket's bar already is
    turn = wxyz_from_rotation(Rotation.from_euler("z", yaw) * level).tolist()  # across `towards`
    mass = float(rng.uniform(of.light, heaviest))
    object = SceneObject(shape, diameter, of.height, mass, place.tolist(), turn, hanging=not stands)
    if not stands:
        return Offered(object, towards, None)
    object.position = (place - object.grip).tolist()
    top = [*object.position[:2], object.position[2] - object.half_height]
    return Offered(object, towards, SupportSurface(top, list(s.stand), "wood"))


def session_of(
    bench: SharedRun,
    s: settings.Grasped,
    placed: Offered,
    operator: Operator,
    seed: int,
    table: SupportSurface | None = None,
) -> RehearsedSession:
    """The stand-in at its ready pose, the object on its string or its stand, the client's world as it is seen at
    first."""
    x, y, z = bench.settings.mount_ready
    ready, object = RigidIK(bench.config.mount_offset).solve(START, (x, y, z), DOWN, 0.0), placed.object
    hook = [object.position[0], object.position[1], object.position[2] + object.diameter / 2 + s.string]
    surfaces = {name: board for name, board in ((TABLE, table), (STAND, placed.stands)) if board is not None}
    scene = LabScene(FLOOR, object, surfaces, None if placed.stands else hook)
    robot = StandInRobot(bench.arm, scene, bench.stand_in, ready, seed)
    obstacles = (FLOOR_OBSTACLE, *(obstacle_of(name, board) for name, board in surfaces.items()))
    readings = robot.readings()
    a, b, c = (float(value) for value in readings.object)
    d, e, f, g = (float(value) for value in readings.object_quaternion)
    object_seen = WorldObject(
        NAME, object.shape, object.diameter, object.height, object.mass, (a, b, c), (d, e, f, g),
        "standing" if placed.stands else "hanging", object.basket,
    )  # fmt: skip
    return RehearsedSession(
        bench.package, bench.config, robot, (operator.left, operator.right), make_world(obstacles, (object_seen,)),
        lambda now: robot.truth().grip, bench.foresight, bench.judged,
    )  # fmt: skip


def obstacle_of(name: str, board: SupportSurface) -> Obstacle:
    """As the client is told of it."""
    half, top = np.array(board.size) / 2, np.array(board.top)
    (a, b, c), (d, e, f) = ((float(v) for v in corner) for corner in (top - half * [1, 1, 2], top + half * [1, 1, 0]))
    return Obstacle(name, (a, b, c), (d, e, f))


def beside(bench: SharedRun, placed: Offered) -> np.ndarray:
    """Where the operator means the mount to be, less what is gripped, (3,), m: the grasp frame."""
    frame = bench.config.basket.grasp if placed.way == "basket" else bench.config.hanging.grasp
    centre = object_in_base(bench.package.geometry, placed.object.diameter, frame, "dorsal")
    return -centre[0] * placed.towards - [0.0, 0.0, centre[2]]


def grasp(bench: SharedRun, seed: int) -> Staged:
    rng, s = np.random.default_rng([seed, 2]), settings.grasped()
    placed = offered(bench, s, rng)
    operator = bench.operator(rng)
    session = session_of(bench, s, placed, operator, seed)

    def judge(result: Result, ending: Ending, frames: list[SessionFrame], _) -> str:
        cause = failure(ending, frames, s)
        tell(result, ending, session, not cause)
        return cause

    script = operator.grasp(beside(bench, placed), s.accept, s.hold)
    return Staged("grasp", seed, session, script, judge, placed.name)


def tell(result: Result, ending: Ending, session: RehearsedSession, succeeded: bool) -> None:
    """What the preview had said, and how far off it was."""
    result.plans, result.probability = ending.plans, ending.probability
    result.agreed = agreed(ending.probability, succeeded)
    if np.isfinite(ending.probability) and session.prediction is not None:
        nominal = session.prediction.preview.nominal
        apart = tip_difference(session.tips, session.prediction.begins + nominal.time, nominal.tip[0])
        result.path_pct = 100 * apart / session.package.geometry.length


def agreed(probability: float, succeeded: bool) -> float:
    """1 where a preview gave at least a half to what succeeded or less to what did not, else 0; NaN if it gave none."""
    return float((probability >= 0.5) == succeeded) if np.isfinite(probability) else float("nan")


def tip_difference(tips: list[tuple[float, np.ndarray]], times: np.ndarray, previewed: np.ndarray) -> float:
    """Median distance between the robot's tip and the preview's at the same time, m; NaN if there is no such time.

    Args:
        tips: s since the plan began, and the robot's tip (3,), m. times, previewed: of the preview's tip,
            (F,), s, and (F, 3), m.
    """
    during = [(time, tip) for time, tip in tips if times[0] <= time <= times[-1]]
    if not during:
        return float("nan")
    took, there = (np.array(column) for column in zip(*during, strict=True))
    foreseen = np.column_stack([np.interp(took, times, column) for column in previewed.T])
    return float(np.median(np.linalg.norm(there - foreseen, axis=1)))


def failure(ending: Ending, frames: list[SessionFrame], s: settings.Grasped) -> str:
    """Why the grasp failed, "" if it did not. The first of these that is so:

    1. The operator gave up, or the robot did not do what was confirmed: why, else why no plan was to be had.
    2. No plan was run to its end: stopped.
    3. At that end the object hangs, or is not lifted by `lifted` m. The arm never touched it: aim; else: slip.
    4. From then until the last frame it touches something but the arm, be it for one frame: slip.
    5. In the last frame it is `slip` m or more from where it was in the arm: slip.
    """
    if not ending.done:
        named = ending.why.startswith(("aim", "out of reach", "stopped", "slip"))
        return ending.why if named else f"plan refused: {ending.why}"
    done = executed(frames)
    if done is None:
        return "stopped: no plan was run to its end"
    lifted = done.object[2] - frames[0].object[2]
    if done.truth.hanging or not lifted >= s.lifted:
        if not any(frame.truth.arm_object.any() for frame in frames):
            return "aim: the arm never touched it"
        return f"slip: it was lifted by {1e3 * lifted:.0f} mm" + (", and hangs" if done.truth.hanging else "")
    if any(frame.truth.object_world.any() for frame in frames if frame.now >= done.now):
        return "slip: it touched more than the arm as it was held"
    moved = in_arm(done, frames[-1])
    return "" if moved < s.slip else f"slip: it moved by {1e3 * moved:.0f} mm in the arm as it was held"


def in_arm(before: SessionFrame, after: SessionFrame) -> float:
    """m by which the object has moved against the units that held it before; infinite where none did."""
    holding = np.linalg.norm(before.truth.arm_object, axis=1) > 0
    if not holding.any():
        return float("inf")
    then, now = (frame.object - frame.units[holding].mean(axis=0) for frame in (before, after))
    return float(np.linalg.norm(now - then))
