"""The package's C# that needs Unity: every assembly compiles against stubs of Unity, MuJoCo's plug-in, the inference
engine and NUnit, by its own definition; components, menu entry and sample run against them, and answer as Python does.

The stubs (`stubs/`) have the signatures that are used. `stubs/signatures.yaml` lists those of MuJoCo's plug-in by
source file; set TRUNKLINE_MUJOCO to a checkout of google-deepmind/mujoco to compare them with it.
"""

import json
import os
import re
import shutil
import subprocess
from copy import deepcopy
from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest
import yaml
from pydantic import TypeAdapter
from scipy.spatial.transform import Rotation

from tests.support.folders import unpack
from tests.support.operator import config
from tests.unity.mono import compiled
from tests.unity.test_csharp import SHARED, bends, case, moved_a_little, said_by
from trunkline.ar.conformance.answers import PACKAGE
from trunkline.ar.session.registration import inverse
from trunkline.ar.teleop.core import Teleoperation
from trunkline.ar.teleop.messages import Controller, Input, Pose, to_json
from trunkline.ar.teleop.reach import MapReach
from trunkline.ar.teleop.vectors import about, conjugate, multiply
from trunkline.frames import wxyz_from_rotation
from trunkline.kinematics.reachability.triangles import nearest_on_triangles
from trunkline.kinematics.reachability.weights import spline_weights
from trunkline.kinematics.reachability.workspace_surface import surface_triangles
from trunkline.twin.package import MANIFEST, package_digest
from trunkline.unity.assemble import CSHARP
from trunkline.unity.unpacked import maps_of
from trunkline.unity.upm_package import SAMPLES, package_json

STUBS = Path(__file__).parent / "stubs"
LAYER = Path(__file__).parent / "layer"
SIGNATURES = yaml.safe_load((STUBS / "signatures.yaml").read_text())
# name of the assembly: its stub, and those that it refers to
STUBBED = {
    "UnityEngine": ("UnityEngine", []),
    "UnityEditor": ("UnityEditor", ["UnityEngine"]),
    "Mujoco.Runtime": ("Mujoco", ["UnityEngine"]),
    "Mujoco.Editor": ("MujocoEditor", ["UnityEngine", "Mujoco.Runtime"]),
    "Unity.InferenceEngine": ("InferenceEngine", ["UnityEngine"]),
    "nunit.framework": ("NUnit", []),
}
TEST_RUNNERS = ["UnityEngine.TestRunner", "UnityEditor.TestRunner"]  # of which nothing is used
PACKAGES = ["org.mujoco", "com.unity.ai.inference"]  # that a project may have, and the package's versionDefines ask for
EDITOR = ["UNITY_EDITOR", "UNITY_6000_0_OR_NEWER", "UNITY_INCLUDE_TESTS"]
DEFINITIONS = {json.loads(path.read_text())["name"]: path for path in sorted(CSHARP.rglob("*.asmdef"))}
CASES = 40
INPUT = TypeAdapter(Input)
RAY = about((1.0, 0.0, 0.0), np.pi / 2)  # from a hand of Unity's, ray ahead, to one of the core's, ray along -z


class Project:
    """A Unity project with some packages, as far as a compiler goes: its assemblies, in a folder. Of `stubs` that are
    compiled already, those that it has are copied."""

    def __init__(self, folder: Path, packages: list[str], stubs: dict[str, Path] | None = None) -> None:
        self.folder, self.packages = folder, packages
        hidden = [] if "org.mujoco" in packages else ["Mujoco.Runtime", "Mujoco.Editor"]
        hidden += [] if "com.unity.ai.inference" in packages else ["Unity.InferenceEngine"]
        self.assemblies = {
            name: Path(shutil.copy(path, folder)) for name, path in (stubs or {}).items() if name not in hidden
        }
        for name, (stub, references) in STUBBED.items():
            if name not in hidden and name not in self.assemblies:
                uses = [self.assemblies[reference] for reference in references]
                out, options = folder / f"{name}.dll", ["-unsafe", "-r:System.Xml.dll"]
                self.assemblies[name] = compiled(out, [STUBS / f"{stub}.cs"], uses, *options)
        for name in DEFINITIONS:
            self.build(name)

    def build(self, name: str) -> None:
        """One of the package's assemblies, after those that it refers to; nothing where Unity leaves it out."""
        if name in self.assemblies or name not in DEFINITIONS:
            return
        path = DEFINITIONS[name]
        definition = json.loads(path.read_text())
        defines = EDITOR + [
            reference["define"] for reference in definition["versionDefines"] if reference["name"] in self.packages
        ]
        if not set(definition["defineConstraints"]) <= set(defines):
            return
        references = list(definition["references"])
        if not definition["noEngineReferences"]:
            references += ["UnityEngine"] + ["UnityEditor"] * (definition["includePlatforms"] == ["Editor"])
        references += [reference.removesuffix(".dll") for reference in definition["precompiledReferences"]]
        for reference in references:
            self.build(reference)
        built = [self.assemblies[reference] for reference in references if reference in self.assemblies]
        options = ["-unsafe"] * definition["allowUnsafeCode"] + ["-noconfig"] * definition["noEngineReferences"]
        options += [f"-d:{define}" for define in defines]
        self.assemblies[name] = compiled(self.folder / f"{name}.dll", sources_of(path), built, *options)


