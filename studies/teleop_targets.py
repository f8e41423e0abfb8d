"""Targets that the maps call reachable: how many can be planned, and how near to them the arm comes to rest.

    python -m studies.teleop_targets [count]

Tip targets are drawn in the arm's bending plane, within reach, under gravity from a side drawn at random. All that
plans is read from the package alone; MuJoCo settles the calibrated arm under the commands, without friction. Mount
targets are drawn inside the rigid map, straight down, with headings that bending-plane alignment asks for; mink solves
them from one pose.
"""

import sys
import time
from pathlib import Path

import numpy as np

from trunkline.ar.preview.contents import network_of
from trunkline.ar.teleop.alignment import least_turn, wrist_of
from trunkline.ar.teleop.reach import MapReach
from trunkline.ar.teleop.rigid_ik import RigidIK
from trunkline.ar.teleop.tendons import Network, bend
from trunkline.ar.teleop.vectors import DOWN
from trunkline.errors import InputError
from trunkline.frames import STANDARD_GRAVITY, downwards
from trunkline.model.simulation.rest import settle
from trunkline.model.statics.chain import Chain, read_chain
from trunkline.pipeline.inputs import read_model
from trunkline.unity.unpacked import maps_of, model_of, read_package
from upkeep.results import recorded

ARTIFACTS = Path("artifacts")
TILTS_DEG, TOLERANCE, OFFSET = (0.0, 30.0, 60.0), 0.02, 0.05
START = (0.0, -0.4, 0.0, -2.2, 0.0, 1.8, 0.785)


@recorded("teleop_targets")
def main(count: int) -> None:
    (path,) = (ARTIFACTS / "package_unity").glob("*.tgz")
    files = read_package(path)
    network, chain = network_of(files), read_chain(model_of(files))
    reach = MapReach.from_arrays(maps_of(files))
    model = read_model(ARTIFACTS / "identify_control/arm.xml")
    print("| gravity | answer | tip targets | refused | tip foreseen from target | settled from foreseen | each |")
    print("|---:|---|---:|---:|---:|---:|---:|")
    for tilt in TILTS_DEG:
        for name, statics in (("network", None), ("corrected", chain)):
            soft(reach, network, statics, model, tilt, count, name)
    rigid(reach, np.random.default_rng(0), count)


def soft(reach: MapReach, network: Network, chain: Chain | None, model, tilt: float, count: int, name: str) -> None:
    rng = np.random.default_rng(round(tilt))
    targets, commands, foreseen, gravities, seconds, refused = [], [], [], [], [], 0
    while len(targets) + refused < count:
        x, y, z = (float(value) for value in downwards(np.radians(tilt), np.array(rng.uniform(0, 2 * np.pi))))
        tip = (float(rng.uniform(-0.45, 0.45)), 0.0, float(rng.uniform(-0.52, 0.2)))
        if reach.soft(tip, (x, y, z)).where != "inside":
            continue
        began = time.process_time()
        try:
            found = bend(network, tip, (x, y, z), TOLERANCE, chain)
        except InputError:
            refused += 1
            continue
        seconds.append(time.process_time() - began)
        targets.append(tip)
        commands.append(found.commands)
        foreseen.append(found.tip)
        gravities.append((x, y, z))
    rest = settle(model, np.array(commands), STANDARD_GRAVITY * np.array(gravities))
    off = [
        np.linalg.norm(np.array(foreseen) - targets, axis=1),
        np.linalg.norm(rest.position - foreseen, axis=1)[rest.rested],
    ]
    told = [" / ".join(f"{1e3 * q:.1f}" for q in np.quantile(one, (0.5, 0.95, 1.0))) + " mm" for one in off]
    took = f"{1e3 * np.median(seconds):.0f} ms"
    print(f"| {tilt:.0f}° | {name} | {count} | {refused} | {told[0]} | {told[1]} | {took} |")


def rigid(reach: MapReach, rng: np.random.Generator, count: int) -> None:
    solver, wrist = RigidIK(OFFSET), wrist_of(START, OFFSET)
    done, seconds, why = 0, [], {}
    for _ in range(count):
        mount, inside = (0.0, 0.0, 0.0), False
        while not inside:
            x, y, z = rng.uniform([-0.6, -0.7, 0.0], [0.8, 0.7, 0.9]).tolist()
            mount = (x, y, z)
            inside = reach.rigid(mount, DOWN).where == "inside"
        carried = np.arctan2(mount[1], mount[0]) - np.arctan2(wrist.position[1], wrist.position[0])
        turn = least_turn(float(rng.uniform(-np.pi / 2, np.pi / 2)), wrist.angle)
        began = time.process_time()
        try:
            solver.solve(np.array(START), mount, DOWN, wrist.heading + carried + (turn or 0.0))
            done += 1
        except InputError as error:
            reason = str(error).partition(":")[0]
            why[reason] = why.get(reason, 0) + 1
        seconds.append(time.process_time() - began)
    print(f"mount targets: {done} of {count} solved, {1e3 * np.median(seconds):.0f} ms of processor each, median; "
          f"refused: {', '.join(f'{name} {count}' for name, count in sorted(why.items())) or 'none'}")  # fmt: skip


if __name__ == "__main__":
    main(int(sys.argv[1]) if len(sys.argv) > 1 else 200)
