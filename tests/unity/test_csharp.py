"""The package's C# core, compiled by Mono: it answers the shared vectors, and what they leave out, as Python does."""

import hashlib
import json
import math
import subprocess
from dataclasses import asdict
from functools import partial
from pathlib import Path
from types import SimpleNamespace
from unittest.mock import Mock

import numpy as np
import pytest
from scipy.spatial.transform import Rotation

from tests.support.folders import unpack
from tests.support.operator import config
from tests.support.unity_frame import unity_quaternion
from tests.unity.mono import compiled
from tests.unity.test_assemble import network
from tests.unity.test_shared_vectors import CASES
from trunkline.ar.conformance.answers import TARGETS, answers_of
from trunkline.ar.hybrid.basket import Basket
from trunkline.ar.preview.contents import network_of
from trunkline.ar.preview.package import read_package
from trunkline.ar.session.registration import after, expected_error, fit, inverse, pose_of, residuals, tilt
from trunkline.ar.teleop.alignment import Aligned, wrist_of
from trunkline.ar.teleop.messages import Obstacle, World, WorldObject
from trunkline.ar.teleop.reach import MapReach
from trunkline.ar.teleop.targets import bring, place
from trunkline.ar.teleop.tendons import Network, bend
from trunkline.ar.teleop.vectors import add
from trunkline.errors import InputError
from trunkline.frames import rotation_from_wxyz, wxyz_from_rotation
from trunkline.kinematics.ik.inference import ask
from trunkline.kinematics.ik.inputs import DIRECTION, POSE, TILT
from trunkline.twin.package import MANIFEST, package_digest, robot_of
from trunkline.unity.assemble import CSHARP
from trunkline.unity.frame import unity_position
from trunkline.unity.unpacked import maps_of
from trunkline.unity.upm_package import NETWORK, write_tarball

TESTS = Path(__file__).parent / "csharp"
CORE = sorted((CSHARP / "Core").glob("*.cs"))
SHARED = [CSHARP / "Tests" / name for name in ("Comparison.cs", "Messages.cs", "SharedVectors.cs")]
NAN = float("nan")
SILENT: dict[str, list] = {"commands": [], "lengths": [], "tip": []}  # of a network that is not asked
STEP = 0.01  # s, over which a turning frame is looked at
BENDS = 6  # targets that the network is asked to bend to
REACHES = 400  # questions about the tip's reach, gravity another at each: few points of the surface answer each


@pytest.fixture(scope="module")
def program(tmp_path_factory):
    """The test program, of the core as a library of its own."""
    folder = tmp_path_factory.mktemp("csharp")
    core = compiled(folder / "core.dll", CORE, [], "-noconfig")
    return compiled(folder / "vectors.exe", [*SHARED, *sorted(TESTS.glob("*.cs"))], [core])


def test_all_that_the_core_shows_has_a_comment(tmp_path):
    """Where something has none, or one that names what is not there, the compiler refuses."""
    compiled(tmp_path / "core.dll", CORE, [], "-noconfig", f"-doc:{tmp_path / 'core.xml'}")
    assert "Trunkline.Where.Blocked" in (tmp_path / "core.xml").read_text()


def run(program: Path, files: dict[str, bytes], folder: Path, *options: str) -> subprocess.CompletedProcess:
    """The program's answer to a package of these `files`."""
    command = ["mono", str(program), str(unpack(files, folder)), *options]
    return subprocess.run(command, capture_output=True, text=True)


def test_the_core_answers_the_shared_vectors_and_what_they_leave_out(program, files, tmp_path):
    (tmp_path / "more.json").write_text(json.dumps(more(files)).replace("NaN", "null"))
    done = run(program, files, tmp_path / "package", "--more", str(tmp_path / "more.json"))
    assert done.returncode == 0, done.stdout + done.stderr
    counts = {line.split()[0]: int(line.split()[1]) for line in done.stdout.splitlines()}
    assert set(counts) == {*CASES, "steps", "frames", "fit", "bend", "sure", "things", "reach", "refusals"}
    for name in CASES:
        assert counts[name] == len(json.loads(files[f"Tests/Vectors/{name}.json"])["cases"])
    recorded = json.loads(files["Tests/Vectors/steps.json"])["sequences"]
    assert counts["steps"] == sum(len(sequence["steps"]) for sequence in recorded)


