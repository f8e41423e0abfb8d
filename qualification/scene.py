"""A session whose server is a process of its own, and who controls it."""

import asyncio
import contextlib
import functools
import multiprocessing
import os
import signal
import time
from collections.abc import Iterator
from dataclasses import dataclass, field
from multiprocessing.connection import Connection
from multiprocessing.process import BaseProcess
from pathlib import Path

from qualification.guests import ADDRESS
from qualification.operator import PATIENCE, OperatorProcess
from qualification.witness import Watched, Witness, machine
from trunkline.ar.drivers.settings import read_execution_config
from trunkline.ar.drivers.simulated_motors import SIMULATED
from trunkline.ar.session import hardware_process, robot_process
from trunkline.ar.session.hardware import hardware_of
from trunkline.ar.session.serving import opened
from trunkline.errors import InputError

ENDS = 20.0  # s that a session has to end


@dataclass(frozen=True)
class Told:
    """Of a session that is ready: the pids of its robot, its log's process and the one that plans, and the log."""

    token: str
    robot: int
    journal: int
    planner: int
    log: Path


@dataclass
class SessionProcess:
    """A session that runs. lines: what its server says, with the time, s."""

    server: BaseProcess
    told: Told
    witness: Witness
    pipe: Connection
    lines: list[tuple[float, str]] = field(default_factory=list)

    def signal(self, number: int) -> None:
        """Of the server alone."""
        assert self.server.pid is not None
        os.kill(self.server.pid, number)

    def listen(self) -> None:
        """Take in what the server said since."""
        with contextlib.suppress(EOFError, OSError):  # it was killed
            while self.pipe.poll():
                self.lines.append(self.pipe.recv())


@dataclass
class OperatedSession(SessionProcess):
    """A session in which something is done, with who controls it."""

    operator: OperatorProcess = field(kw_only=True)

    def renew(self) -> None:
        """Another client comes, and takes the grips."""
        self.operator.close()
        self.operator = OperatorProcess(self.told.token, "grip")


@contextlib.contextmanager
def staged(package: Path, motors: bool, word: str = "") -> Iterator[OperatedSession]:
    """A session whose operator is told `word` from the beginning; `motors` as of `running`."""
    with running(package, motors) as session:
        scene = OperatedSession(**vars(session), operator=OperatorProcess(session.told.token, word))
        try:
            yield scene
        finally:
            scene.operator.close()
            scene.listen()


@contextlib.contextmanager
def running(package: Path, motors: bool = False) -> Iterator[SessionProcess]:
    """A session on the simulated robot; with `motors`, on the bus of simulated ones.

    Raises:
        InputError: it ends before it begins.
    """
    context = multiprocessing.get_context("spawn")
    witness, (pipe, theirs) = context.RawValue(Witness), context.Pipe()
    server = context.Process(target=serve, args=(theirs, witness, package, motors), name="server")
    server.start()
    theirs.close()
    lines: list[tuple[float, str]] = []
    try:
        while not isinstance(told := _received(pipe), Told):
            lines.append(told)
        yield SessionProcess(server, told, witness, pipe, lines)
    finally:
        pipe.close()
        server.join(ENDS)
        server.kill()
        server.join()


def _received(pipe: Connection) -> Told | tuple[float, str]:
    try:
        if pipe.poll(PATIENCE):
            return pipe.recv()
    except EOFError:
        pass
    raise InputError("the session has ended before it began")


def serve(pipe: Connection, witness: Witness, package: Path, motors: bool) -> None:
    """The process of a session: until the other end of `pipe` is closed. All in it is as it is served, but that the
    robot's process tells the witness too, and that its bank, if it has one, has a motor that can be silent."""
    signal.signal(signal.SIGINT, signal.SIG_IGN)
    robot_process.RobotChannel, hardware_process.run = functools.partial(Watched, witness=witness), machine
    hardware_process.RobotChannel = functools.partial(Watched, witness=None)  # the twin's, of another name
    asyncio.run(_serve(pipe, package, motors))


async def _serve(pipe: Connection, package: Path, motors: bool) -> None:
    def say(line: str) -> None:
        with contextlib.suppress(OSError):  # it says how its end goes to nobody
            pipe.send((time.monotonic(), line))

    execution = read_execution_config()
    hardware = hardware_of("simulated", "gm6020", SIMULATED, "", execution) if motors else None
    async with opened(package, ADDRESS, say, hardware) as (server, made):
        assert made.robot.pid is not None
        assert made.log_writer.pid is not None
        assert made.previewer.pid is not None
        pids = made.robot.pid, made.log_writer.pid, made.previewer.pid
        pipe.send(Told(server.composition.token, *pids, made.log_writer.path))
        with contextlib.suppress(EOFError, OSError):
            await asyncio.to_thread(pipe.recv)
