"""Grasp what hangs: success is that it is lifted and held for some seconds, without slip or drop."""

from dataclasses import dataclass

import numpy as np
from scipy.spatial.transform import Rotation

from rehearsal import settings
from rehearsal.experiments.bench import FLOOR, FLOOR_BOX, START, Bench, Seen, rehearse
from rehearsal.experiments.result import Result
from rehearsal.operator.scripts import Ending, Operator
from rehearsal.robot.scene import Object, Scene, Surface
from rehearsal.robot.stand_in import StandInRobot
from rehearsal.session import Session, make_world
from trunkline.foresight.foresight import Foresight
from trunkline.foresight.twin import believed
from trunkline.frames import wxyz_from_rotation
from trunkline.hybrid.grasps import object_in_base
from trunkline.teleop.messages import Box, Thing
from trunkline.teleop.rigid_ik import RigidIK
from trunkline.teleop.vectors import DOWN

NAME = "the object"


@dataclass
class Hung:
    """An object that hangs, and the horizontal direction from the arm to it that suits it, (3,)."""

    thing: Object
    towards: np.ndarray


def hung(bench: Bench, s: settings.Grasped, rng: np.random.Generator) -> Hung:
    """A random object at a random place, no heavier than what may be grasped at its width."""
    shape = s.shapes[rng.integers(len(s.shapes))]
    diameter = float(rng.uniform(s.thin, s.wide))
    heaviest = min(s.heavy, bench.config.handling.heaviest(diameter))
    radius, azimuth = np.sqrt(rng.uniform(s.near**2, s.far**2)), np.radians(rng.uniform(-s.side_deg, s.side_deg))
    place = [radius * np.cos(azimuth), radius * np.sin(azimuth), float(rng.uniform(s.low, s.high))]
    yaw = azimuth + (np.radians(rng.uniform(-s.yaw_deg, s.yaw_deg)) if shape == "cylinder" else 0.0)
    towards = np.array([np.cos(yaw), np.sin(yaw), 0.0])
    level = Rotation.from_euler("z", yaw) * Rotation.from_euler("x", np.pi / 2)  # its axis level, across `towards`
    mass = float(rng.uniform(s.light, heaviest))
    turn = wxyz_from_rotation(level).tolist()
    return Hung(Object(shape, diameter, s.height, mass, [float(x) for x in place], turn, hanging=True), towards)


def session_of(
    bench: Bench, s: settings.Grasped, hung: Hung, operator: Operator, seed: int, table: Surface | None = None
) -> Session:
    """The stand-in at its ready pose, the object on its string, the client's world as it is seen at first."""
    x, y, z = bench.settings.mount_ready
    ready, thing = RigidIK(bench.config.mount_offset).solve(START, (x, y, z), DOWN, 0.0), hung.thing
    hook = [thing.position[0], thing.position[1], thing.position[2] + thing.diameter / 2 + s.string]
    surfaces = {} if table is None else {"table": table}
    robot = StandInRobot(bench.arm, Scene(FLOOR, thing, surfaces, hook), bench.stand_in, ready, seed)
    boxes = (FLOOR_BOX,) if table is None else (FLOOR_BOX, box_of(table))
    seen = robot.seen()
    assert thing.shape != "basket"  # `Grasped.shapes` has none
    a, b, c = (float(value) for value in seen.thing)
    d, e, f, g = (float(value) for value in seen.thing_quaternion)
    told = Thing(NAME, thing.shape, thing.diameter, thing.height, thing.mass, (a, b, c), (d, e, f, g))
    previewing = settings.previewing()
    known = believed(previewing, bench.package.files)
    foresight = Foresight(known, bench.package.grips(bench.config), previewing)
    return Session(
        bench.package, bench.config, robot, (operator.left, operator.right), make_world(boxes, (told,)),
        lambda now: robot.truth().thing, foresight,
    )  # fmt: skip


def box_of(table: Surface) -> Box:
    """As the client is told of it."""
    half, top = np.array(table.size) / 2, np.array(table.top)
    (a, b, c), (d, e, f) = ((float(v) for v in corner) for corner in (top - half * [1, 1, 2], top + half * [1, 1, 0]))
    return Box("the table", (a, b, c), (d, e, f))


def beside(bench: Bench, hung: Hung) -> np.ndarray:
    """Where the operator means the mount to be, less the object's centre, (3,), m: the grasp frame."""
    centre = object_in_base(bench.package.geometry, hung.thing.diameter, bench.config.hanging.grasp, "dorsal")
    return -centre[0] * hung.towards - [0.0, 0.0, centre[2]]


def grasp(bench: Bench, seed: int) -> tuple[Result, list[Seen]]:
    """One run, and its frames from where the robot began to move."""
    rng, s = np.random.default_rng([seed, 2]), settings.grasped()
    object = hung(bench, s, rng)
    operator = bench.operator(rng)
    session = session_of(bench, s, object, operator, seed)
    ending, frames, _ = rehearse(session, operator.grasp(beside(bench, object), s.accept, s.hold))
    result = Result("grasp", seed, False, seconds=session.now, package=session.package.digest[:12])
    if not isinstance(ending, Ending):
        result.cause = "stopped: the run did not end"
        return result, frames
    result.cause = failure(ending, frames, s)
    result.success = not result.cause
    tell(result, ending, session)
    return result, frames


def held_after(frames: list[Seen]) -> Seen | None:
    """The first frame after the first execution, None where there was none."""
    pairs = zip(frames, frames[1:], strict=False)
    return next((after for frame, after in pairs if frame.mode == "execute" != after.mode), None)


def tell(result: Result, ending: Ending, session: Session) -> None:
    """What the preview had said, and how far off it was."""
    result.plans, result.probability = ending.plans, ending.probability
    if np.isfinite(ending.probability):
        result.agreed = float((ending.probability >= 0.5) == result.success)
        result.path_pct = 100 * tip_difference(session) / session.package.geometry.length


def tip_difference(session: Session) -> float:
    """Median distance between the robot's tip and the nominal preview's at the same time, m."""
    foreseen = session.foreseen
    assert foreseen is not None
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
    moved = in_arm(done, last)
    return "" if moved < s.slip else f"slip: it moved by {1e3 * moved:.0f} mm in the arm as it was held"


def in_arm(before: Seen, after: Seen) -> float:
    """m by which the object has moved against the units that held it before."""
    holding = np.linalg.norm(before.truth.arm_thing, axis=1) > 0
    if not holding.any():
        return float("inf")
    then, now = (frame.thing - frame.units[holding].mean(axis=0) for frame in (before, after))
    return float(np.linalg.norm(now - then))
