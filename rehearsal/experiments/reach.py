"""Reach a static object: a sphere hangs at a random place; success is that the soft arm's tip touches it.

The first contact of the arm with anything decides. What previews state of the tip's end is of an arm that touches
nothing, and no client here knows the object. So it is held against the same robot that runs the same plan once more
with the object away. A third time it corrects itself by cameras. How far off the tip was beside the object is told too.
"""

import numpy as np

from rehearsal.experiments.bench import SessionFrame, SharedRun, Staged, executed
from rehearsal.experiments.corrected import plan_that_corrects, tell_correction
from rehearsal.experiments.result import LATER, Result
from rehearsal.operator.scripts import Ending
from rehearsal.session import RehearsedSession
from trunkline.ar.session.messages import PredictionMessage
from trunkline.ar.teleop.plan import Plan
from trunkline.errors import InputError

WITHIN = 0.02  # m from the object's place: nearer than its surface, which a tip also touches from the side


def reach(bench: SharedRun, seed: int) -> Staged:
    rng = np.random.default_rng([seed, 0])
    object, operator = bench.place(rng), bench.operator(rng)
    session = bench.session(operator, object, seed, lambda now: object)
    least, radius = bench.arm.chain.units - bench.settings.tip_units, bench.settings.diameter / 2

    def judge(result: Result, ending: Ending, frames: list[SessionFrame], _) -> str:
        result.plans = ending.plans
        result.aimed_mm, result.previewed_mm = 1e3 * ending.aimed, 1e3 * ending.previewed
        result.clean = float(is_clean(frames, object, least))
        if frames:
            result.nearest_mm = 1e3 * min(float(np.linalg.norm(frame.truth.tip - object)) for frame in frames)
        return failure(ending, frames, least, radius)

    def watch(result: Result, ending: Ending, frames: list[SessionFrame]) -> None:
        foreseen = session.controller.prediction if ending.done and bench.judged else None
        plan, last = session.controller.plan, executed(frames)
        if foreseen is not None and plan is not None and last is not None:
            alone = bench.session(operator, None, seed, lambda now: object)
            tips = tips_after(alone, plan)
            tell_end(result, foreseen, plan.duration, tips)
            request, again = session.request, bench.session(operator, None, seed, lambda now: object)
            assert request is not None, "the plan was made for one"
            corrects = plan_that_corrects(again, request, session.executor.hangs, plan)
            execute(again, corrects)
            tell_correction(result, again, corrects, request.targets, tips["after_10s"])
            result.touching_mm = 1e3 * _off(foreseen, plan.duration, session.in_client_frame(last.truth.tip))

    return Staged("reach", seed, session, operator.reach(), judge, watch=watch)


def failure(ending: Ending, frames: list[SessionFrame], least: int, radius: float) -> str:
    """Why the tip did not reach the object, "" if it did. The first of these that is so:

    1. The robot never moved: why the operator gave up, else why no plan was to be had.
    2. The arm touched something, and in the first frame in which it did, a force was no number: error.
    3. In that frame it touched the world, whatever else it touched: collision.
    4. In that frame a unit before the tip's touched the object, whatever others did: collision.
    5. The robot did not do what was confirmed: why not.
    6. In that frame the tip's units alone touched the object, and nothing else: success. What follows does not count.
    7. It touched nothing. The tip target was further from the object's centre than its radius: aim.
    8. Else: missed.

    Args:
        frames: from where the robot began to move. least: number from 0 of the first unit that counts as the tip.
        radius: of the object, m.
    """
    why = ending.why or "stopped: the operator gave up"
    if not frames:
        return why if why.startswith(("aim", "out of reach", "stopped")) else f"plan refused: {why}"
    first = next((frame for frame in frames if _touches(frame)), None)
    if first is not None:
        object, world = first.truth.arm_object, first.truth.arm_world
        if not (np.isfinite(object).all() and np.isfinite(world).all()):
            return "error: the force of a contact is no number"
        if world.any():
            return "collision: the arm touched the world"
        units = np.flatnonzero(object.any(axis=1))
        if units[0] < least:
            return f"collision: unit {units[0] + 1} touched it first"
    if not ending.done:
        return why
    if first is not None:
        return ""
    if not ending.aimed <= radius:
        return "aim: the tip target was beside the object"
    return "missed: the preview's tip was on the object, the robot's was not"


def is_clean(frames: list[SessionFrame], place: np.ndarray, least: int) -> bool:
    """Whether the tip came within WITHIN of the object's place (3,), m, while nothing but the object was touched, and
    that by units from number `least` on alone, from the first frame to the last. A force that is no number is a touch;
    a robot that never moved, and a tip that is nowhere, came near nothing."""
    worlds = [frame.truth.arm_world for frame in frames]
    shafts = [frame.truth.arm_object[:least] for frame in frames]
    if any(forces.any() for forces in worlds + shafts):
        return False
    return any(float(np.linalg.norm(frame.truth.tip - place)) <= WITHIN for frame in frames)


def _touches(frame: SessionFrame) -> bool:
    return bool(frame.truth.arm_object.any() or frame.truth.arm_world.any())


def tell_end(result: Result, foreseen: PredictionMessage, duration: float, tips: dict[str, np.ndarray]) -> None:
    """How far the preview ends from the target, and the robot's tip was from where the preview had it then, at the end
    of a plan of `duration` s and later; tips (3,), m, by LATER."""
    result.plan_end_mm = float("nan") if foreseen.miss is None else 1e3 * foreseen.miss
    result.radius_mm = 1e3 * foreseen.spread[-1] if foreseen.spread else float("nan")  # unknown
    for name, tip in tips.items():
        setattr(result, f"{name}_mm", 1e3 * _off(foreseen, duration + LATER[name], tip))


def _off(foreseen: PredictionMessage, time: float, tip: np.ndarray) -> float:
    """From where the preview has the tip at `time`, s, to `tip` (3,), m."""
    previewed = [np.interp(time, foreseen.times, path) for path in np.transpose(foreseen.tip)]
    return float(np.linalg.norm(tip - previewed))


def tips_after(session: RehearsedSession, plan: Plan) -> dict[str, np.ndarray]:
    """Where the tip of a robot that has not moved yet appears, (3,), m, when it has run `plan`, and by LATER after it.

    Raises:
        InputError: it does not run the plan.
    """
    execute(session, plan)
    tips, waited = {}, 0.0
    for name, seconds in LATER.items():
        session.robot.advance(seconds - waited)
        tips[name], waited = session.in_client_frame(session.robot.truth().tip), seconds
    return tips


def execute(session: RehearsedSession, plan: Plan) -> None:
    """Let a robot that has not moved yet run `plan` to its end.

    Raises:
        InputError: it does not run it.
    """
    robot = session.executor
    refused = robot.start(plan, plan.digest())
    while not refused and robot.state().mode != "done":
        robot.permit()
        robot.advance()
        refused = robot.state().fault
    if refused:
        raise InputError(f"plan: {refused}, expected what the robot has run before")
