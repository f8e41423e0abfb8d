"""Does the arm swing on after it has arrived? Commands as they are, and shaped for its own swings, on the twin.

    python -m studies.shaping [--mjcf artifacts/identify_control/arm.xml]

From rest, the dorsal tendon is drawn in by some pulls while the others pay out, along a jerk-limited way; or the mount
is carried sideways. With each shaper the same way is convolved with impulses for the arm's slowest swings, linearised
at the end of the way. The twin moves as it is identified, friction and lag included. Time counts from when the last
command is sent, so the motors' own lag is in it; that a shaped way is longer stands beside it.
"""

import argparse
from pathlib import Path

import mujoco
import numpy as np
from mujoco.batch import Batch

from trunkline.ar.teleop.shaping import Kind, shaped, shaper_of
from trunkline.ar.teleop.trajectory import Limits, point_to_point
from trunkline.ar.teleop.vibration import Swings, slowest, swings
from trunkline.frames import gravity_in_base
from trunkline.model.elements import BACKLASH, RATE_LIMIT, numeric, unload_branches
from trunkline.model.simulation.motion import batch_of, hold, move
from trunkline.model.simulation.rest import base_frame, settle
from trunkline.pipeline.inputs import read_model
from upkeep.results import recorded

PULLS_MM = (30.0, 60.0, 90.0)
TILTS_DEG = (0.0, 30.0)
SECONDS = 10.0  # s for which the tip is looked at
SETTLED = 2.0  # s of its end, some swings, whose mean is where the tip rests
NEAR = 3e-3  # m
WAY = 0.5  # s, of the unshaped way
MOVED = 0.2  # m, of the mount
FRESH = 4  # steps
SHAPERS: tuple[tuple[Kind, int], ...] = (("none", 1), ("zv", 2), ("zvd", 1), ("zvd", 2))


# REC
@recorded("shaping")
def main() -> None:
    parser = argparse.ArgumentParser()
    parser.add_argument("--mjcf", type=Path, default=Path("artifacts/identify_control/arm.xml"))
    model = read_model(parser.parse_args().mjcf)
    straight = model.tendon_length0[model.actuator_trnid[:, 0]]
    print(
        "| gravity | what moves | shaper | way | tip off its rest at arrival, 0.5 s, 1.5 s later | within 3 mm after |"
    )
    print("|---:|---|---|---:|---:|---:|")
    for tilt in TILTS_DEG:
        gravity = gravity_in_base(np.radians(tilt))
        for pull in PULLS_MM:
            end = straight + 1e-3 * pull * np.array([-1.0, 0.85, 0.85])
            way = lasting(straight, end, model.opt.timestep)
            ways = shaped_ways(model, way, swings(model, end, end - straight, gravity))
            tell(f"{tilt:.0f}° | tendons, {pull:.0f} mm", ways, tip_paths(model, ways, gravity), model.opt.timestep)
        for pull in (0.0, PULLS_MM[1]):
            held = straight + 1e-3 * pull * np.array([-1.0, 0.85, 0.85])
            way = lasting(np.zeros(2), np.array([0.0, MOVED]), model.opt.timestep)
            ways = shaped_ways(model, way, swings(model, held, None, gravity))
            name = f"{tilt:.0f}° | mount, {1e3 * MOVED:.0f} mm sideways, pull {pull:.0f} mm"
            tell(name, ways, carried(model, ways, held, gravity), model.opt.timestep)


def shaped_ways(model: mujoco.MjModel, way: np.ndarray, found: Swings) -> list[np.ndarray]:
    """`way` (T, n) by each of SHAPERS."""
    ways = []
    for kind, count in SHAPERS:
        chosen = slowest(found, count)
        ways.append(shaped(way, model.opt.timestep, shaper_of(chosen.periods, chosen.dampings, kind)))
    return ways


