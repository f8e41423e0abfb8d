"""Grasp what stands on one surface, bring it to another, a table, and let it go: success is that it rests there."""

import numpy as np

from rehearsal import settings
from rehearsal.experiments.bench import SessionFrame, SharedRun, Staged, executed
from rehearsal.experiments.grasp import NAME, TABLE, beside, failure, offered, session_of, tell
from rehearsal.experiments.result import Result
from rehearsal.operator.scripts import Ending
from rehearsal.robot.scene import LabScene
from rehearsal.session import View
from trunkline.ar.hybrid.worlds import SupportSurface
from trunkline.ar.teleop.object_shapes import below_grip
from trunkline.frames import STANDARD_GRAVITY

STANDING: tuple[settings.Shape, ...] = ("basket",)
STILL, BORNE = 0.03, 0.5  # m/s; of its weight, by the table


def table_for(s: settings.Grasped, place: list[float], rng: np.random.Generator) -> SupportSurface:
    """To either side of the object."""
    azimuth = np.arctan2(place[1], place[0]) + rng.choice([-1, 1]) * np.radians(s.table_azimuth_deg)
    top = [s.table_radius * float(np.cos(azimuth)), s.table_radius * float(np.sin(azimuth)), s.table_top]
    return SupportSurface(top, list(s.table), "wood")


def handle(bench: SharedRun, seed: int) -> Staged:
    rng, s = np.random.default_rng([seed, 3]), settings.grasped()
    placed = offered(bench, s, rng, STANDING)
    table = table_for(s, placed.object.position, rng)
    operator = bench.operator(rng)
    session = session_of(bench, s, placed, operator, seed, table)

    def spot(view: View) -> np.ndarray:
        """Where the grip is when the lowest point of the object, as it hangs in the arm, is above the table."""
        return session.in_client_frame(np.array(table.top)) + [0.0, 0.0, below_grip(view.world.object(NAME)) + s.drop]

    def judge(result: Result, ending: Ending, frames: list[SessionFrame], _) -> str:
        cause = why_not(ending, frames, session.robot.scene, s)
        tell(result, ending, session, not cause)
        return cause

    script = operator.handle(beside(bench, placed), spot, s.accept, s.calm)
    return Staged("handle", seed, session, script, judge, placed.name)


def why_not(ending: Ending, frames: list[SessionFrame], scene: LabScene, s: settings.Grasped) -> str:
    """Why the object does not rest on the table, "" if it does. The first of these that is so:

    1. The operator gave up, the robot did not do what was confirmed, or no plan was run to its end: as of a grasp.
    2. In the last frame the table bears more than BORNE of the object's weight, which is slower than STILL, and the
       arm touches it: stopped; does not: success, whatever came before.
    3. No second plan was run: slip. While it was, the object was never above the table: slip.
    4. Else: missed.
    """
    grasped = executed(frames)
    if grasped is None or not ending.done:
        return failure(ending, frames, s)
    last, table = frames[-1], scene.surfaces[TABLE]
    borne = last.truth.object_world[scene.names().index(TABLE), 2] > BORNE * scene.object.mass * STANDARD_GRAVITY
    if borne and np.linalg.norm(last.truth.speed) < STILL:
        return "" if not np.linalg.norm(last.truth.arm_object) else "stopped: the arm still touches it"
    second = [frame for frame in frames if frame.mode == "execute" and frame.now > grasped.now]
    if not second:
        return "slip: it was dropped before it was brought anywhere"
    half = np.array(table.size[:2]) / 2
    if not any((np.abs(frame.object[:2] - table.top[:2]) <= half).all() for frame in second):
        return "slip: it was dropped on its way"
    return "missed: it did not stay on the table"
