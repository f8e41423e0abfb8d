"""The component itself, `Twin.cs`, compiled by Mono and run on libmujoco in the plug-in's order of calls: it does what
its mirror in Python does, and says in one line what is wrong."""

import ctypes
import json
import os
import subprocess
from dataclasses import replace
from functools import partial
from pathlib import Path

import mujoco
import numpy as np
import pytest

from tests.unity.mono import compiled
from tests.unity.test_csharp import CORE, SHARED
from tests.unity.test_start import STEP
from trunkline.twin.package import MANIFEST
from trunkline.unity.assemble import CSHARP
from trunkline.unity.plugin import Scene
from trunkline.unity.start import TwinComponent
from trunkline.unity.start_check import DOWN, PREFIX, manifest_of, scene_of, turns
from trunkline.unity.time_steps import steps_per_frame

HERE = Path(__file__).parent
TURN = turns([1.0])[0]  # by which an arm's root is turned, so that it hangs to one side
RATE = 90.0  # Hz, at which the step is that of the tests
FIELDS = ["qpos0", "jnt_stiffness", "jnt_stiffnesspoly", "dof_frictionloss", "dof_damping", "dof_dampingpoly"]
FIELDS += ["tendon_stiffness", "tendon_stiffnesspoly", "tendon_frictionloss", "actuator_actadr"]


@pytest.fixture(scope="module")
def files(arm_files):
    return arm_files


@pytest.fixture(scope="module")
def program(tmp_path_factory):
    """The component with a plug-in that simulates, and libmujoco beside it by the name that it is asked for."""
    folder = tmp_path_factory.mktemp("physics")
    core = compiled(folder / "core.dll", CORE)
    engine = compiled(folder / "UnityEngine.dll", [HERE / "stubs/UnityEngine.cs"])
    sources = [HERE / "physics/Mujoco.cs", HERE / "physics/Program.cs", HERE / "layer/ReadAs.cs", SHARED[1]]
    sources += [CSHARP / "Twin.cs", CSHARP / "Pace.cs"]
    (library,) = Path(mujoco.__file__).parent.glob("libmujoco.so*")
    (folder / "libmujoco.so").symlink_to(library)
    return compiled(folder / "physics.exe", sources, [core, engine], "-unsafe")


def place(struct: int, value: bytes) -> int:
    """How many bytes after the address `struct` a struct has this value."""
    for offset in range(0, 1 << 20, 8):
        if ctypes.string_at(struct + offset, 8) == value:
            return offset
    raise AssertionError("a field that is nowhere")


@pytest.fixture(scope="module")
def fields(files) -> dict[str, dict[str, int]]:
    """Where libmujoco's structs have what the component reads, found by the values that they have."""
    model = without_component(files, [PREFIX])
    data = mujoco.MjData(model)
    model.opt.timestep = 0.00123456789
    in_model = {name: place(model._address, np.uintp(getattr(model, name).ctypes.data).tobytes()) for name in FIELDS}
    in_model["timestep"] = place(model._address, np.float64(model.opt.timestep).tobytes())
    names = ("qpos", "qvel", "act", "ctrl")
    in_data = {name: place(data._address, np.uintp(getattr(data, name).ctypes.data).tobytes()) for name in names}
    return {"model_fields": in_model, "data_fields": in_data | {"energy": data.energy.ctypes.data - data._address}}


def contents(model: mujoco.MjModel) -> dict[str, list]:
    """Kind and number of what a model has, by its name there."""
    counts = {"joint": model.njnt, "tendon": model.ntendon, "actuator": model.nu}
    return {getattr(model, kind)(i).name: [kind, i] for kind, count in counts.items() for i in range(count)}


def without_component(files, prefixes) -> mujoco.MjModel:
    """The model that the plug-in compiles of such arms, before the component hears of it."""
    arm = scene_of(files, TURN, STEP).arms[0]
    scene = Scene([replace(arm, prefix=prefix) for prefix in prefixes], [], DOWN, STEP)
    scene.start()
    return scene.model


@pytest.fixture
def run(program, files, fields, tmp_path):
    return partial(run_component, program, files, fields, tmp_path)