def sources_of(definition: Path) -> list[Path]:
    """Scripts of an assembly: those of its folder and below, as far as no other definition lies nearer."""
    others = [path.parent for path in DEFINITIONS.values() if path != definition]
    below = [folder for folder in others if definition.parent in folder.parents]
    scripts = sorted(definition.parent.rglob("*.cs"))
    return [path for path in scripts if not any(folder in path.parents for folder in below)]


@pytest.fixture(scope="module")
def project(tmp_path_factory):
    return Project(tmp_path_factory.mktemp("project"), PACKAGES)


def test_every_assembly_compiles_where_all_packages_are_there(project):
    assert set(project.assemblies) == {*STUBBED, *DEFINITIONS}
    for path in DEFINITIONS.values():
        definition = json.loads(path.read_text())
        assert set(definition["references"]) <= {*STUBBED, *DEFINITIONS, *TEST_RUNNERS}, path


def test_every_script_is_of_one_assembly():
    scripts = [path for definition in DEFINITIONS.values() for path in sources_of(definition)]
    assert sorted(scripts) == sorted(CSHARP.rglob("*.cs"))


@pytest.mark.parametrize("package", PACKAGES)
def test_without_a_package_all_compiles_that_does_not_need_it(project, tmp_path, package):
    stubs = {name: project.assemblies[name] for name in STUBBED}
    left = Project(tmp_path, [name for name in PACKAGES if name != package], stubs).assemblies
    missing = {"org.mujoco": {"Trunkline"}, "com.unity.ai.inference": {"Trunkline.Inference"}}[package]
    samples = {name for name in DEFINITIONS if ".Samples." in name}
    assert set(DEFINITIONS) - set(left) == missing | samples
    if package == "org.mujoco":
        assert said_without_mujoco(tmp_path, left) == [
            "error: Trunkline: found no org.mujoco of 3.7.0 or later in the project, expected MuJoCo's own package"
        ]


def said_without_mujoco(folder: Path, assemblies: dict[str, Path]) -> list[str]:
    """What the menu entry tells the console."""
    program = folder / "Menu.cs"
    program.write_text(
        "class Menu { static void Main() { Trunkline.CreateTwin.Apply(); "
        "UnityEngine.Debug.Told.ForEach(System.Console.WriteLine); } }"
    )
    uses = [assemblies[name] for name in ("UnityEngine", "Trunkline.Editor")]
    done = subprocess.run(["mono", compiled(folder / "menu.exe", [program], uses)], capture_output=True, text=True)
    assert done.returncode == 0, done.stderr
    return done.stdout.splitlines()


# --- the components beside Python


@pytest.fixture(scope="module")
def layer(project):
    """The program that runs them."""
    sources = [*SHARED[:2], *sorted(LAYER.glob("*.cs"))]
    return compiled(project.folder / "layer.exe", sources, project.assemblies.values())


def run(program: Path, files: dict[str, bytes], cases: dict, folder: Path) -> subprocess.CompletedProcess:
    package = unpack(files, folder / "package")
    (folder / "cases.json").write_text(json.dumps(cases).replace("NaN", "null"))
    command = ["mono", str(program), str(package), str(folder / "cases.json")]
    return subprocess.run(command, capture_output=True, text=True)


def test_components_menu_and_sample_do_as_python(layer, files, tmp_path):
    asked = cases_of(files)
    done = run(layer, files, asked, tmp_path)
    assert done.returncode == 0, done.stdout + done.stderr
    counts = {line.split()[0]: int(line.split()[1]) for line in done.stdout.splitlines()}
    steps = sum(len(sequence["steps"]) for sequence in asked["sequences"])
    wanted = {"reach": len(asked["reach"]), "steps": steps, "bend": len(asked["bend"]), "refusals": 7}
    wanted["runner"] = len(files_of_vectors(files))
    assert wanted.items() <= counts.items()
    assert steps > 400
    assert counts["offers"] > 5
    assert counts["mounts"] > 20
    assert counts["touches"] == len(asked["touches"])


