"""franka-sim, in its own environment, and simulated motors on a virtual bus, as a live session takes them."""

import asyncio
import contextlib
import os
import signal
import tempfile
from collections.abc import AsyncIterator
from dataclasses import replace
from pathlib import Path

import numpy as np

from trunkline.ar.drivers.realtime_priority import URGENT
from trunkline.ar.drivers.settings import ExecutionConfig
from trunkline.ar.drivers.simulated_motors import SIMULATED
from trunkline.ar.session.hardware import Hardware, hardware_of
from trunkline.errors import InputError
from trunkline.pipeline.config import PROJECT, load_folder

ADDRESS, PORT = "127.0.0.1", 1337  # franka-sim listens to every address: give it a network of its own
COMES = 30.0  # s
FIRST = str(URGENT + 1)  # of SCHED_FIFO: a robot's own computer does nothing else
# A command that comes late is dropped, as a robot does (libfranka, "Network requirements"); franka-sim takes it.
SERVER = """
import sys
import franka_sim.mujoco_franka_sim as simulator
simulator.ARM_INITIAL_Q[:] = [float(word) for word in sys.argv.pop().split()]
from franka_sim.franka_sim_server import FrankaSimServer
from franka_sim.run_server import main
take = FrankaSimServer._absorb_within_motion_limits
FrankaSimServer._absorb_within_motion_limits = lambda self, sent, *, fresh: fresh and take(self, sent, fresh=True)
main()
"""


def hardware(python: Path) -> Hardware:
    """An FR3 at ADDRESS, by the library in the environment of `python`, and motors on the bus of simulated ones."""
    config = load_folder(ExecutionConfig, PROJECT / "conf/execution")
    arm = replace(config.arm, python=str(python), address=ADDRESS)
    found = hardware_of("fr3", "gm6020", SIMULATED, "", replace(config, arm=arm))
    assert found is not None
    return found


@contextlib.asynccontextmanager
async def franka_sim(python: Path, ready: np.ndarray) -> AsyncIterator[None]:
    """A server whose robot stands at `ready` (7,), rad, its limits of motion and of lost packets enforced.

    Raises:
        InputError: it does not come.
    """
    with tempfile.TemporaryDirectory(ignore_cleanup_errors=True) as folder:
        model = Path(folder) / "fr3.xml"
        maker = await asyncio.create_subprocess_exec(str(python), "examples/franka_model.py", str(model))
        if await maker.wait():
            raise InputError(f"{python}: found no franka-sim, expected it installed there")
        with open(Path(folder) / "log", "wb") as log:
            server = await asyncio.create_subprocess_exec(
                "chrt", "--fifo", FIRST, str(python), "-c", SERVER, "--no-gripper", "--enforce-motion-limits",
                "--enforce-comm-constraints", " ".join(map(str, ready)), env={**os.environ, "FR3_MJCF": str(model)},
                stdout=log, stderr=log, start_new_session=True,
            )  # fmt: skip
        try:
            await _listens(server)
            yield
        finally:
            with contextlib.suppress(ProcessLookupError):
                os.killpg(server.pid, signal.SIGKILL)
            await server.wait()


async def _listens(server) -> None:
    for _ in range(round(COMES / 0.1)):
        if server.returncode is not None:
            raise InputError(f"franka-sim: ended with {server.returncode} before it listened")
        with contextlib.suppress(OSError):
            _, writer = await asyncio.open_connection(ADDRESS, PORT)
            writer.close()
            return
        await asyncio.sleep(0.1)
    raise InputError(f"franka-sim: does not listen on {ADDRESS}:{PORT} after {COMES:.0f} s")
