"""The twin in the plug-in's scene: it begins where the calibrated arm rests, and stays itself when scenes change."""

import re
from dataclasses import replace

import mujoco
import numpy as np
import pytest
from scipy.spatial.transform import Rotation

from trunkline.frames import gravity_in_base
from trunkline.model.simulation.rest import settle
from trunkline.unity import start
from trunkline.unity.assemble import CSHARP
from trunkline.unity.importer import as_imported
from trunkline.unity.linearize import Laws, write_laws
from trunkline.unity.plugin import Imported, Scene
from trunkline.unity.start import TwinComponent
from trunkline.unity.start_check import DOWN, PREFIX, TIP, at_rest, manifest_of, pull, scene_of, turns
from trunkline.unity.time_steps import steps_taken
from trunkline.unity.unpacked import model_of
from trunkline.unity.upm_package import MODEL

MM = 1e-3
STEP = max(steps_taken())
UPRIGHT = Rotation.identity()


@pytest.fixture(scope="module")
def files(arm_files):
    return arm_files


def rest_of(files) -> np.ndarray:
    return np.array([actuator.rest_length for actuator in manifest_of(files).actuators])


def off(scene: Scene, expected: np.ndarray) -> float:
    return float(np.linalg.norm(scene.site(TIP) - expected))


@pytest.mark.parametrize("turn", range(4))
@pytest.mark.parametrize("step", steps_taken())
def test_it_begins_at_rest_and_stays_there_with_nobody_sending_anything(files, turn, step):
    turned = turns(np.radians([0, 60, 120]).tolist())[turn]
    expected = at_rest(model_of(files), turned, rest_of(files))
    scene = scene_of(files, turned, step)
    scene.start()
    assert off(scene, expected) < 0.1 * MM
    scene.fixed_update(round(0.5 / step))
    assert off(scene, expected) < 0.1 * MM
    assert np.abs(scene.data.qvel).max() < 1e-3


def test_without_the_component_it_falls_and_it_would_have_been_pulled_before(files):
    """What the test above would miss if rest were where an arm begins anyway."""
    turned = turns([np.radians(60)])[0]
    expected = at_rest(model_of(files), turned, rest_of(files))
    scene = scene_of(files, turned, STEP, alone=True)
    scene.start()
    scene.fixed_update(round(0.5 / STEP))
    assert off(scene, expected) > 5 * MM
    at_0 = settle(model_of(files), np.zeros((1, 3)), gravity_in_base(0.0))
    hanging = settle(model_of(files), rest_of(files)[None], gravity_in_base(0.0))
    assert np.linalg.norm(at_0.position - hanging.position) > 1 * MM  # a command of 0, where now a pull of 0 is


def test_it_begins_where_the_pulls_that_are_set_hold_it(files):
    pulls = np.array([0.02, -0.02, -0.02])
    expected = at_rest(model_of(files), UPRIGHT, rest_of(files) - pulls)
    scene = scene_of(files, UPRIGHT, STEP)
    names = [PREFIX + actuator.name for actuator in manifest_of(files).actuators]
    scene.controls = dict(zip(names, pulls.tolist(), strict=True))
    scene.start()
    scene.fixed_update(round(0.5 / STEP))
    assert off(scene, expected) < 0.2 * MM
    assert off(scene, at_rest(model_of(files), UPRIGHT, rest_of(files))) > 10 * MM


def swinging(files, alone: bool = False) -> Scene:
    scene = scene_of(files, UPRIGHT, STEP, alone)
    scene.start()
    pull(scene)
    scene.fixed_update(40)
    return scene


def test_a_scene_that_is_compiled_anew_goes_on(files):
    scene, undisturbed = swinging(files), swinging(files)
    before = scene.data.act.copy()
    scene.recreate()
    np.testing.assert_array_equal(scene.data.act, before)
    assert before.any()
    for _ in range(round(0.5 / STEP)):
        scene.fixed_update()
        undisturbed.fixed_update()
        assert off(scene, undisturbed.site(TIP)) < 0.01 * MM


def test_the_plug_in_alone_forgets_activations(files):
    """As its source says; else there would be nothing to restore."""
    scene, undisturbed = swinging(files, alone=True), swinging(files, alone=True)
    angles = scene.data.qpos.copy()
    scene.recreate()
    assert not scene.data.act.any()
    np.testing.assert_array_equal(scene.data.qpos, angles)
    scene.fixed_update(20)
    undisturbed.fixed_update(20)
    assert off(scene, undisturbed.site(TIP)) > 1 * MM


def test_another_arm_that_comes_rests_and_the_first_goes_on(files):
    scene, undisturbed = swinging(files), swinging(files)
    scene.arms.append(Imported("other_", as_imported(files[MODEL].decode())))
    scene.components.append(TwinComponent(manifest_of(files), "other_"))
    scene.recreate()
    expected = at_rest(model_of(files), UPRIGHT, rest_of(files)) + [2.0, 0, 0]  # where the scene puts a second arm
    for _ in range(100):
        scene.fixed_update()
        undisturbed.fixed_update()
        assert off(scene, undisturbed.site(TIP)) < 0.01 * MM
        assert np.linalg.norm(scene.site("other_tip") - expected) < 0.1 * MM


