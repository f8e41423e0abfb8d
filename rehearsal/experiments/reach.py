"""Reach a static object: a sphere hangs at a random place; success is that the soft arm's tip touches it."""

import numpy as np

from rehearsal.experiments.bench import Bench, Seen, Staged
from rehearsal.experiments.result import Result
from rehearsal.operator.scripts import Ending


def reach(bench: Bench, seed: int) -> Staged:
    rng = np.random.default_rng([seed, 0])
    thing, operator = bench.place(rng), bench.operator(rng)
    session = bench.session(operator, thing, seed, lambda now: thing)

    def judge(result: Result, ending: Ending, frames: list[Seen], _) -> str:
        result.plans = ending.plans
        result.aimed_mm, result.previewed_mm = 1e3 * ending.aimed, 1e3 * ending.previewed
        if not frames:
            return ending.why if ending.why.startswith(("aim", "out of reach")) else f"plan refused: {ending.why}"
        result.nearest_mm = 1e3 * min(float(np.linalg.norm(frame.truth.tip - thing)) for frame in frames)
        return failure(bench, ending, frames)

    return Staged("reach", seed, session, operator.reach(), judge)


def failure(bench: Bench, ending: Ending, frames: list[Seen]) -> str:
    """Why the tip never touched the object, "" if it did."""
    touching = [np.flatnonzero(np.linalg.norm(frame.truth.arm_thing, axis=1)) for frame in frames]
    least = bench.arm.chain.units - bench.settings.tip_units
    if any((units >= least).any() for units in touching):
        return ""
    if touched := [units for units in touching if len(units)]:
        return f"collision: unit {touched[0][0] + 1} touched it first"
    if any(np.linalg.norm(frame.truth.arm_world) > 0 for frame in frames):
        return "collision: the arm touched the world"
    if not ending.done:
        return ending.why
    if ending.aimed > bench.settings.diameter / 2:
        return "aim: the tip target was beside the object"
    return "missed: the preview's tip was on the object, the robot's was not"
