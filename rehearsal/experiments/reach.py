"""Reach a static object: a sphere hangs at a random place; success is that the soft arm's tip touches it."""

import numpy as np

from rehearsal.experiments.bench import Bench, Seen, rehearse
from rehearsal.experiments.result import Result
from rehearsal.operator.scripts import Ending


def reach(bench: Bench, seed: int) -> tuple[Result, list[Seen]]:
    """One run, and its frames from where the robot began to move."""
    rng = np.random.default_rng([seed, 0])
    thing, operator = bench.place(rng), bench.operator(rng)
    session = bench.session(operator, thing, seed, lambda now: thing)
    ending, frames, _ = rehearse(session, operator.reach())
    result = Result("reach", seed, False, seconds=session.now, package=session.package.digest[:12])
    if not isinstance(ending, Ending):
        result.cause = "stopped: the run did not end"
        return result, frames
    result.plans = ending.plans
    result.aimed_mm, result.previewed_mm = 1e3 * ending.aimed, 1e3 * ending.previewed
    if not frames:
        result.cause = ending.why if ending.why.startswith(("aim", "out of reach")) else f"plan refused: {ending.why}"
        return result, frames
    result.nearest_mm = 1e3 * min(float(np.linalg.norm(frame.truth.tip - thing)) for frame in frames)
    touching = [np.flatnonzero(np.linalg.norm(frame.truth.arm_thing, axis=1)) for frame in frames]
    units = bench.arm.chain.units
    result.success = any((units_touching >= units - bench.settings.tip_units).any() for units_touching in touching)
    if not result.success:
        touched = [units_touching for units_touching in touching if len(units_touching)]
        world = any(np.linalg.norm(frame.truth.arm_world) > 0 for frame in frames)
        if touched:
            result.cause = f"collision: unit {touched[0][0] + 1} touched it first"
        elif world:
            result.cause = "collision: the arm touched the world"
        elif not ending.done:
            result.cause = ending.why
        elif 1e3 * ending.aimed > 1e3 * bench.settings.diameter / 2:
            result.cause = "aim: the tip target was beside the object"
        else:
            result.cause = "missed: the preview's tip was on the object, the robot's was not"
    return result, frames
