"""Is a libmujoco for 64-bit Arm what a Quest needs, and does it move the calibrated arm as this machine's does?

    python -m benchmarks.arm64                             # the one in MuJoCo's own wheel for Linux on Arm
    python -m benchmarks.arm64 --library libmujoco.so      # one that was built for Android

What a file is, readelf of Debian's binutils-aarch64-linux-gnu says. If gcc-aarch64-linux-gnu and qemu-user are there, a
program of benchmarks/arm64.c steps `calibrated.xml` with the library, emulated; one for Android is not run, as its C
library is not Linux's. Nothing is measured of an Arm processor's speed.
"""

import argparse
import json
import re
import shutil
import subprocess
import sys
import tempfile
import zipfile
from pathlib import Path

import mujoco
import numpy as np

from trunkline.errors import InputError, in_one_line
from trunkline.pipeline.config import PROJECT
from trunkline.pipeline.results import recorded
from trunkline.unity.package import CALIBRATED, read_tarball

SOURCE = PROJECT / "benchmarks/arm64.c"
VECTORS = "Tests/Vectors/network.json"
SECONDS = 2.0  # of simulation, in the midst of the swing
READELF, COMPILER, EMULATOR = "aarch64-linux-gnu-readelf", "aarch64-linux-gnu-gcc", "qemu-aarch64"
PLATFORM = "manylinux_2_28_aarch64"


def run(*command: str | Path) -> str:
    """What a command prints.

    Raises:
        InputError: it is not there, or its complaint's last line.
    """
    if shutil.which(str(command[0])) is None:
        raise InputError(f"{command[0]}: no such program; Debian's gcc-aarch64-linux-gnu and qemu-user have them")
    done = subprocess.run(list(map(str, command)), capture_output=True, text=True, check=False)
    if done.returncode:
        raise InputError(f"{command[0]}: found {(done.stderr.strip().splitlines() or ['no word'])[-1]}")
    return done.stdout


def of_the_wheel(folder: Path) -> Path:
    """The library of MuJoCo's wheel for Linux on Arm, of the version that is installed here."""
    command = [sys.executable, "-m", "pip", "download", "-q", "--no-deps", "--only-binary=:all:", "-d", folder]
    run(*command, "--platform", PLATFORM, f"mujoco-core=={mujoco.__version__}")
    with zipfile.ZipFile(next(folder.glob("*.whl"))) as wheel:
        wheel.extractall(folder)
    return next(folder.rglob("libmujoco.so*"))


def what_it_is(library: Path) -> dict[str, str]:
    """Machine, C library, and whether `mj_step` can be called."""
    header, dynamic = run(READELF, "-hW", library), run(READELF, "-dW", library)
    symbols = run(READELF, "--dyn-syms", "-W", library)
    machine = re.findall(r"Machine:\s+(.*)", header)
    needed = re.findall(r"\(NEEDED\).*\[(.*)\]", dynamic)
    runtime = "Android" if "libc.so" in needed else "Linux" if "libc.so.6" in needed else "none"
    exported = bool(re.search(r"FUNC\s+GLOBAL\s+\w+\s+\d+ mj_step(@@\S+)?$", symbols, re.MULTILINE))
    return {
        "machine": machine[0].strip() if machine else "unknown",
        "C library of": runtime,
        "`mj_step` exported": "yes" if exported else "no",
    }


def tips(library: Path, package: Path, folder: Path) -> tuple[np.ndarray, np.ndarray]:
    """Of the calibrated arm after SECONDS: by the library, emulated, and by this machine's MuJoCo, m (3,)."""
    files = read_tarball(package)
    (folder / "arm.xml").write_bytes(files[CALIBRATED])
    case = next(one for one in json.loads(files[VECTORS])["cases"] if not one["answer"]["doubtful"])
    commands = case["answer"]["commands"]
    include, program = Path(mujoco.HEADERS_DIR).parent, folder / "step"
    run(COMPILER, "-O2", SOURCE, f"-I{include}", library, "-Wl,--allow-shlib-undefined", "-o", program)
    paths = f"LD_LIBRARY_PATH={library.parent}:{next(iter(library.parents[1].glob('*.libs')), library.parent)}"
    given = [folder / "arm.xml", str(SECONDS), *map(str, commands)]
    said = run(EMULATOR, "-L", "/usr/aarch64-linux-gnu", "-E", paths, program, *given)
    model = mujoco.MjModel.from_xml_path(str(folder / "arm.xml"))
    data = mujoco.MjData(model)
    data.ctrl = commands
    while data.time < SECONDS:
        mujoco.mj_step(model, data)
    return np.array(said.split()[1:], dtype=float), data.site("tip").xpos.copy()


def show(library: Path, package: Path | None, folder: Path) -> None:
    found = what_it_is(library)
    print(f"MuJoCo {mujoco.__version__}, {library.name}")
    print("| of the library | found |")
    print("|---|---|")
    for name, value in found.items():
        print(f"| {name} | {value} |")
    if found["machine"] != "AArch64" or found["`mj_step` exported"] != "yes":
        raise InputError(f"{library}: found {found}, expected an AArch64 library with mj_step")
    if found["C library of"] == "Linux" and package is not None:
        emulated, here = tips(library, package, folder)
        print(f"| tip after {SECONDS:g} s, from this machine's | {1e3 * np.linalg.norm(emulated - here):.2g} mm |")


@in_one_line
def main() -> int:
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("--library", type=Path)
    given = parser.parse_args().library
    package = next(iter(sorted((PROJECT / "artifacts/package_unity").glob("*.tgz"))), None)
    with tempfile.TemporaryDirectory() as folder, recorded("arm64", keep=given is None):
        show(given or of_the_wheel(Path(folder)), package, Path(folder))
    return 0


if __name__ == "__main__":
    sys.exit(main())