def run_component(
    program: Path, files, fields, folder: Path, happens, manifest: bytes | None = None, **more_fields
) -> list[list]:
    """What the component does where it is told: angles, activations, times (s), and what the console says."""
    models = {}
    for count, prefixes in ((1, [PREFIX]), (2, [PREFIX, "other_"])):
        model = without_component(files, prefixes)
        mujoco.mj_saveModel(model, str(folder / f"{count}.mjb"), None)
        models[str(folder / f"{count}.mjb")] = contents(model)
    (folder / "manifest.json").write_bytes(files[MANIFEST] if manifest is None else manifest)
    first, second = models
    lines = [[{"one": first, "two": second}.get(word, word) if isinstance(word, str) else word for word in line]
            for line in happens]  # fmt: skip
    scene = {"manifest": str(folder / "manifest.json"), "models": models, "display_rate": RATE, "happens": lines}
    scene |= more_fields | fields
    (folder / "scene.json").write_text(json.dumps(scene))
    environment = os.environ | {"LD_LIBRARY_PATH": str(program.parent)}
    command = ["mono", str(program), str(folder / "scene.json")]
    done = subprocess.run(command, capture_output=True, text=True, env=environment)
    assert done.returncode == 0, done.stdout + done.stderr
    return [[*(np.array(part.split(), float) for part in parts[:3]), [word for word in parts[3].split("|") if word]]
            for parts in (line.split(";", 3) for line in done.stdout.splitlines())]  # fmt: skip


@pytest.fixture
def name(files) -> str:
    return PREFIX + manifest_of(files).actuators[0].name


def test_it_settles_the_arm_and_keeps_it_as_python_does(run, files, name):
    begin = [["arm", PREFIX, "one"], ["compile", "one"], ["tell"]]
    then = [["control", name, 0.02], ["step", 30], ["recreate", "one"], ["tell"], ["step", 30], ["tell"]]
    results = run(begin + then)
    scene = scene_of(files, TURN, STEP)
    expected = []
    scene.start()
    expected.append((scene.data.qpos.copy(), scene.data.act.copy()))
    scene.controls[name] = 0.02
    scene.fixed_update(30)
    scene.recreate()
    expected.append((scene.data.qpos.copy(), scene.data.act.copy()))
    scene.fixed_update(30)
    expected.append((scene.data.qpos.copy(), scene.data.act.copy()))
    for (angles, activations, times, lines), (qpos, act) in zip(results, expected, strict=True):
        np.testing.assert_allclose(angles, qpos, atol=1e-9)
        np.testing.assert_allclose(activations, act, atol=1e-12)
        assert times.tolist() == pytest.approx([STEP, 2 / RATE])
        assert lines == []
    assert np.abs(expected[0][0]).max() > 1e-4  # the rest is not the straight arm
    assert np.abs(expected[2][0] - expected[0][0]).max() > 1e-2


def test_another_arm_that_comes_disturbs_none(run, files, name):
    begin = [["arm", PREFIX, "one"], ["compile", "one"], ["control", name, 0.02], ["step", 30]]
    then = [["arm", "other_", "two"], ["recreate", "two"], ["step", 30], ["tell"]]
    ((angles, activations, _, lines),) = run(begin + then)
    scene = scene_of(files, TURN, STEP)
    scene.start()
    scene.controls[name] = 0.02
    scene.fixed_update(30)
    scene.arms.append(replace(scene.arms[0], prefix="other_"))
    scene.components.append(TwinComponent(manifest_of(files), "other_"))
    scene.recreate()
    scene.fixed_update(30)
    np.testing.assert_allclose(angles, scene.data.qpos, atol=1e-9)
    np.testing.assert_allclose(activations, scene.data.act, atol=1e-12)
    assert lines == []