@pytest.mark.parametrize("name", [*CASES, "steps"])
def test_a_vector_that_says_otherwise_is_named(program, plain_answered, tmp_path, name):
    """A test that cannot fail is none: the last number of each file that is not small, moved by a part in 10 000. The
    network's own answers are given to the core, which adds whether they are doubtful."""
    files = plain_answered
    path = f"Tests/Vectors/{name}.json"
    document = json.loads(files[path])
    steps = document["sequences"][-1]["steps"] if name == "steps" else document["cases"]
    answers = [item["intent" if name == "steps" else "answer"] for item in reversed(steps)]
    if name == "network":
        answers[0]["unsure"] = not answers[0]["unsure"]
    else:
        assert any(moved_a_little(item) for item in answers)
    data = json.dumps(document).replace("NaN", "null").encode()
    done = run(program, rehashed(files | {path: data}), tmp_path)
    assert done.returncode == 1
    assert done.stdout.splitlines()[-1].startswith(f"error: {name}")


def moved_a_little(answer) -> bool:
    """Whether a number that is not small was found in it, and moved."""
    for key, value in reversed(answer.items() if isinstance(answer, dict) else list(enumerate(answer))):
        if isinstance(value, dict | list) and moved_a_little(value):
            return True
        if isinstance(value, float) and abs(value) > 1e-3:
            answer[key] = value * 1.0001
            return True
    return False


def rehashed(files: dict[str, bytes]) -> dict[str, bytes]:
    """The package whose manifest means these files."""
    manifest = json.loads(files[MANIFEST])
    manifest["sha256"] = {path: hashlib.sha256(data).hexdigest() for path, data in files.items() if path != MANIFEST}
    return files | {MANIFEST: json.dumps(manifest).encode()}


def damaged(files: dict[str, bytes], name: str) -> dict[str, bytes]:
    manifest = json.loads(files[MANIFEST])
    grid = manifest["grids"]["soft_035"]
    if name == "another byte":
        return files | {grid["file"]: files[grid["file"]][:-1] + b"\x01"}
    if name == "a file that is not listed":
        return files | {"Runtime/more.dll": b"more"}
    if name == "no grid":
        return {path: data for path, data in files.items() if path != grid["file"]}
    if name == "no manifest":
        return {path: data for path, data in files.items() if path != MANIFEST}
    if name in NO_MANIFESTS:
        return files | {MANIFEST: NO_MANIFESTS[name](files[MANIFEST])}
    if name == "a short grid":
        return rehashed(files | {grid["file"]: files[grid["file"]][:-2]})
    key, change = name.split()
    grid[key] = json.loads(change)
    return files | {MANIFEST: json.dumps(manifest).encode()}


NO_MANIFESTS = {
    "no JSON": lambda text: b"not JSON",
    "no text": lambda text: b"\xff" + text,
    "an empty file": lambda text: b"",
    "a manifest that ends too early": lambda text: text.rstrip()[:-1],
    "a manifest that ends in a word": lambda text: text.rpartition(b'"')[0],
    "a manifest and more": lambda text: text + b"}",
    "a list": lambda text: b"[]",
    "an empty block": lambda text: b"{}",
    "no grids": lambda text: text.replace(b'"grids": {', b'"others": {'),
    "a grid without a shape": lambda text: text.replace(b'"shape"', b'"size"'),
}
BAD = ["another byte", "a file that is not listed", "no grid", "no manifest", "a short grid", "origin [0.1,0.1,0.1]",
       "spacing [0.2,0.2,0.2]", "shape [5,9,8]", "shape [5,9]", "shape 5", "spacing null", "origin [1,2,{}]",
       "file 3", *NO_MANIFESTS]  # fmt: skip