def tell(name: str, ways: list[np.ndarray], tips: list[np.ndarray], step: float) -> None:
    for (kind, count), rows, path in zip(SHAPERS, ways, tips, strict=True):
        rest = path[-round(SETTLED / step) :].mean(axis=0)
        off = np.linalg.norm(path - rest, axis=1)[len(rows) :]
        outside = np.flatnonzero(off > NEAR)
        last = (outside[-1] + 1 if len(outside) else 0) * step
        looks = ", ".join(f"{1e3 * off[round(t / step)]:.1f}" for t in (0.0, 0.5, 1.5))
        shaper = kind if kind == "none" else f"{kind}, {count} swing{'s' * (count > 1)}"
        print(f"| {name} | {shaper} | {len(rows) * step:.2f} s | {looks} mm | {last:.2f} s |")


def lasting(start: np.ndarray, end: np.ndarray, step: float) -> np.ndarray:
    """The jerk-limited way of WAY s, whatever it is long."""
    count = len(start)
    size = np.abs(end - start).max()
    rise = WAY / 4  # acceleration up, down, down, up: seven phases without the ones of constant speed
    jerk = size / (2 * rise**3)
    free = np.full(count, 1e3 * size)
    return point_to_point(start, end, Limits(free, free, np.full(count, jerk)), step)


def tip_paths(model: mujoco.MjModel, ways: list[np.ndarray], gravity: np.ndarray) -> list[np.ndarray]:
    """Tips (T, 3), m, while the arm, at rest under the first row, is sent each of `ways` (T, nu), held at its end."""
    batch, before = at_rest(model, len(ways), ways[0][0], gravity)
    rows = np.stack(
        [
            np.concatenate(
                [np.repeat(way[:1], before, axis=0), way, np.repeat(way[-1:], longest(model, ways) - len(way), 0)]
            )
            for way in ways
        ]
    )
    found = move(batch, rows, ("site_xpos",))["site_xpos"][:, before:, model.site("tip").id]
    origin, to_world = base_frame(model)
    return list((found - origin) @ to_world)


def carried(model: mujoco.MjModel, ways: list[np.ndarray], held: np.ndarray, gravity: np.ndarray) -> list[np.ndarray]:
    """The same in the mount's frame while the mount goes each of `ways` (T, 2), m along the base's x and y, and the
    motors stay at `held`. In a frame that accelerates by a, gravity is g - a; it is renewed every FRESH steps."""
    batch, before = at_rest(model, len(ways), held, gravity)
    last, dt = longest(model, ways), model.opt.timestep
    path = np.stack([np.concatenate([way, np.repeat(way[-1:], last - len(way), axis=0)]) for way in ways])
    acceleration = np.gradient(np.gradient(path, dt, axis=1), dt, axis=1)
    origin, to_world = base_frame(model)
    field, tips = batch.expand("opt.gravity"), []
    rows = np.tile(held, (len(ways), FRESH, 1))
    for _ in range(before // FRESH):
        move(batch, rows, ())
    for start in range(0, last - last % FRESH, FRESH):
        pushed = np.tile(gravity, (len(ways), 1))
        pushed[:, :2] -= acceleration[:, start : start + FRESH].mean(axis=1)
        field[:] = pushed @ to_world.T
        tips.append(move(batch, rows, ("site_xpos",))["site_xpos"][:, :, model.site("tip").id])
    return list((np.concatenate(tips, axis=1) - origin) @ to_world)


def at_rest(model: mujoco.MjModel, count: int, held: np.ndarray, gravity: np.ndarray) -> tuple[Batch, int]:
    """Simulations at rest under commands `held` (nu,), and the steps in which what friction holds comes to rest."""
    if numeric(model, RATE_LIMIT) or numeric(model, BACKLASH):
        raise ValueError("found winches with a rate limit or backlash, expected none: this study does not wind them")
    rest = settle(model, held[None], gravity[None]).qpos
    unload_branches(model, rest)
    batch = batch_of(model, count)
    batch.expand("opt.gravity")[:] = base_frame(model)[1] @ gravity
    hold(batch, model, np.tile(held, (count, 1)))
    batch.bind("qpos")[:] = rest
    return batch, round(1.0 / model.opt.timestep)


def longest(model: mujoco.MjModel, ways: list[np.ndarray]) -> int:
    """Steps of the longest of `ways` and SECONDS more."""
    return max(map(len, ways)) + round(SECONDS / model.opt.timestep)


if __name__ == "__main__":
    main()