@pytest.mark.parametrize(("turn", "most"), [(UPRIGHT, start.PEAKS * start.LONGEST_RISE), (turns([1.0])[0], 20)])
def test_an_arm_that_rests_already_and_one_that_finds_no_rest_start_straight(files, monkeypatch, turn, most):
    """Upright and even an arm hangs straight: its energy has no peak, so it is soon left."""
    monkeypatch.setattr(start, "MOST_STEPS", most)
    scene = scene_of(files, turn, STEP)
    scene.start()
    assert not scene.data.qpos.any()


def test_what_is_let_go_to_settle_is_put_back(files):
    scene = scene_of(files, UPRIGHT, STEP)
    scene.start()
    model = mujoco.MjModel.from_xml_string(as_imported(files[MODEL].decode()))
    described = manifest_of(files)
    write_laws(model, Laws(described.springs, described.dampers, described.diagonals))
    for field in ("tendon_stiffness", "tendon_frictionloss", "dof_frictionloss", "dof_damping", "jnt_stiffnesspoly"):
        np.testing.assert_array_equal(getattr(scene.model, field), getattr(model, field))
    assert model.tendon_frictionloss.any()
    assert described.branches


@pytest.mark.parametrize("bad", [np.nan, np.inf])
def test_a_control_that_is_no_number_is_held_at_the_last_that_was(files, bad):
    scene, undisturbed = swinging(files), swinging(files)
    name = PREFIX + manifest_of(files).actuators[0].name
    scene.controls[name] = bad
    for _ in range(20):
        scene.fixed_update()
        undisturbed.fixed_update()
        np.testing.assert_array_equal(scene.data.qpos, undisturbed.data.qpos)
    alone = swinging(files, alone=True)
    alone.controls[name] = bad
    with pytest.raises(RuntimeError, match="MuJoCo warns: mjWARN_BADCTRL"):
        alone.fixed_update(2)


def test_a_scene_moves_an_arm_as_mujoco_does(files):
    """Of one arm, the plug-in's model is the imported one, but for 32 bits in gravity and step."""
    scene = scene_of(files, UPRIGHT, STEP, alone=True)
    scene.start()
    model = mujoco.MjModel.from_xml_string(as_imported(files[MODEL].decode()))
    model.opt.timestep, model.opt.gravity[:] = np.float32(STEP), np.float32(DOWN)
    data = mujoco.MjData(model)
    mujoco.mj_step(model, data, 100)
    scene.fixed_update(100)
    np.testing.assert_allclose(scene.data.qpos, data.qpos, atol=1e-9)


def test_a_mount_that_is_turned_turns_gravity_and_carries_the_arm(files):
    """Below an MjMocapBody: exactly as an arm that stands still and whose gravity turns the other way."""
    turn, place = turns(np.radians([40.0]).tolist())[0], np.array([0.3, -0.2, 1.5])
    scene, still = scene_of(files, UPRIGHT, STEP), scene_of(files, UPRIGHT, STEP)
    scene.arms[0] = replace(scene.arms[0], mount="mount")
    for instance in (scene, still):
        instance.start()
        assert off(instance, at_rest(model_of(files), UPRIGHT, rest_of(files))) < 0.1 * MM
    mocap = scene.model.body("mount").mocapid[0]
    scene.data.mocap_pos[mocap], scene.data.mocap_quat[mocap] = place, turn.as_quat()[[3, 0, 1, 2]]
    still.model.opt.gravity[:] = turn.inv().apply(still.model.opt.gravity)
    for instance in (scene, still):
        instance.fixed_update(100)
    np.testing.assert_allclose(scene.site(TIP), place + turn.apply(still.site(TIP)), atol=1e-7)
    assert np.abs(still.data.qpos).max() > 0.01


def test_an_arm_below_a_mount_that_is_turned_starts_at_rest(files):
    turned = turns([np.radians(60)])[0]
    scene = scene_of(files, turned, STEP)
    scene.arms[0] = replace(scene.arms[0], mount="mount")
    scene.start()
    scene.fixed_update(round(0.5 / STEP))
    assert off(scene, at_rest(model_of(files), turned, rest_of(files))) < 0.1 * MM


def test_both_languages_settle_by_the_same_numbers():
    script = (CSHARP / "Twin.cs").read_text()
    constants = {name: float(value) for name, value in re.findall(r"private const \w+ _(\w+) = ([\d.e-]+);", script)}
    values = [constants[name] for name in ("still", "peaks", "longestRise", "mostSteps")]
    assert values == [start.STILL, start.PEAKS, start.LONGEST_RISE, start.MOST_STEPS]


