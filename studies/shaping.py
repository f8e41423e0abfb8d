"""Does the arm swing on after it has arrived? Commands as they are, and shaped for its own swings, on the twin.

    python -m studies.shaping [--mjcf artifacts/identify_control/arm.xml]

From rest, the dorsal tendon is drawn in by some pulls while the others pay out, along a jerk-limited way; with each
shaper the same way is convolved with impulses for the arm's slowest swings, linearised at the end of the way. The twin
moves as it is identified, friction and lag included. Time counts from when the last command is sent, so the motors'
own lag is in it, and the longer way of a shaped command is not: that stands beside it.
"""

import argparse
from pathlib import Path

import mujoco
import numpy as np

from trunkline.elements import BACKLASH, RATE_LIMIT, give_way, numeric
from trunkline.frames import gravity_in_base
from trunkline.pipeline.inputs import read_model
from trunkline.simulation.motion import batch_of, hold, move
from trunkline.simulation.rest import base_frame, settle
from trunkline.teleop.shaping import Kind, shaped, shaper_of
from trunkline.teleop.swing import slowest, swings
from trunkline.teleop.trajectory import Limits, point_to_point

PULLS_MM = (30.0, 60.0, 90.0)
TILTS_DEG = (0.0, 30.0)
SECONDS = 10.0  # after which the tip counts as at rest
NEAR = 3e-3  # m
WAY = 0.5  # s, of the unshaped way
SHAPERS: tuple[tuple[Kind, int], ...] = (("none", 1), ("zv", 1), ("zv", 2), ("zvd", 1), ("zvd", 2), ("zvd", 3))


# REC
def main() -> None:
    parser = argparse.ArgumentParser()
    parser.add_argument("--mjcf", type=Path, default=Path("artifacts/identify_control/arm.xml"))
    model = read_model(parser.parse_args().mjcf)
    straight = model.tendon_length0[model.actuator_trnid[:, 0]]
    print("| gravity | pull | shaper | way | tip off its rest at arrival, 0.5 s, 1.5 s later | within 3 mm after |")
    print("|---:|---:|---|---:|---:|---:|")
    for tilt in TILTS_DEG:
        gravity = gravity_in_base(np.radians(tilt))
        for pull in PULLS_MM:
            end = straight + 1e-3 * pull * np.array([-1.0, 0.85, 0.85])
            way = lasting(straight, end, model.opt.timestep)
            found = swings(model, end, end - straight, gravity)
            ways = []
            for kind, count in SHAPERS:
                chosen = slowest(found, count)
                shaper = shaper_of(chosen.periods, chosen.dampings, kind)
                ways.append(shaped(way, model.opt.timestep, shaper))
            for (kind, count), rows, tips in zip(SHAPERS, ways, tip_paths(model, ways, gravity), strict=True):
                arrived = len(rows)
                off = np.linalg.norm(tips - tips[-1], axis=1)[arrived:]
                outside = np.flatnonzero(off > NEAR)
                last = (outside[-1] + 1 if len(outside) else 0) * model.opt.timestep
                looks = [1e3 * off[round(t / model.opt.timestep)] for t in (0.0, 0.5, 1.5)]
                name = kind if kind == "none" else f"{kind}, {count} swings"
                print(f"| {tilt:.0f}° | {pull:.0f} mm | {name} | {arrived * model.opt.timestep:.2f} s "
                      f"| {looks[0]:.1f}, {looks[1]:.1f}, {looks[2]:.1f} mm | {last:.2f} s |")  # fmt: skip


def lasting(start: np.ndarray, end: np.ndarray, step: float) -> np.ndarray:
    """The jerk-limited way of WAY s, whatever it is long."""
    count = len(start)
    size = np.abs(end - start).max()
    rise = WAY / 4  # acceleration up, down, down, up: seven phases without the ones of constant speed
    jerk = size / (2 * rise**3)
    free = np.full(count, 1e3 * size)
    return point_to_point(start, end, Limits(free, free, np.full(count, jerk)), step)


def tip_paths(model: mujoco.MjModel, ways: list[np.ndarray], gravity: np.ndarray) -> list[np.ndarray]:
    """Tips (T, 3), m, while the arm, at rest under the first row, is sent each of `ways` (T, nu), its end held for
    SECONDS."""
    if numeric(model, RATE_LIMIT) or numeric(model, BACKLASH):
        raise ValueError("found winches with a rate limit or backlash, expected none: this study does not wind them")
    origin, to_world = base_frame(model)
    before = round(1.0 / model.opt.timestep)  # in which what friction holds comes to rest
    rest = settle(model, ways[0][:1], gravity[None]).qpos
    give_way(model, rest)
    longest = max(len(way) for way in ways) + round(SECONDS / model.opt.timestep)
    rows = np.stack(
        [
            np.concatenate([np.repeat(way[:1], before, axis=0), way, np.repeat(way[-1:], longest - len(way), axis=0)])
            for way in ways
        ]
    )
    batch = batch_of(model, len(ways))
    batch.expand("opt.gravity")[:] = to_world @ gravity
    hold(batch, model, rows[:, 0])
    batch.bind("qpos")[:] = rest
    found = move(batch, rows, ("site_xpos",))["site_xpos"][:, before:, model.site("tip").id]
    return list((found - origin) @ to_world)


if __name__ == "__main__":
    main()