SHEETS = "Runtime/Reachability/sheets.bytes"
BAD_SHEETS = {"no sheets": None, "short sheets": -2, "long sheets": 6}  # bytes that are cut off or put on


def with_other_sheets(files: dict[str, bytes], name: str) -> dict[str, bytes]:
    cut, sheets = BAD_SHEETS[name], files[SHEETS]
    others = {path: data for path, data in files.items() if path != SHEETS}
    return rehashed(others if cut is None else others | {SHEETS: (sheets + bytes(6))[: len(sheets) + cut]})


@pytest.mark.parametrize(
    ("package", "spoil", "name"),
    [*(("of_one_tilt", damaged, name) for name in BAD), *(("plain", with_other_sheets, name) for name in BAD_SHEETS)],
)
def test_a_package_that_is_not_sound_is_refused_in_the_same_words(program, request, tmp_path, package, spoil, name):
    files = spoil(request.getfixturevalue(f"{package}_answered"), name)
    refused = said_by(lambda: (package_digest(files), maps_of(files)))
    done = run(program, files, tmp_path)
    assert (done.returncode, done.stdout) == (1, f"error: {refused}\n")


def test_a_client_refuses_a_package_of_another_network(plain, tmp_path):
    write_tarball(tmp_path / "twin.tgz", rehashed(plain | {NETWORK: network(inputs=10)}))
    with pytest.raises(InputError, match=r"^network: found inputs of width \[10\] .*, expected one input \(theta_g, "):
        read_package(tmp_path / "twin.tgz")


# --- what the shared vectors leave out


def more(files: dict[str, bytes]) -> dict[str, list]:
    """Questions and answers, by what answers them."""
    rng = np.random.default_rng(0)
    recorded = json.loads(files["Tests/Vectors/steps.json"])
    core = answers_of(files, config().core, recorded["mount_offset"]).core
    return {
        "frames": [a_frame(rng) for _ in range(20)],
        "fit": [a_fit(rng, count) for count in (3, 3, 4, 6, 12) for _ in range(4)],
        "bend": bends(files, rng),
        "sure": surely(rng),
        "things": [of_objects(core, files, rng, in_arm) for in_arm in (False, True) for _ in range(8)],
        "reach": reaches(files, rng),
        "refusals": refusals(files),
    }


def case(question: dict, answer: dict) -> dict:
    return {"question": question, "answer": answer}


def a_frame(rng: np.random.Generator) -> dict:
    """The spin is that of the turning frame in Unity's axes, by its rotations a moment apart."""
    position, spin, first = rng.normal(size=3), rng.normal(size=3), Rotation.random(random_state=int(rng.integers(99)))
    then = Rotation.from_rotvec(STEP * spin) * first
    q, later = (unity_quaternion(wxyz_from_rotation(rotation)) for rotation in (first, then))
    turned = Rotation.from_quat(later) * Rotation.from_quat(q).inv()
    answer = {"position": unity_position(position).tolist(), "quaternion": q.tolist(),
              "spin": (turned.as_rotvec() / STEP).tolist()}  # fmt: skip
    return case({"position": position.tolist(), "quaternion": wxyz_from_rotation(first).tolist(),
                 "spin": spin.tolist()}, answer)  # fmt: skip


def a_fit(rng: np.random.Generator, count: int) -> dict:
    robot = rng.uniform(-0.4, 0.6, (count, 3))
    turn = Rotation.random(random_state=int(rng.integers(99)))
    reference = turn.inv().apply(robot - [1.0, 0.2, -0.3]) + rng.normal(scale=1e-3, size=(count, 3))
    at = rng.uniform(-0.5, 0.5, 3)
    if count > 3:
        pose = fit(reference, robot)
    else:
        rotation = Rotation.align_vectors(robot - robot.mean(axis=0), reference - reference.mean(axis=0))[0]
        pose = pose_of(robot.mean(axis=0) - rotation.apply(reference.mean(axis=0)), rotation)
    answer = {
        "pose": asdict(pose), "inverse": asdict(inverse(pose)), "after": asdict(after(pose, pose)),
        "residuals": residuals(pose, reference, robot).tolist(),
        "expected_error": expected_error(pose, reference, robot, at), "tilt": tilt(pose),
    }  # fmt: skip
    return case({"reference": reference.tolist(), "base": robot.tolist(), "at": at.tolist()}, answer)


