"""The examples of docs/consumers.md: each takes a package to its target, and the page shows or links them."""

import json
import re
from dataclasses import replace
from importlib.util import find_spec
from pathlib import Path

import mujoco
import numpy as np
import pytest
from onnx import TensorProto, helper

from tests.support.folders import package
from tests.support.reaching import EXAMPLES, reach, reach_by_ros
from tests.support.small_arm import small_spec
from tests.unity.test_assemble import LABEL, ROBOT, TRAJECTORY, sources_in
from trunkline.errors import InputError
from trunkline.frames import STANDARD_GRAVITY
from trunkline.kinematics.ik.inputs import DIRECTION
from trunkline.model.simulation.rest import settle
from trunkline.twin.package import MANIFEST, read_tarball
from trunkline.unity.assemble import assemble
from trunkline.unity.upm_package import write_tarball

PAGE = Path(__file__).parents[2] / "docs/consumers.md"
VECTORS = "Tests/Vectors/network.json"
FILES = sorted(path.name for path in EXAMPLES.iterdir() if path.suffix in (".py", ".mjs"))
HEAVY = {"batch_warp.py": "mujoco_warp", "batch_mjx.py": "jax"}  # example: the module that make test does not install
DOWN = np.array([0.48, -0.36, -0.8])  # of gravity in the base frame
PULLS = np.array([0.03, -0.05, -0.05])  # m; the others pay out, as an arm that all pull may have several shapes
CURVE = 5.0  # 1/rad², by which a joint's spring hardens: far less than where the arm has several shapes


def curved() -> mujoco.MjSpec:
    """A small arm whose springs are curved, whose mount is turned, and which soon rests: no friction, much damping."""
    spec = small_spec()
    spec.body("base").quat = [0.99, 0.1, -0.05, 0.0]
    for joint in spec.joints:
        stiffness = float(np.ravel(joint.stiffness)[0])
        joint.stiffness, joint.damping = [stiffness, 0, CURVE * stiffness], [0.3 * stiffness, 0, 0]
    for tendon in spec.tendons:
        tendon.frictionloss = 0
    return spec


def constant(commands: np.ndarray, tip: np.ndarray) -> bytes:
    """A network of one answer, whatever the pose."""
    rows = {"commands": commands, "lengths": commands, "tip": tip}
    nodes, weights = [], [helper.make_tensor("none", TensorProto.FLOAT, [10, 3], np.zeros(30))]
    for name, row in rows.items():
        weights.append(helper.make_tensor(f"{name}_row", TensorProto.FLOAT, [3], row))
        nodes.append(helper.make_node("MatMul", ["pose", "none"], [f"{name}_0"]))
        nodes.append(helper.make_node("Add", [f"{name}_0", f"{name}_row"], [name]))
    ends = [helper.make_tensor_value_info("pose", TensorProto.FLOAT, ["n", 10])]
    outputs = [helper.make_tensor_value_info(name, TensorProto.FLOAT, ["n", 3]) for name in rows]
    graph = helper.make_graph(nodes, "ik", ends, outputs, weights)
    model = helper.make_model(graph, opset_imports=[helper.make_opsetid("", 15)], ir_version=8)
    tendons = [f"tendon_{i}" for i in (1, 2, 3)]
    meaning = {"inputs": json.dumps(DIRECTION), "outputs": json.dumps(tendons), "doubt_beyond_m": "0.005"}
    helper.set_model_props(model, {name: f"{name} in m" for name in rows} | meaning)
    return model.SerializeToString()


