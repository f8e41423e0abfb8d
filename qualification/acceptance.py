"""What a live session's previews were to achieve and what they do: a Markdown table.

    python -m qualification.acceptance [PACKAGE]

How soon a preview is there, and whether the simulated robot does what it shows: on a package, by the process that plans
in a live session. Each plan begins at rest; the robot is the live session's, stepped without waiting. The object of a
live session's settings is there, and the arm may push it on its way: such plans are told apart, as contacts are softer
in a preview (`trunkline/ar/hybrid/rollouts.py`).

Goals were set before any of it was built; what misses one is printed as it is. Times are by the wall, of a machine that
should do nothing else. Goals of presses, alignment, clocks, the page, the log and ROS 2's bytes are held by tests:
tests/ar/teleop/test_presses.py, tests/ar/session, tests/ar/drivers/test_ros_panda.py.
"""

import sys
import time
from collections.abc import Iterator
from contextlib import contextmanager
from dataclasses import dataclass
from pathlib import Path
from typing import NamedTuple

import numpy as np

from qualification.command import qualify
from trunkline.ar.preview.package import Package, read_package
from trunkline.ar.preview.world_model import make_world
from trunkline.ar.session import preview_process
from trunkline.ar.session.composition import SEARCH, obstacles, simulation_of, subject_of
from trunkline.ar.session.log_reader import tip_path
from trunkline.ar.session.preview_process import PreviewProcess
from trunkline.ar.session.previewer import Answer, Order, PlanAnswer, PreviewBegun, PreviewPiece
from trunkline.ar.session.settings import SessionConfig
from trunkline.ar.session.simulated import Simulation, TwinPlant
from trunkline.ar.teleop.config import TeleoperationConfig as Teleop
from trunkline.ar.teleop.executor import PlanFollower
from trunkline.ar.teleop.messages import Request, Target, Targets, Vector, World
from trunkline.ar.teleop.plan import Plan
from trunkline.ar.teleop.rigid_ik import RigidIK
from trunkline.ar.teleop.vectors import DOWN
from trunkline.errors import InputError
from trunkline.pipeline.config import PROJECT, load_folder

PLANS, MOST = 12, 100  # that are previewed, and places that are tried for them
ENOUGH = 3.6  # s of a preview
AROUND, HEADING = (0.15, 0.3, 0.1), 0.5  # m of mounts about the first, rad
PULLS, LOOSE = (0.03, 0.12), 0.2  # m by which the first cable is pulled, and the others paid out
COMES, POLLED = 600.0, 0.001  # s that the process may take, and after which it is looked whether it has answered
PUSHED = 2e-3  # m by which an object has moved that was pushed; on its string it never rests


class Row(NamedTuple):
    what: str
    found: str
    goal: str


@dataclass(frozen=True)
class Previewed:
    """A plan and its preview: `poses` (F, N, 7) of bodies at `times` (F,), s of the plan. first, whole: s from the plan
    until the first piece and all were there; enough: until ENOUGH s were, NaN of a shorter one."""

    plan: Plan
    times: np.ndarray
    poses: np.ndarray
    first: float
    enough: float
    whole: float


def rows(path: Path) -> list[Row]:
    teleop, config = load_folder(Teleop, PROJECT / "conf/teleop"), load_folder(SessionConfig, PROJECT / "conf/live")
    package = read_package(path)
    joints = RigidIK(teleop.mount_offset).solve(SEARCH, config.ready, DOWN, 0.0)
    simulation = simulation_of(package, teleop, config, joints)
    world = make_world(obstacles(config), () if config.object is None else (config.object,))
    with planning(path, teleop, config, simulation, world) as process:
        found = list(previews(process, package, config, simulation, world))
    first, enough, whole = np.array([(one.first, one.enough, one.whole) for one in found]).T
    duration, long = np.array([one.times[-1] for one in found]), np.isfinite(enough)
    apart: dict[bool, list[np.ndarray]] = {False: [], True: []}
    for one in found:
        off, pushed = distances(one, simulation)
        apart[pushed].append(off)
    return [
        Row(f"first piece of a preview after its plan, {len(found)} plans", _told(first, 1e3, "ms"), "≤ 150 ms"),
        Row(f"… {ENOUGH:g} s of preview, of the {long.sum()} that are so long", _told(enough[long], 1, "s"), "≤ 1.5 s"),
        Row(f"… the whole preview, of {duration.min():.1f} to {duration.max():.1f} s", _told(whole, 1, "s"), "none"),
        _apart("preview against the simulated robot, tip", apart[False], "≤ 1 mm"),
        _apart("… where the arm pushes what hangs in its way", apart[True], "none"),
    ]


def _apart(what: str, found: list[np.ndarray], goal: str) -> Row:
    """Distances of plans, m."""
    frames = np.concatenate([np.empty(0), *found])
    return Row(f"{what}, {len(found)} plans, {len(frames)} frames", _told(frames, 1e3, "mm"), goal)


def _told(values: np.ndarray, scale: float, unit: str) -> str:
    if not len(values):
        return "none"
    return f"{scale * np.median(values):.3g} {unit} median, {scale * values.max():.3g} {unit} worst"