def bends(files: dict[str, bytes], rng: np.random.Generator) -> list[dict]:
    """Calls of `bend`, with what the network was asked and answered."""
    network, cases, asked = network_of(files), [], []
    described = json.loads(files[MANIFEST])
    lengths = [described["model"]["rest_lengths"][tendon] for tendon in described["network"]["output_order"]]

    def recording(poses: np.ndarray) -> dict[str, np.ndarray]:
        asked[:] = [poses, network.ask(poses)]
        return asked[1]

    for number in range(BENDS):
        angle, azimuth = float(rng.uniform(0.1, 0.8)), 2 * math.pi / 3 * (number % 3)
        gravity = (math.sin(angle) * math.cos(azimuth), math.sin(angle) * math.sin(azimuth), -math.cos(angle))
        tip = tuple(rng.uniform([-0.3, -0.3, -0.5], [0.3, 0.3, 0.0]).tolist())
        bent = bend(Network(recording, network.inputs), tip, gravity, tolerance=100.0)
        poses, answers = asked
        outputs = {name: answers[name].astype(float).ravel().tolist() for name in ("commands", "lengths", "tip")}
        question = {"tip": tip, "gravity": gravity, "tolerance": 100.0, "poses": poses.tolist(), "network": outputs}
        pulls = [rest - command for rest, command in zip(lengths, bent.commands, strict=True)]
        answer = {name: values.tolist() for name, values in bent._asdict().items()}
        cases.append(case(question, answer | {"pulls": pulls}))
    return cases


def surely(rng: np.random.Generator) -> list[dict]:
    """What Python warns of, for every form of gravity, at either side of each limit."""
    cases, warnings = [], []
    for number in range(60):
        tilt, azimuth = float(rng.uniform(0, 1)), float(rng.uniform(-3, 3))
        down = [math.sin(tilt) * math.cos(azimuth), math.sin(tilt) * math.sin(azimuth), -math.cos(tilt)]
        pose = np.array([*([], [-tilt], down)[number % 3], 0.0, 0.0, -0.4, 1.0, 0.0, 0.0, 0.0], np.float32)
        straight, pulls = rng.uniform(0.4, 0.5, 3), rng.uniform(-0.01, 0.01, 3) * (0.15 if number % 2 else 1)
        commands = (straight - pulls).astype(np.float32)
        limits = [float(rng.uniform(0, 0.02)), *rng.uniform(0, 60, 2).tolist()]
        meaning = {"inputs": (POSE, TILT, DIRECTION)[number % 3], "doubt_beyond_m": 1, "sure_pulls_m": limits[0],
                   "straight_lengths_m": straight.tolist(), "sure_tilts_deg": limits[1:]}  # fmt: skip
        meaning = {name: json.dumps(value) for name, value in meaning.items()}
        warnings.append(bool(ask(answering(commands, meaning), pose[None])["unsure"][0]))
        question = {"pose": pose.tolist(), "commands": commands.tolist(), "straight": straight.tolist(), "sure": limits}
        cases.append(case(question, {"unsure": warnings[-1]}))
    assert 15 < sum(warnings) < 45
    return cases


def answering(commands: np.ndarray, meaning: dict[str, str]):
    """A runtime whose network answers `commands`, whatever it is asked."""
    outputs = {"commands": commands[None], "lengths": commands[None], "tip": np.zeros((1, 3))}
    return Mock(**{
        "get_inputs.return_value": [SimpleNamespace(name="pose")], "run.return_value": list(outputs.values()),
        "get_outputs.return_value": [SimpleNamespace(name=name) for name in outputs],
        "get_modelmeta.return_value.custom_metadata_map": meaning,
    })  # fmt: skip