@pytest.fixture(scope="module")
def asked_of_plain(plain_answered) -> dict:
    return cases_of(plain_answered)


@pytest.mark.parametrize("part", ["reach", "sequences", "bend", "touches", "refusals"])
def test_an_answer_that_is_another_is_named(layer, plain_answered, asked_of_plain, tmp_path, part):
    asked = deepcopy(asked_of_plain)
    if part == "refusals":
        asked[part]["no maps"] += "."
    else:
        answers = [step["intent"] for item in asked[part] for step in item["steps"]] if part == "sequences" else [
            item["answer"] for item in asked[part]
        ]  # fmt: skip
        assert any(moved_a_little(item) for item in answers)
    done = run(layer, plain_answered, asked, tmp_path)
    assert done.returncode == 1
    assert done.stdout.splitlines()[-1].startswith("error: ")


def files_of_vectors(files: dict[str, bytes]) -> list[str]:
    return [path for path in files if path.startswith("Tests/Vectors/") and path.endswith(".json")]


def cases_of(files: dict[str, bytes]) -> dict:
    """Questions and Python's answers."""
    rng = np.random.default_rng(0)
    manifest = json.loads(files[MANIFEST])
    return {
        "reach": reaches(maps_of(files), rng), "sequences": sequences(files), "bend": bends(files, rng),
        "touches": [touches(rng, count) for count in (3, 3, 6)],
        "inputs": len(manifest["network"]["input_order"]), "refusals": refusals(manifest, maps_of(files)),
    }  # fmt: skip


def reaches(arrays: dict[str, np.ndarray], rng: np.random.Generator) -> list[dict]:
    """A body `base` turned in a scene under gravity from anywhere that the package knows, and tips around it."""
    if "sheets_points" not in arrays:
        return []
    points, downs, matrix = (arrays[f"sheets_{name}"] for name in ("points", "downs", "matrix"))
    triangles, cases = surface_triangles(*points.shape[1:3]), []
    while len(cases) < CASES:
        base, gravity = Rotation.random(random_state=int(rng.integers(9999))), rng.normal(size=3)
        down = base.inv().apply(gravity / np.linalg.norm(gravity))
        if down[2] > downs[:, 2].max():
            continue
        sheet = np.tensordot(spline_weights(matrix, downs, down), points.astype(float), 1).reshape(-1, 3)
        tip = rng.uniform([-0.3, -0.3, -0.5], [0.3, 0.3, 0.0])
        nearest, away = (rows[0] for rows in nearest_on_triangles(tip[None], sheet[triangles][None]))
        answer = {"signal": float(away - arrays["soft_tolerance"]), "nearest": nearest.tolist(),
                  "first": sheet[0].tolist(), "down": down.tolist()}  # fmt: skip
        question = {"base": wxyz_from_rotation(base).tolist(), "gravity": gravity.tolist(), "tip": tip.tolist()}
        cases.append(case(question, answer))
    return cases


def touches(rng: np.random.Generator, count: int) -> dict:
    """Places of a robot's base, and where they are in a scene in which that stands somewhere."""
    base, position = Rotation.random(random_state=int(rng.integers(9999))), rng.uniform(-1, 1, 3)
    points = rng.uniform(-0.5, 0.5, (count, 3))
    answer = {"position": position.tolist(), "ahead": base.apply([0.0, 1.0, 0.0]).tolist()}  # y is ahead in Unity's z
    return case({"known": points.tolist(), "touched": (base.apply(points) + position).tolist()}, answer)


def sequences(files: dict[str, bytes]) -> list[dict]:
    """The inputs of the shared vectors, as far as a scene can give them, and what the core wants then."""
    digest = package_digest(files)
    document = json.loads(files["Tests/Vectors/steps.json"].decode().replace(PACKAGE, digest))
    reach = MapReach.from_arrays(maps_of(files))
    core = Teleoperation(config().core, reach, digest, document["mount_offset"])
    return [
        played(core, sequence)
        for sequence in document["sequences"]
        if all(can_be_given(step["input"]) for step in sequence["steps"])
    ]


def can_be_given(heard: dict) -> bool:
    """Whether the base is somewhere."""
    alignment = heard["alignment"]
    numbers = [*alignment["position"], *alignment["quaternion"]] if alignment else [None]
    return None not in numbers and abs(np.linalg.norm(alignment["quaternion"]) - 1) < 1e-6


