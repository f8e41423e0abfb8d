"""A live session for hours: whether its server's memory grows, a lease is lost, or a stop is missed.

    python -m qualification.soak [PACKAGE] [--hours 8]

Server, core, sockets and messages are the real ones; the robot is where its plan says, and a plan is a move of one
joint that is there at once. The session's clock is the server's alone and goes on as soon as an input has been heard,
so that hours pass in minutes and no pause of this machine counts. One client controls and goes through aim, preview,
confirmation and execution, over and over; now and then it gives the lease to the next who has come. Others come, watch
and leave; each stops the robot once.
"""

import asyncio
import gc
import resource
import sys
import time
from collections import Counter
from collections.abc import Iterator
from pathlib import Path

import numpy as np
from aiohttp import ClientSession

from qualification.command import qualify
from qualification.guests import ADDRESS, HZ, RIGID, SEEN, TIP, Guest, Hands, hands_at, knock, until
from trunkline.ar.preview.package import Package, read_package
from trunkline.ar.preview.world_model import make_world
from trunkline.ar.session import messages
from trunkline.ar.session.auth import make_token
from trunkline.ar.session.composition import SEARCH
from trunkline.ar.session.controller import SessionController
from trunkline.ar.session.previewer import (
    Answer,
    AnyOrder,
    InlinePreviewer,
    Order,
    PlanAnswer,
    PredictionAnswer,
    PreviewBegun,
    PreviewPiece,
)
from trunkline.ar.session.robot_process import RobotState
from trunkline.ar.session.server import Composition, Server
from trunkline.ar.session.serving import listening
from trunkline.ar.teleop.config import TeleoperationConfig as Teleop
from trunkline.ar.teleop.core import Teleoperation
from trunkline.ar.teleop.executor import PlanFollower
from trunkline.ar.teleop.following import Following
from trunkline.ar.teleop.messages import ExecutorReport, PlanReport
from trunkline.ar.teleop.plan import Plan
from trunkline.ar.teleop.trajectory import JOINTS, gentle, limits_of
from trunkline.pipeline.config import PROJECT, load_folder

BODIES = 26
VISIT, STAY, HAND_OVER = 20.0, 8.0, 300.0  # s between visitors, of a visit, between hand-overs of the lease
EARLY = 0.05  # share of the time after which memory is first looked at


class ScriptedRobot:
    """Where its plan says, by the session's clock."""

    def __init__(self, package: Package, teleop: Teleop) -> None:
        self.limits = limits_of(teleop.motors, package.rate_limit, len(package.straight))
        self.robot = PlanFollower(SEARCH, package.straight, self.limits, package.digest)
        self.start, self.hear, self.now, self.stops = self.robot.start, self.robot.hear, 0.0, 0

    def follow(self, following: Following) -> str:
        return "follow: not here"

    def permit(self, waits: bool = False) -> None:
        pass

    def stop(self) -> None:
        self.stops += 1
        self.robot.stop()

    def state(self) -> ExecutorReport:
        return self.robot.state()

    def robot_state(self) -> RobotState:
        bodies = np.tile([0.1, 0.2, 0.3, 1.0, 0.0, 0.0, 0.0], (BODIES, 1))
        return RobotState(self.now, 0.0, self.robot.joints, self.robot.commands, np.full(7, np.nan), bodies)


class Planning:
    """The first joint to one side and back again; previewed by two pieces."""

    def __init__(self, robot: ScriptedRobot) -> None:
        self.robot, self.limits, self.made = robot.robot, robot.limits, 0

    def answers(self, order: AnyOrder) -> Iterator[Answer]:
        assert isinstance(order, Order)
        request, robot = order.request, self.robot
        self.made += 1
        here = np.append(robot.joints, robot.commands)
        there = np.append(SEARCH, robot.commands) + np.eye(len(here))[0] * (0.2 if self.made % 2 else 0.0)
        rows = gentle(here, there, self.limits, 0.01)
        plan = Plan(0.01, rows[:, :JOINTS], rows[:, JOINTS:], (("approach", 0),), request.package, request.world)
        digest, poses = plan.digest(), np.zeros((15, BODIES, 7), dtype=np.float32)
        told = messages.PredictionMessage(digest, None, None, None, (0.0,), ((0.0, 0.0, 0.0),), (0.0,), 0.9, 12)
        yield PlanAnswer(PlanReport(request.serial, digest, "", plan.package, plan.world), plan)
        yield PreviewBegun(request.serial, messages.PreviewMessage(digest, 0.02, 0.3, 0.02, (("approach", 0.0),)))
        yield PreviewPiece(request.serial, 0, 0.02, poses, False)
        yield PreviewPiece(request.serial, 15, 0.32, poses, True)
        yield PredictionAnswer(request.serial, told)