@contextmanager
def planning(
    path: Path, teleop: Teleop, config: SessionConfig, simulation: Simulation, world: World
) -> Iterator[PreviewProcess]:
    """The process once it is ready."""
    setup = path.resolve(), teleop, config.preview, simulation.bodies, world
    process = PreviewProcess(preview_process.run, setup)
    try:
        if not process.ready.wait(COMES):
            raise InputError(f"the process that plans: not ready after {COMES:g} s")
        yield process
    finally:
        process.close()


def previews(
    process: PreviewProcess, package: Package, config: SessionConfig, simulation: Simulation, world: World
) -> Iterator[Previewed]:
    """PLANS of them, of places at random; those that are refused are left out."""
    rng, made = np.random.default_rng(0), 0
    for serial in range(1, MOST + 1):
        targets = _targets(rng, package, config.ready)
        request = Request(serial, targets, world.digest, package.digest)
        process.submit(Order(request, world, simulation.joints, simulation.commands))
        found = _await_preview(process, serial)
        if found is not None:
            made += 1
            yield found
        if made == PLANS:
            return
    raise InputError(f"plans: found {made} of {MOST} places that are not refused, expected {PLANS}")


def _targets(rng: np.random.Generator, package: Package, ready: Vector) -> Targets:
    """The mount near where it is `ready`, the tip where the first cable leads it."""
    x, y, z = (float(value) for value in np.array(ready) + rng.uniform(-1, 1, 3) * AROUND)
    mount, straight = Target((x, y, z)), package.straight
    targets = Targets(mount, mount, DOWN, float(rng.uniform(-HEADING, HEADING)), 0, 0.0)
    pulled = straight + np.where(np.arange(len(straight)) == 0, -rng.uniform(*PULLS), LOOSE)
    a, b, c = (float(value) for value in package.tip((x, y, z), targets, pulled))
    return Targets(mount, Target((a, b, c)), DOWN, targets.heading, 0, 0.0)


def _answers(process: PreviewProcess) -> Iterator[tuple[float, Answer | None]]:
    """Each with the time at which it came, s."""
    until = time.monotonic() + COMES
    while (now := time.monotonic()) < until:
        yield from ((now, answer) for answer in process.poll())
        time.sleep(POLLED)
    raise InputError(f"the process that plans: no answer within {COMES:g} s")


def _await_preview(process: PreviewProcess, serial: int) -> Previewed | None:
    """The answers to order `serial`, those to the one before left out; None where it is refused."""
    plan, step, began, pieces = None, 0.0, 0.0, []
    for at, answer in _answers(process):
        if answer is None:
            raise InputError("the process that plans: it has ended")
        if (answer.report.serial if isinstance(answer, PlanAnswer) else answer.serial) != serial:
            continue
        if isinstance(answer, PlanAnswer):
            plan, began = answer.plan, at
            if plan is None:
                return None
        elif isinstance(answer, PreviewBegun):
            step = answer.preview.step
        elif isinstance(answer, PreviewPiece):
            pieces.append((at - began, answer))
            if answer.last:
                break
    assert plan is not None
    times = np.concatenate([one.time + step * np.arange(len(one.poses)) for _, one in pieces])
    there = [after for after, one in pieces if one.time + step * len(one.poses) >= ENOUGH]
    poses = np.concatenate([one.poses for _, one in pieces])
    return Previewed(plan, times, poses, pieces[0][0], min(there, default=np.nan), pieces[-1][0])


def distances(found: Previewed, simulation: Simulation) -> tuple[np.ndarray, bool]:
    """Of the tip from where the preview has it, m (F,), once the simulated robot runs the plan; whether it pushed the
    object."""
    plant = TwinPlant(simulation)
    robot = PlanFollower(
        simulation.joints, simulation.commands, simulation.limits, simulation.package,
        lambda joints, commands, _: plant.move(joints, commands, smooth=True),
    )  # fmt: skip
    if refused := robot.start(found.plan, found.plan.digest()):
        raise InputError(refused)
    body, place = subject_of(simulation).tip
    row, times, poses, objects = simulation.bodies.index(body), [0.0], [plant.poses()], [plant.object()]
    until = found.times + simulation.twin.model.opt.timestep  # of the step that ends with a frame
    while times[-1] < until[-1]:
        robot.advance(plant.tick)
        times.append(times[-1] + plant.tick)
        poses.append(plant.poses())
        objects.append(plant.object())
    tip = tip_path(np.array(poses)[:, row], place)
    there = np.stack([np.interp(until, times, axis) for axis in tip.T], axis=1)
    pushed = bool((np.ptp(np.array(objects)[:, :3], axis=0) > PUSHED).any())
    return np.linalg.norm(there - tip_path(found.poses[:, row].astype(float), place), axis=1), pushed


def main(package: Path) -> None:
    print("| what | found | goal |\n|---|---:|---:|", flush=True)
    for row in rows(package):
        print(f"| {' | '.join(row)} |", flush=True)


if __name__ == "__main__":
    sys.exit(qualify("acceptance", __doc__, main))
