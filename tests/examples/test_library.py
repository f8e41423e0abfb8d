"""The wheel, installed where no checkout is, does what examples/library.py shows."""

import json
import shutil
import subprocess
import sys
import sysconfig
import venv
import zipfile
from pathlib import Path

import numpy as np
import onnx
import pytest

from tests.support.bent_chain import stump, stump_spec
from trunkline.frames import STANDARD_GRAVITY, downwards
from trunkline.kinematics.ik.inputs import DIRECTION
from trunkline.kinematics.ik.network import InverseKinematics
from trunkline.kinematics.ik.onnx import to_onnx
from trunkline.model.statics.chain import read_chain
from trunkline.model.statics.equilibria import equilibrium
from trunkline.unity.assemble import CSHARP

ROOT = Path(__file__).parents[2]
# Kernels as plain Python: two equilibria take less time than to compile what the checkout has compiled already.
ENVIRONMENT = {"NUMBA_DISABLE_JIT": "1"}


def run(folder: Path, *command: str | Path) -> subprocess.CompletedProcess:
    words = [str(part) for part in command]
    return subprocess.run(words, cwd=folder, env=ENVIRONMENT, capture_output=True, text=True, check=False)


@pytest.fixture(scope="module")
def wheel(tmp_path_factory) -> Path:
    """Built from a copy, so that nothing is left in the checkout."""
    copy = tmp_path_factory.mktemp("source")
    for name in ("pyproject.toml", "README.md", "LICENSE"):
        shutil.copy(ROOT / name, copy)
    shutil.copytree(ROOT / "trunkline", copy / "trunkline", ignore=shutil.ignore_patterns("__pycache__"))
    pip = [sys.executable, "-m", "pip", "wheel", "-q", "--disable-pip-version-check", "--no-index"]
    built = run(copy, *pip, "--no-deps", "--no-build-isolation", "-w", copy / "dist", copy)
    assert built.returncode == 0, built.stderr
    return next((copy / "dist").glob("trunkline-*.whl"))


@pytest.fixture(scope="module")
def python(wheel, tmp_path_factory) -> Path:
    """An environment of the wheel and this one's libraries, without what their .pth files add: the checkout."""
    folder = tmp_path_factory.mktemp("installed") / "venv"
    venv.create(folder, symlinks=True)
    (site,) = folder.glob("lib/python*/site-packages")
    (site / "libraries.pth").write_text("".join(f"{sysconfig.get_path(kind)}\n" for kind in ("purelib", "platlib")))
    with zipfile.ZipFile(wheel) as packed:
        packed.extractall(site)
    return folder / "bin" / "python"


def test_the_wheel_is_the_library_with_the_unity_sources(wheel):
    names = zipfile.ZipFile(wheel).namelist()
    assert {name.split("/")[0].partition("-")[0] for name in names} == {"trunkline"}
    for path in CSHARP.rglob("*.*"):
        assert f"trunkline/unity/csharp/{path.relative_to(CSHARP).as_posix()}" in names


def test_the_example_runs_outside_of_a_checkout(python, tmp_path):
    chain = read_chain(stump())
    tensions = np.zeros((2, 3))
    tensions[0, 0] = 5.0
    down = downwards(np.full(2, 0.3), np.zeros(2))
    rest = equilibrium(chain, tensions, STANDARD_GRAVITY * down)
    inputs = np.concatenate([down, rest.position, rest.quaternion], axis=1)
    network = InverseKinematics(8, inputs, rest.commands, rest.lengths)
    onnx.save(to_onnx(network, ["a", "b", "c"], 0.005), str(tmp_path / "ik.onnx"))
    spec = stump_spec()
    spec.compile()
    (tmp_path / "arm.xml").write_text(spec.to_xml())
    shutil.copy(ROOT / "examples" / "library.py", tmp_path)
    done = run(tmp_path, python, "library.py", "arm.xml", "ik.onnx")
    assert done.returncode == 0, done.stderr
    tip, commands, missed = (line.partition(":")[2].strip(" []").split() for line in done.stdout.splitlines())
    np.testing.assert_allclose(np.array(tip, float), rest.position[0], atol=1e-4)
    low, high = rest.commands.min(axis=0) - 1e-4, rest.commands.max(axis=0) + 1e-4  # within which the network keeps
    assert ((low <= np.array(commands, float)) & (np.array(commands, float) <= high)).all()
    assert 0 < float(missed[0]) < 1e3 * chain.length


def test_the_example_asks_as_the_packed_network_is_asked():
    """The test above makes its own network, of the form that gravity has by default."""
    manifest = json.loads((ROOT / "artifacts/package_unity/manifest.json").read_text())
    assert manifest["network"]["input_order"] == DIRECTION


def test_the_example_is_twenty_lines():
    _, _, code = (ROOT / "examples" / "library.py").read_text().split('"""')
    assert len([line for line in code.splitlines() if line.strip()]) <= 20


def test_its_version_is_the_one_written_once(python, tmp_path):
    code = "from importlib.metadata import version as v; from trunkline import version as own; import trunkline as t; "
    done = run(tmp_path, python, "-c", code + "print(own.__version__, v('trunkline'), t.__file__)")
    version, installed, where = done.stdout.split()
    assert version == installed
    assert Path(where).is_relative_to(python.parents[1])


@pytest.mark.parametrize("name", ["report", "settings"])
def test_a_command_that_needs_a_checkout_says_so_in_one_line(python, tmp_path, name):
    done = run(tmp_path, python, "-m", f"trunkline.pipeline.{name}")
    assert (done.returncode, done.stdout, done.stderr.count("\n")) == (1, "", 1), done.stderr
    assert "error: " in done.stderr