class Stepped(Server):
    """A server whose clock is another's; it counts inputs and stops that were heard."""

    inputs, stopped = 0, 0

    def _input(self, client, received, now: float) -> None:
        super()._input(client, received, now)
        self.inputs += 1

    def _heed(self, client, received) -> None:
        super()._heed(client, received)
        self.stopped += received.kind == "stop"

    async def _run(self) -> None:
        await asyncio.Event().wait()


async def session(package: Package, hours: float) -> None:
    teleop = load_folder(Teleop, PROJECT / "conf/teleop")
    robot, clock, said = ScriptedRobot(package, teleop), [0.0], Counter()
    planning = Planning(robot)
    core = Teleoperation(teleop.core, package.reach, package.digest, teleop.mount_offset)
    previewer, token = InlinePreviewer(planning.answers), make_token()
    controller = SessionController(core, robot, previewer, make_world(()), teleop.handling.lift)

    def log(line: str) -> None:
        said["silent"] += line.endswith("was silent")
        said["error"] += line.startswith("error:")

    scene = {"bodies": [f"b{n}" for n in range(BODIES)]}
    house = Composition(controller, token, ADDRESS.origins, package.digest, scene, None, HZ, Path("nowhere"), log)
    server = Stepped(house, lambda: clock[0])
    began = time.monotonic()
    async with listening(server, ADDRESS), ClientSession() as sockets:

        async def come() -> Guest:
            guest = await knock(sockets, ADDRESS.url, lambda: clock[0])
            await guest.greet(token)
            return guest

        async def wait_for(happens) -> None:
            await until(happens, 10.0, f"after {clock[0]:.1f} s of the session", 0.0)

        async def control(guest: Guest) -> None:
            await guest.say(type="lease", action="ask")
            await wait_for(lambda: server.lease.holder == guest.told["welcome"]["id"])

        guest, hands, visitors = await come(), Hands(), []
        await control(guest)
        found = Counter(visits=1)
        ticks, memory = round(3600 * hours * HZ), 0
        for tick in range(ticks):
            now = clock[0] = robot.now = (tick + 1) / HZ
            robot.robot.advance(1 / HZ)
            held, before = await hands.move(guest, now), server.inputs
            await guest.send("input", hands_at(RIGID, TIP, held), SEEN, 2)
            await wait_for(lambda before=before: server.inputs > before)
            server.step()
            if tick % round(VISIT * HZ) == 0:
                visitors.append((now, await come()))
                found["visits"] += 1
            if visitors and now > visitors[0][0] + STAY:
                stopped, stops = server.stopped, robot.stops
                await visitors[0][1].send("stop")
                await wait_for(lambda stopped=stopped: server.stopped > stopped)
                found["stops"] += 1
                found["missed"] += robot.stops == stops
                if now // HAND_OVER > found["given"]:
                    await guest.say(type="lease", action="give", to=visitors[0][1].told["welcome"]["id"])
                    await wait_for(lambda: server.lease.holder == visitors[0][1].told["welcome"]["id"])
                    await guest.leave()
                    guest, found["given"] = visitors.pop(0)[1], int(now // HAND_OVER)
                    found["hand-overs"] += 1
                else:
                    await visitors.pop(0)[1].leave()
            if tick == round(EARLY * ticks):
                memory = resident()
    grown = resident() / memory - 1
    passed = time.monotonic() - began
    print(
        f"{hours:g} h of input at {HZ:g} Hz in {passed / 60:.1f} min ({3600 * hours / passed:.0f} times as fast):"
        f" {hands.cycles} cycles from aim to a robot that has arrived, {planning.made} plans,"
        f" {found['visits']} clients, {found['hand-overs']} hand-overs"
    )
    print(
        f"memory {100 * grown:+.1f} % since {100 * EARLY:.0f} % of the time, {said['silent']} leases lost,"
        f" {found['missed']} of {found['stops']} stops missed, {said['error']} errors"
    )


def resident() -> int:
    """Bytes of memory that this process has."""
    gc.collect()
    return int(Path("/proc/self/statm").read_text().split()[1]) * resource.getpagesize()


def main(package: Path, hours: float) -> None:
    asyncio.run(session(read_package(package), hours))


if __name__ == "__main__":
    sys.exit(qualify("soak", __doc__, main, hours=8.0))