def reaches(files: dict[str, bytes], rng: np.random.Generator) -> list[dict]:
    """Tips around the arm under gravity from any side; Python looks at all triangles of the surface."""
    reach, cases = MapReach.from_arrays(maps_of(files)), []
    for down in rng.normal(size=(REACHES, 3)):
        tip = tuple(rng.uniform([-0.4, -0.4, -0.6], [0.4, 0.4, 0.2]).tolist())
        gravity = tuple((down / np.linalg.norm(down)).tolist())
        cases.append(case({"tip": tip, "gravity": gravity}, reach.soft(tip, gravity)._asdict()))
    return cases


def of_objects(core, files: dict[str, bytes], rng: np.random.Generator, in_arm: bool) -> dict:
    """Targets where an object is near: one that hangs is marked, one that is held is brought along."""
    joints = tuple(float(angle) for angle in robot_of(files).ready)
    rigid, pointing, last = tuple(rng.uniform([0.3, -0.3, 0.3], [0.6, 0.3, 0.6]).tolist()), (0.0, 0.0, -1.0), None
    tip = add(rigid, tuple(rng.uniform([-0.2, -0.2, -0.4], [0.2, 0.2, -0.2]).tolist()))
    away = tuple(rng.uniform(-0.06, 0.06, 3).tolist())
    shapes = [("sphere", away), ("basket", add(away, (0.0, 0.0, -0.25)))]
    support = "held" if in_arm else "hanging"
    objects = tuple(
        WorldObject(shape, shape, 0.03, 0.1, 0.2, add(tip, off), tuple(Rotation.random(random_state=number).as_quat()),
              support, Basket(0.1, 0.2, 0.25))
        for number, (shape, off) in enumerate(shapes)
    )  # fmt: skip
    boxes = (Obstacle("the shelf", add(tip, (-0.05,) * 3), add(tip, (0.0, 0.05, 0.05))),)
    world, last = World("world", boxes, objects), Aligned(0.0, 0, 0.0)
    wrist = wrist_of(joints, core.mount_offset)
    if in_arm:
        result = bring(objects[0], rigid, pointing, False, wrist, 1, world, core.reach)
    else:
        result = place(rigid, tip, pointing, False, wrist, last, world, core.reach, core.settings)
    question = {"rigid": rigid, "tip": tip, "pointing": pointing, "joints": joints, "last": last._asdict(),
                "boxes": [asdict(box) for box in boxes], "things": [asdict(object) for object in objects]}  # fmt: skip
    return case(question, TARGETS.dump_python(result, mode="json"))


