"""Targets that the maps call reachable: how many can be planned, and how near to them the arm comes to rest.

    python -m studies.teleop_targets

Tip targets are drawn in the arm's bending plane, inside the soft map; commands are the network's, and MuJoCo settles
the calibrated arm under them, without friction. Mount targets are drawn inside the rigid map, straight down, with
headings that bending-plane alignment asks for; mink solves them from one pose.
"""

import time
from functools import partial
from pathlib import Path

import numpy as np
import onnxruntime

from trunkline.errors import InputError
from trunkline.frames import gravity_in_base
from trunkline.ik.ask import ask
from trunkline.pipeline.inputs import read_model
from trunkline.pipeline.results import recorded
from trunkline.simulation.rest import settle
from trunkline.teleop.alignment import least_turn, wrist_of
from trunkline.teleop.reach import MapReach
from trunkline.teleop.rigid_ik import RigidIK
from trunkline.teleop.tendons import bend
from trunkline.teleop.vectors import DOWN

ARTIFACTS = Path("artifacts")
COUNT, TILTS_DEG, TOLERANCE, OFFSET = 200, (0.0, 30.0, 60.0), 0.02, 0.05
START = (0.0, -0.4, 0.0, -2.2, 0.0, 1.8, 0.785)


@recorded("teleop_targets")
def main() -> None:
    network = onnxruntime.InferenceSession(str(ARTIFACTS / "train_ik/ik.onnx"), providers=["CPUExecutionProvider"])
    model = read_model(ARTIFACTS / "identify_control/arm.xml")
    with np.load(ARTIFACTS / "reachability/grids.npz") as arrays:
        reach = MapReach.from_arrays(dict(arrays))
    rng = np.random.default_rng(0)
    print("| gravity | tip targets | refused | tip foreseen from target | settled from foreseen |")
    print("|---:|---:|---:|---:|---:|")
    for tilt in TILTS_DEG:
        soft(reach, partial(ask, network), model, np.radians(tilt), rng)
    rigid(reach, rng)


def soft(reach: MapReach, network, model, tilt: float, rng: np.random.Generator) -> None:
    gravity = gravity_in_base(tilt)
    x, y, z = (float(value) for value in gravity / np.linalg.norm(gravity))
    targets, commands, foreseen, refused = [], [], [], 0
    while len(targets) + refused < COUNT:
        tip = (float(rng.uniform(-0.45, 0.45)), 0.0, float(rng.uniform(-0.52, 0.2)))
        if reach.soft(tip, (x, y, z)).where != "inside":
            continue
        try:
            found = bend(network, tip, (x, y, z), TOLERANCE)
        except InputError:
            refused += 1
            continue
        targets.append(tip)
        commands.append(found.commands)
        foreseen.append(found.tip)
    rest = settle(model, np.array(commands), gravity)
    off = [
        np.linalg.norm(np.array(foreseen) - targets, axis=1),
        np.linalg.norm(rest.position - foreseen, axis=1)[rest.rested],
    ]
    told = [" / ".join(f"{1e3 * q:.1f}" for q in np.quantile(one, (0.5, 0.95, 1.0))) + " mm" for one in off]
    print(f"| {np.degrees(tilt):.0f}° | {COUNT} | {refused} | {told[0]} | {told[1]} |")


def rigid(reach: MapReach, rng: np.random.Generator) -> None:
    solver, wrist = RigidIK(OFFSET), wrist_of(START, OFFSET)
    done, seconds, why = 0, [], {}
    for _ in range(COUNT):
        mount, inside = (0.0, 0.0, 0.0), False
        while not inside:
            mount = tuple(float(value) for value in rng.uniform([-0.6, -0.7, 0.0], [0.8, 0.7, 0.9]))
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
    print(f"mount targets: {done} of {COUNT} solved, {1e3 * np.median(seconds):.0f} ms of processor each, median; "
          f"refused: {', '.join(f'{name} {count}' for name, count in sorted(why.items())) or 'none'}")  # fmt: skip


if __name__ == "__main__":
    main()