def test_commands_are_sent_as_pulls_and_bad_ones_are_one_line(run, files, name):
    rest = [actuator.rest_length for actuator in manifest_of(files).actuators]
    commands = (np.array(rest) - [0.02, 0.0, -0.01]).tolist()
    begin = [["arm", PREFIX, "one"], ["compile", "one"], ["send", PREFIX, commands], ["step", 100], ["tell"]]
    bad = [["send", PREFIX, [None, *commands[1:]]], ["step", 1], ["send", PREFIX, [None, *commands[1:]]], ["tell"]]
    not_finite = [["control", name, None], ["step", 3], ["control", name, None], ["step", 3], ["tell"]]
    short = [["send", PREFIX, commands[:2]], ["tell"]]
    good, refused, stays, few = run(begin + bad + not_finite + short)
    np.testing.assert_allclose(good[1], [0.02, 0.0, -0.01], atol=1e-4)  # the motors' lag is over
    assert good[3] == []
    assert refused[3] == [
        "error: Trunkline Twin: found the command NaN, expected finite numbers; the pulls stay as they are"
    ]
    (line,) = stays[3]
    problem = f"{name.removeprefix(PREFIX)}: found the control NaN, expected a finite number; it stays at 0.02 m"
    assert line == f"error: Trunkline Twin: {problem}"
    np.testing.assert_allclose(stays[1], [0.02, 0.0, -0.01], atol=1e-4)
    assert few[3] == ["error: Trunkline Twin: found 2 commands, expected 3"]


def test_a_manifest_of_another_arm_is_one_line_and_the_arm_stands_still(run, files):
    other = json.loads(files[MANIFEST])
    other["model"]["names"]["joints"][0] = "elbow"
    other["model"]["names"]["joints"][1] = "wrist"
    happens = [["arm", PREFIX, "one"], ["compile", "one"], ["step", 100], ["recreate", "one"], ["tell"]]
    ((angles, _, _, lines),) = run(happens, json.dumps(other).encode())
    assert lines == [
        f"error: Trunkline Twin: found no joint elbow below {PREFIX}, and 1 more are missing, expected the arm of "
        "; it is held where it is"
    ]
    assert np.abs(angles).max() < 1e-5


@pytest.mark.parametrize("bad", [b"{}", b'{"model": {"longest_step": 0.004}}', b"not JSON"])
def test_a_file_that_is_no_manifest_is_one_line(run, bad):
    ((*_, lines),) = run([["arm", PREFIX, "one"], ["compile", "one"], ["tell"]], bad)
    assert lines == [
        "error: Trunkline Twin: found no Manifest File that says all of an arm, expected Runtime/manifest.json of this "
        "package"
    ]


def test_a_scene_that_is_only_written_is_left_alone(run):
    """`CreateScene(skipCompile: true)` raises the event without a model."""
    happens = [["arm", PREFIX, "one"], ["write"], ["compile", "one"], ["tell"]]
    ((angles, _, _, lines),) = run(happens)
    assert np.abs(angles).max() > 1e-4
    assert lines == []


SLOW, FAST, STEPS = 1 / 50, 1 / RATE, steps_per_frame(RATE)  # s, of a frame that simulates one of the display


def test_a_device_that_falls_behind_is_told_before_the_camera_until_it_keeps_up(run):
    begin = [["arm", PREFIX, "one"], ["compile", "one"], ["camera"]]
    first = [["frames", 60, SLOW, STEPS], ["look"], ["tell"]]  # a second and more: it may be a hitch
    then = [["frames", 60, SLOW, STEPS], ["look"], ["frames", 60, SLOW, STEPS], ["look"], ["tell"]]
    again = [["frames", 140, FAST, STEPS], ["look"], ["tell"]]  # a whole second at the display's rate, too
    results = run(begin + first + then + again)
    rate = "found 56 % of real time simulated in steps of 3.7 ms, expected 100 %"
    shown = f"shown: Trunkline: / {rate}: / this device does not keep up, the arm moves too slowly at 1 m"
    warned = f"warning: Trunkline: {rate}: this device does not keep up, the arm moves too slowly"
    assert [lines for *_, lines in results] == [["shown: "], [warned, shown, shown], ["shown: "]]


def test_a_component_that_is_switched_off_takes_its_warning_along(run):
    begin = [["arm", PREFIX, "one"], ["compile", "one"], ["camera"], ["frames", 120, SLOW, STEPS], ["look"]]
    ((*_, lines),) = run([*begin, ["disable", PREFIX], ["look"], ["tell"]])
    assert [len(line) > len("shown: ") for line in lines] == [True, True, False]


def test_another_libmujoco_than_the_plug_in_s_is_one_line(run):
    ((angles, _, _, lines),) = run([["arm", PREFIX, "one"], ["compile", "one"], ["tell"]], header=3012000)
    problem = f"found libmujoco {mujoco.__version__}, expected 3.12.0, which org.mujoco is made for"
    assert lines == [f"error: Trunkline Twin: {problem}"]
    assert not angles.any()  # a model of other structures is not touched