@pytest.fixture(scope="module")
def small(tmp_path_factory) -> Path:
    """A package of `curved`, whose network answers with the commands by which `settle` came to the one target."""
    folder = tmp_path_factory.mktemp("small")
    spec = curved()
    model = spec.compile()
    commands = model.tendon_length0[:3] - PULLS
    rest = settle(model, commands[None], STANDARD_GRAVITY * DOWN)
    assert rest.rested.all()
    sources = replace(sources_in(folder), mjcf=spec.to_xml())
    sources.network.write_bytes(constant(commands, rest.position[0]))
    files, violations = assemble(LABEL, sources, TRAJECTORY, ROBOT)
    assert violations == []
    assert json.loads(files[MANIFEST])["model"]["springs"] != []
    pose = [*DOWN.tolist(), *rest.position[0].tolist(), *rest.quaternion[0].tolist()]
    case = {"question": {"pose": pose}, "answer": {"commands": commands.tolist(), "doubtful": False}}
    files[VECTORS] = json.dumps({"cases": [case | {"answer": {"doubtful": True}}, case]}).encode()
    write_tarball(folder / "small.tgz", files)
    return folder / "small.tgz"


@pytest.fixture
def built() -> Path:
    return package()


@pytest.mark.parametrize("example", [name for name in FILES if not name.startswith("ros2")])
def test_an_example_takes_a_small_arm_to_where_it_settles(example, small, tmp_path):
    if example in HEAVY and find_spec(HEAVY[example]) is None:
        pytest.skip(f"no {HEAVY[example]} for its example; docs/consumers.md says how it is installed")
    reached = reach(example, small, tmp_path)
    assert reached.missed < 0.05
    target = np.array(json.loads(read_tarball(small)[VECTORS])["cases"][1]["question"]["pose"][3:6])
    assert 1e3 * np.linalg.norm(reached.tip - target) == pytest.approx(reached.missed, abs=0.02)


def test_the_node_of_ros_goes_where_it_is_told(small, tmp_path):
    assert reach_by_ros(small, tmp_path, 12).missed < 0.05


@pytest.mark.parametrize("example", ["plain.py", "simulate.py", "wasm.mjs"])
def test_an_example_takes_the_demo_s_arm_to_its_target(example, built, tmp_path):
    """As near as the network's commands come to their targets, without friction."""
    metrics = json.loads(read_tarball(built)[MANIFEST])["metrics"]["train_ik"]["as_controls"]["frictionless"]
    assert reach(example, built, tmp_path).missed < metrics["position_error_mm"]["max"]


def test_without_the_manifest_s_springs_the_small_arm_rests_elsewhere(small, tmp_path):
    """So the examples that put them in do so for a reason, and would not pass without."""
    files = read_tarball(small)
    block = json.loads(files[MANIFEST])
    block["model"]["springs"] = []
    write_tarball(tmp_path / "straight.tgz", files | {MANIFEST: json.dumps(block).encode()})
    assert reach("wasm.mjs", tmp_path / "straight.tgz", tmp_path).missed > 1.0


def test_an_example_that_fails_is_one_line(small, tmp_path):
    files = read_tarball(small)
    write_tarball(tmp_path / "none.tgz", {name: data for name, data in files.items() if name != VECTORS})
    with pytest.raises(InputError, match=r"^plain.py: found .*network.json"):
        reach("plain.py", tmp_path / "none.tgz", tmp_path)


def test_the_page_shows_an_example_as_it_is_and_links_all_others():
    page = PAGE.read_text(encoding="utf-8")
    shown = re.findall(r"```(?:python|js)\n(.*?)```", page, re.DOTALL)
    files = {name: (EXAMPLES / name).read_text(encoding="utf-8") for name in FILES}
    assert shown == [files["plain.py"]]
    assert [name for name in files if name != "plain.py" and f"](../examples/consumers/{name})" not in page] == []


@pytest.mark.parametrize("example", FILES)
def test_an_example_is_short(example):
    """Besides what it imports and says of itself."""
    text = (EXAMPLES / example).read_text(encoding="utf-8")
    code = re.sub(r'""".*?"""', "", text, flags=re.DOTALL)
    lines = [line for line in code.splitlines() if line.strip() and not line.startswith(("import", "from", "#", "//"))]
    assert len(lines) <= 23