def played(core: Teleoperation, sequence: dict) -> dict:
    state, steps = core.start(), []
    for step in sequence["steps"]:
        message = as_in_a_scene(INPUT.validate_python(numbered(step["input"])))
        state, intent = core.step(state, message, number(step["dt"]))
        steps.append(step | {"intent": json.loads(to_json(intent))})
    return {"name": sequence["name"], "steps": steps}


def numbered(value):
    """With NaN for what is no number in JSON: among numbers."""
    if isinstance(value, list):
        numbers = any(isinstance(item, int | float) for item in value)
        return [float("nan") if item is None and numbers else numbered(item) for item in value]
    return {key: numbered(value) for key, value in value.items()} if isinstance(value, dict) else value


def number(value: float | None) -> float:
    return float("nan") if value is None else value


def as_in_a_scene(message: Input) -> Input:
    """What transforms of 32 bits keep of an input."""
    assert message.alignment is not None
    there = inverse(message.alignment)
    base = Pose(single(there.position), single(there.quaternion))
    return replace(message, left=as_a_hand(message.left), right=as_a_hand(message.right), alignment=inverse(base))


def as_a_hand(controller: Controller) -> Controller:
    turn = single(multiply(controller.quaternion, conjugate(RAY)))
    stick = single(controller.stick)
    return replace(controller, position=single(controller.position), quaternion=multiply(turn, RAY), stick=stick)


def single(values: tuple) -> tuple:
    """In 32 bits."""
    return tuple(float(np.float32(value)) for value in values)


def refusals(manifest: dict, arrays: dict[str, np.ndarray]) -> dict[str, str]:
    """One line each; the words are Python's where Python has the same case."""
    order, tendons = manifest["network"]["input_order"], manifest["network"]["output_order"]
    rigid = "Runtime/Reachability/rigid.bytes"
    reach = MapReach.from_arrays(arrays)
    return {
        "no number": said_by(lambda: reach.soft((float("nan"), 0.0, 0.0), (0.0, 0.0, -1.0))),
        "no file": f"Manifest File: found none, expected {MANIFEST}",
        "another file": f"{rigid}: found sha256 ae448ac86c4e, expected {manifest['sha256'][rigid][:12]} as the manifest"
        " says",
        "foreign file": "foreign: found no file of that name in the manifest, expected those of one package",
        "no network": "Network File: found none, expected Runtime/Network/ik.onnx",
        "other network": "network: found inputs of width [7] and outputs of width [3, 3, 3], expected one input"
        f" ({', '.join(order)}) and commands and lengths of {', '.join(tendons)}, and a tip",
        "no settings": "Settings File: found none, expected Runtime/teleoperation.json",
        "no maps": f"{first_map(manifest)}: no such file, expected {size_of(manifest)} as the manifest's lattice says",
    }


def first_map(manifest: dict) -> str:
    sheets = manifest["reach"]["sheets"]
    return manifest["grids"]["rigid" if sheets else manifest["reach"]["grids"][0]]["file"]


def size_of(manifest: dict) -> int:
    (grid,) = [grid for grid in manifest["grids"].values() if grid["file"] == first_map(manifest)]
    return 2 * int(np.prod(grid["shape"]))


# --- the stubs, the sample


def declared(text: str) -> set[str]:
    """Public members and types of C#, as their declarations begin; without what only a definition has."""
    declarations = re.findall(r"^ *((?:public|protected) [^={;]*?)\s*(?:[={;]|$)", re.sub(r"//.*", "", text), re.M)
    return {" ".join(declaration.replace("extern ", "").split()) for declaration in declarations}


def test_the_stubs_of_mujoco_have_the_signatures_of_its_source():
    listed = {line for lines in SIGNATURES["files"].values() for line in lines}
    stubs = declared((STUBS / "Mujoco.cs").read_text()) | declared((STUBS / "MujocoEditor.cs").read_text())
    assert stubs == listed
    if root := os.environ.get("TRUNKLINE_MUJOCO"):
        for file, lines in SIGNATURES["files"].items():
            source = declared((Path(root) / file).read_text())
            assert set(lines) <= source, f"{file}: {set(lines) - source}"


def test_the_samples_of_the_package_are_there():
    samples = json.loads(package_json("org.a.b", "1.2.3", "A", "6000.0", "B"))["samples"]
    assert samples == SAMPLES
    assert {sample["path"] for sample in samples} == {
        f"Samples~/{path.name}" for path in (CSHARP / "Samples~").iterdir()
    }
    for sample in samples:
        assert (CSHARP / sample["path"] / "README.md").is_file()
        assert set(sample) == {"displayName", "description", "path"}
