"""Grasp what hangs, or a basket that stands: success is that it is lifted and held, without slip or drop.

For some seconds it must touch nothing but the arm.
"""

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np
from scipy.spatial.transform import Rotation

from rehearsal import settings
from rehearsal.experiments.bench import FLOOR, FLOOR_BOX, START, Bench, Seen, Staged
from rehearsal.experiments.result import Result
from rehearsal.operator.scripts import Ending, Operator
from rehearsal.robot.scene import Object, Scene, Surface
from rehearsal.robot.stand_in import StandInRobot
from rehearsal.session import Session
from trunkline.errors import InputError
from trunkline.foresight.believing import make_world
from trunkline.foresight.foresight import Foreseen, Foresight
from trunkline.frames import wxyz_from_rotation
from trunkline.hybrid.grasps import object_in_base
from trunkline.teleop.messages import Box, Thing
from trunkline.teleop.rigid_ik import RigidIK
from trunkline.teleop.vectors import DOWN

NAME, TABLE, STAND = "the object", "the table", "the stand"


@dataclass
class Offered:
    """An object that hangs or stands, what it `stands` on, and the horizontal direction from the arm to it that suits
    it, (3,)."""

    thing: Object
    towards: np.ndarray
    stands: Surface | None

    @property
    def name(self) -> str:
        return f"{'standing' if self.stands else 'hanging'} {self.thing.shape}"

    @property
    def way(self) -> str:
        """By which it is grasped: `trunkline.teleop.things.way_of_grasping`."""
        return "basket" if self.thing.shape == "basket" else "hanging"


def offered(
    bench: Bench, s: settings.Grasped, rng: np.random.Generator, shapes: Sequence[settings.Shape] = ()
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
    thing = Object(shape, diameter, of.height, mass, place.tolist(), turn, hanging=not stands)
    if not stands:
        return Offered(thing, towards, None)
    thing.position = (place - thing.grip).tolist()
    return Offered(thing, towards, Surface([*thing.position[:2], thing.position[2] - thing.half_height], list(s.stand)))


def session_of(
    bench: Bench, s: settings.Grasped, object: Offered, operator: Operator, seed: int, table: Surface | None = None
) -> Session:
    """The stand-in at its ready pose, the object on its string or its stand, the client's world as it is seen at
    first."""
    x, y, z = bench.settings.mount_ready
    ready, thing = RigidIK(bench.config.mount_offset).solve(START, (x, y, z), DOWN, 0.0), object.thing
    hook = [thing.position[0], thing.position[1], thing.position[2] + thing.diameter / 2 + s.string]
    surfaces = {name: board for name, board in ((TABLE, table), (STAND, object.stands)) if board is not None}
    scene = Scene(FLOOR, thing, surfaces, None if object.stands else hook)
    robot = StandInRobot(bench.arm, scene, bench.stand_in, ready, seed)
    boxes = (FLOOR_BOX, *(box_of(name, board) for name, board in surfaces.items()))
    seen = robot.seen()
    a, b, c = (float(value) for value in seen.thing)
    d, e, f, g = (float(value) for value in seen.thing_quaternion)
    told = Thing(
        NAME, thing.shape, thing.diameter, thing.height, thing.mass, (a, b, c), (d, e, f, g),
        "standing" if object.stands else "hanging", thing.basket,
    )  # fmt: skip
    foresight = None
    if bench.judged:
        assert bench.known is not None
        foresight = Foresight(bench.known, bench.package.grips(bench.config), bench.previewing)
    return Session(
        bench.package, bench.config, robot, (operator.left, operator.right), make_world(boxes, (told,)),
        lambda now: robot.truth().grip, foresight,
    )  # fmt: skip


def box_of(name: str, board: Surface) -> Box:
    """As the client is told of it."""
    half, top = np.array(board.size) / 2, np.array(board.top)
    (a, b, c), (d, e, f) = ((float(v) for v in corner) for corner in (top - half * [1, 1, 2], top + half * [1, 1, 0]))
    return Box(name, (a, b, c), (d, e, f))


def beside(bench: Bench, object: Offered) -> np.ndarray:
    """Where the operator means the mount to be, less what is gripped, (3,), m: the grasp frame."""
    frame = bench.config.basket.grasp if object.way == "basket" else bench.config.hanging.grasp
    centre = object_in_base(bench.package.geometry, object.thing.diameter, frame, "dorsal")
    return -centre[0] * object.towards - [0.0, 0.0, centre[2]]


def grasp(bench: Bench, seed: int) -> Staged:
    rng, s = np.random.default_rng([seed, 2]), settings.grasped()
    object = offered(bench, s, rng)
    operator = bench.operator(rng)
    session = session_of(bench, s, object, operator, seed)

    def judge(result: Result, ending: Ending, frames: list[Seen], _) -> str:
        cause = failure(ending, frames, s)
        tell(result, ending, session, not cause)
        return cause

    script = operator.grasp(beside(bench, object), s.accept, s.hold)
    return Staged("grasp", seed, session, script, judge, object.name)


def held_after(frames: list[Seen]) -> Seen | None:
    """The first frame after the first execution, None where there was none."""
    pairs = zip(frames, frames[1:], strict=False)
    return next((after for frame, after in pairs if frame.mode == "execute" != after.mode), None)


def tell(result: Result, ending: Ending, session: Session, succeeded: bool) -> None:
    """What the preview had said, and how far off it was."""
    result.plans, result.probability = ending.plans, ending.probability
    if np.isfinite(ending.probability):
        result.agreed = float((ending.probability >= 0.5) == succeeded)
        if session.foreseen is not None:
            result.path_pct = 100 * tip_difference(session, session.foreseen) / session.package.geometry.length


def tip_difference(session: Session, foreseen: Foreseen) -> float:
    """Median distance between the robot's tip and the nominal preview's at the same time, m."""
    nominal, times = foreseen.preview.nominal, foreseen.begins + foreseen.preview.nominal.time
    took = np.array([time for time, _ in session.tips])
    tips = np.array([tip for _, tip in session.tips])
    during = (took >= times[0]) & (took <= times[-1])
    shown = np.column_stack([np.interp(took[during], times, column) for column in nominal.tip[0].T])
    return float(np.median(np.linalg.norm(tips[during] - shown, axis=1)))


def failure(ending: Ending, frames: list[Seen], s: settings.Grasped) -> str:
    """Why the grasp failed, "" if it did not."""
    if not ending.done:
        named = ending.why.startswith(("aim", "out of reach", "stopped", "slip"))
        return ending.why if named else f"plan refused: {ending.why}"
    first, last = frames[0], frames[-1]
    done = held_after(frames)
    assert done is not None
    lifted = done.thing[2] - first.thing[2]
    if done.truth.hanging or lifted < s.lifted:
        early = next((frame for frame in frames if np.linalg.norm(frame.truth.arm_thing) > 0), None)
        if early is None:
            return "aim: the arm never touched it"
        return f"slip: it was lifted by {1e3 * lifted:.0f} mm" + (", and hangs" if done.truth.hanging else "")
    if last.truth.thing_world.any():
        return "slip: it touches more than the arm as it is held"
    moved = in_arm(done, last)
    return "" if moved < s.slip else f"slip: it moved by {1e3 * moved:.0f} mm in the arm as it was held"


def in_arm(before: Seen, after: Seen) -> float:
    """m by which the object has moved against the units that held it before."""
    holding = np.linalg.norm(before.truth.arm_thing, axis=1) > 0
    if not holding.any():
        return float("inf")
    then, now = (frame.thing - frame.units[holding].mean(axis=0) for frame in (before, after))
    return float(np.linalg.norm(now - then))
