"""Is a libmujoco for 64-bit Arm what a Quest needs, and does it move the calibrated arm as this machine's does?

    python -m benchmarks.arm64                             # the one in MuJoCo's own wheel for Linux on Arm
    python -m benchmarks.arm64 --library libmujoco.so      # one that was built for Android

What a file is, readelf of Debian's binutils-aarch64-linux-gnu says. A program of benchmarks/arm64.c then steps the
package's `arm.xml` with the library, emulated by qemu-user; one for Android is not run, as its C library is not
Linux's. Nothing is measured of an Arm processor's speed.
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
from trunkline.twin.package import MANIFEST, read_tarball
from trunkline.unity.upm_package import MODEL
from upkeep.results import recorded

SOURCE = PROJECT / "benchmarks/arm64.c"
VECTORS = "Tests/Vectors/network.json"
SECONDS = 2.0  # of simulation, in the midst of the swing
PLATFORM = "manylinux_2_28_aarch64"
TARGET = "aarch64-linux-gnu"
READELF, COMPILER, EMULATOR = f"{TARGET}-readelf", f"{TARGET}-gcc", "qemu-aarch64"


def run(*command: str | Path) -> str:
    """What a command prints.

    Raises:
        InputError: it is not there, or its complaint's last line.
    """
    if shutil.which(str(command[0])) is None:
        raise InputError(f"{command[0]}: no such program; Debian has it: see {Path(__file__).name}")
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


def tips(library: Path, include: Path, package: Path, folder: Path) -> tuple[str, np.ndarray, np.ndarray]:
    """Of the imported arm after SECONDS: the library's version, and the tip by it, emulated, and by this machine's
    MuJoCo, m (3,)."""
    files = read_tarball(package)
    (folder / "arm.xml").write_bytes(files[MODEL])
    case = next(one for one in json.loads(files[VECTORS])["cases"] if not one["answer"]["doubtful"])
    straight = json.loads(files[MANIFEST])["model"]["rest_lengths"].values()
    pulls = [length - command for length, command in zip(straight, case["answer"]["commands"], strict=True)]
    program = folder / "step"
    run(COMPILER, "-O2", SOURCE, f"-I{include}", library, "-Wl,--allow-shlib-undefined", "-o", program)
    paths = f"LD_LIBRARY_PATH={library.parent}:{next(iter(library.parents[1].glob('*.libs')), library.parent)}"
    given = [folder / "arm.xml", str(SECONDS), *map(str, pulls)]
    number, *tip = run(EMULATOR, "-L", f"/usr/{TARGET}", "-E", paths, program, *given).split()
    model = mujoco.MjModel.from_xml_path(str(folder / "arm.xml"))
    data = mujoco.MjData(model)
    data.ctrl = pulls
    while data.time < SECONDS:
        mujoco.mj_step(model, data)
    return number, np.array(tip, dtype=float), data.site("tip").xpos.copy()


def show(library: Path, include: Path, package: Path | None, folder: Path) -> None:
    """Args: include: the folder that has the library's own `mujoco/mujoco.h`."""
    found = what_it_is(library)
    print("| of the library | found |")
    print("|---|---|")
    for name, value in found.items():
        print(f"| {name} | {value} |")
    if found["machine"] != "AArch64" or found["`mj_step` exported"] != "yes":
        raise InputError(f"{library}: found {found}, expected an AArch64 library with mj_step")
    if found["C library of"] == "Linux" and package is not None:
        number, emulated, here = tips(library, include, package, folder)
        apart = 1e3 * np.linalg.norm(emulated - here)
        print(f"| MuJoCo | {number} |")
        print(f"| tip after {SECONDS:g} s, from that of this machine's MuJoCo {mujoco.__version__} | {apart:.2g} mm |")


@in_one_line
def main() -> int:
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("--library", type=Path)
    library = parser.parse_args().library
    package = next(iter(sorted((PROJECT / "artifacts/package_unity").glob("*.tgz"))), None)
    with tempfile.TemporaryDirectory() as temporary:
        folder, include = Path(temporary), Path(mujoco.HEADERS_DIR).parent
        with recorded("arm64", keep=library is None):
            show(library or of_the_wheel(folder), include, package, folder)
    return 0


if __name__ == "__main__":
    sys.exit(main())