def refusals(files: dict[str, bytes]) -> list[dict]:
    """What is no question, and what Python says to it."""
    reach, known_network = MapReach.from_arrays(maps_of(files)), network_of(files)
    flat = [[0.0, 0.0, 0.0], [0.3, 0.0, 0.0], [0.0, 0.3, 0.0], [0.3, 0.3, 0.01], [0.1, 0.2, 0.0]]
    spread = [*flat[:3], [0.0, 0.0, 0.3], [0.2, 0.1, 0.2]]
    gravity_inputs = [0.0] if known_network.inputs == len(TILT) else [0.0, 0.0, -1.0]
    pose, down = [*gravity_inputs, 0.1, 0.0, -0.3, 1.0, 0.0, 0.0, 0.0], [0.0, 0.0, -1.0]
    wrong = [pose[:-1], [*pose[:-1], NAN], [NAN, *pose[1:]], [*pose[:-4], 2.0, 0.0, 0.0, 0.0], [1e39, *pose[1:]]]
    wrong += [[0.0, 0.5, -1.0, *pose[3:]]] if len(gravity_inputs) == 3 else []
    calls = {
        "rigid_reach": [(reach.rigid, {"mount": [NAN, 0.0, 0.5], "pointing": down})],
        "soft_reach": [
            (reach.soft, {"tip": [0.0, -1.5, NAN], "gravity": down}),
            (reach.soft, {"tip": [0.0, 0.0, 0.0], "gravity": [NAN] * 3}),
        ],
        "fit": [
            (lambda reference, base: fit(np.array(reference), np.array(base)), {"reference": item, "base": other})
            for item, other in ((flat, flat), (spread, without(spread, 2)), (without(spread, 3), spread))
        ],
        "network": [(lambda pose: known_network.ask(np.array([pose])), {"pose": item}) for item in wrong],
    }  # fmt: skip
    cases = [
        case({"of": name} | question, {"says": said_by(partial(ask, **question))})
        for name, asked in calls.items()
        for ask, question in asked
    ]
    for touches, says in of_three(spread[:3]):
        cases.append(case({"of": "fit", "reference": spread[:3], "base": touches}, {"says": says}))
    for inputs in {7, len(TILT), len(DIRECTION)} - {known_network.inputs}:
        says = said_by(partial(network_of, files | {NETWORK: network(inputs=inputs)}))
        cases.append(case({"of": "other network", "inputs": inputs}, {"says": says}))
    tip, gravity = (NAN, 0.0, -0.3), (0.0, 0.0, -1.0)
    cases.append(case({"of": "bend", "tip": tip, "gravity": gravity, "tolerance": 1.0, "poses": [], "network": SILENT},
                      {"says": said_by(lambda: bend(known_network, tip, gravity, 1.0))}))  # fmt: skip
    for item in bends(files, np.random.default_rng(1))[:1]:
        question = item["question"] | {"tolerance": 1e-6}
        tip, gravity = question["tip"], question["gravity"]
        says = said_by(lambda tip=tip, gravity=gravity: bend(known_network, tip, gravity, 1e-6))
        cases.append(case({"of": "bend"} | question, {"says": says}))
    if known_network.inputs == len(TILT):
        aside = (math.sin(0.6) * math.cos(0.5), math.sin(0.6) * math.sin(0.5), -math.cos(0.6))
        question |= {"gravity": aside}
        says = said_by(lambda: bend(known_network, tip, aside, 1.0))
        cases.append(case({"of": "bend"} | question, {"says": says}))
    return cases


def without(touches: list[list[float]], index: int) -> list[list[float]]:
    """Touches of which one is at no place."""
    return [*touches[:index], [touches[index][0], NAN, 0.0], *touches[index + 1 :]]


def of_three(touches: list[list[float]]) -> list[tuple[list[list[float]], str]]:
    """What no three touches are, and what is said to it; Python fits no three."""
    line = [[0.0, 0.0, 0.0], [0.3, 0.01, 0.0], [0.6, 0.0, 0.0]]
    _, off, _ = 1e3 * np.linalg.svd(line - np.mean(line, axis=0), compute_uv=False) / math.sqrt(3)
    assert 1 < off < 30
    return [
        (touches[:2], "touches: found 2, expected at least 3"),
        (line, f"touches: found all within {off:.0f} mm of a line, expected 30 mm: touch one further beside it"),
        (without(touches, 1), "touch 2: found (0.3, nan, 0), expected finite numbers"),
    ]


def said_by(call) -> str:
    with pytest.raises(InputError) as refused:
        call()
    return str(refused.value)


def test_rotations_of_the_fits_are_those_of_the_base():
    """`a_fit`'s answers mean what they say: a pose takes a touch of the headset's frame into the base."""
    fitted = a_fit(np.random.default_rng(3), 6)
    pose = fitted["answer"]["pose"]
    turn = rotation_from_wxyz(np.array(pose["quaternion"]))
    moved = turn.apply(fitted["question"]["reference"]) + pose["position"]
    np.testing.assert_allclose(moved, fitted["question"]["base"], atol=0.01)
