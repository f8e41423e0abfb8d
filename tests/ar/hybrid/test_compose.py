"""One model of parts: the arm in it is the calibrated one, wherever it hangs."""

import mujoco
import numpy as np
import pytest
from scipy.spatial.transform import Rotation

from tests.ar.hybrid.conftest import CONF, hybrid_settings
from trunkline.ar.hybrid.compose import Placed, compose, panda_joints
from trunkline.errors import InputError
from trunkline.frames import STANDARD_GRAVITY, gravity_in_base, wxyz_from_rotation
from trunkline.kinematics.panda.kinematics import mount_pose
from trunkline.kinematics.panda.mounts import FixedMount
from trunkline.model.arm_model import ArmModel
from trunkline.model.simulation.motion import batch_of, hold, move

STEPS = 100
PULL = 0.03  # m


def moved(model, gravity=None):
    """Angles of the arm's hinges while a cable is drawn in. Shape (STEPS, n)."""
    batch = batch_of(model, 1)
    if gravity is not None:
        batch.expand("opt.gravity")[:] = gravity
    cables = [model.actuator(f"tendon_{number}_position").id for number in (1, 2, 3)]
    straight = np.zeros((1, model.nu))
    straight[0, cables] = model.tendon_length0[model.actuator_trnid[cables, 0]]
    hold(batch, model, straight)
    controls = np.tile(straight, (1, STEPS, 1))
    controls[:, :, cables[0]] -= PULL
    hinges = [model.joint(f"unit_{unit:02d}_{axis}").qposadr[0] for unit in range(1, 25) for axis in "xy"]
    return move(batch, controls, ("qpos",))["qpos"][0][:, hinges]


def test_the_attached_arm_moves_as_by_itself(arm):
    """Geoms change nothing of a motion in which nothing touches; elliptic cones and impratio no more than rounding,
    which rubbing cables magnify, step by step."""
    alone, bare = moved(arm.compile()), moved(compose(arm, FixedMount("fixed"), touch=False).compile())
    touching = moved(compose(arm, FixedMount("fixed")).compile())
    assert np.ptp(alone, axis=0).max() > 0.2
    np.testing.assert_allclose(touching, bare, atol=1e-9)
    np.testing.assert_allclose(bare[: STEPS // 2], alone[: STEPS // 2], atol=1e-10)
    np.testing.assert_allclose(bare, alone, atol=1e-5)


def test_a_tilted_mount_is_tilted_gravity(arm):
    """Turning the mount about its y by θ is gravity turned by θ in the base frame."""
    turn = Rotation.from_euler("y", 1.0)
    tilted = FixedMount("fixed", [0.3, 0.1, 0.9], list(wxyz_from_rotation(turn)))
    np.testing.assert_allclose(turn.inv().apply([0, 0, -9.80665]), gravity_in_base(1.0), atol=1e-12)
    angles, expected = moved(compose(arm, tilted).compile()), moved(arm.compile(), gravity_in_base(1.0))
    assert np.ptp(expected, axis=0).max() > 0.2
    np.testing.assert_allclose(angles, expected, atol=1e-4)  # where cables turn round, friction magnifies rounding


def test_the_arm_hangs_from_the_flange(arm):
    robot = hybrid_settings(robot="panda").robot
    model = compose(arm, robot).compile()
    data = mujoco.MjData(model)
    q = np.array([0.3, -0.2, 0.1, -1.9, 0.2, 1.7, 0.5])
    data.qpos[panda_joints(model)] = q
    mujoco.mj_kinematics(model, data)
    position, rotation = (values[0] for values in mount_pose(q[None], robot.mount_offset))
    np.testing.assert_allclose(data.body("base").xpos, position, atol=1e-9)
    np.testing.assert_allclose(data.site("tip").xpos, position + 0.507 * rotation[:, 2], atol=1e-6)
    hole = data.site("base_tendon_1").xpos - position
    np.testing.assert_allclose(hole / np.linalg.norm(hole), rotation[:, 0], atol=1e-9)  # azimuth 0: over the mount's x
    assert ArmModel(model).capstan_friction == ArmModel(arm.compile()).capstan_friction > 0


def test_options_are_the_arms(arm):
    model = compose(arm, hybrid_settings(robot="panda").robot).compile()
    assert model.opt.timestep == arm.option.timestep
    assert model.opt.integrator == arm.option.integrator
    assert (model.opt.cone, model.opt.noslip_iterations) == (mujoco.mjtCone.mjCONE_ELLIPTIC, 0)
    assert model.opt.impratio >= 10
    np.testing.assert_array_equal(model.opt.gravity, [0, 0, -STANDARD_GRAVITY])


def test_the_saved_model_is_the_model(arm, tmp_path):
    chosen = hybrid_settings(robot="fixed", world="lab", object="box")
    spec = compose(arm, chosen.robot, chosen.world, Placed(chosen.object, np.array([0.6, 0, 0.2]), hanging=True))
    model = spec.compile()
    (tmp_path / "hybrid.xml").write_text(spec.to_xml())
    read = mujoco.MjModel.from_xml_path(str(tmp_path / "hybrid.xml"))
    np.testing.assert_allclose(read.body_mass, model.body_mass, rtol=1e-5)
    np.testing.assert_allclose(read.eq_data, model.eq_data, atol=1e-5)
    np.testing.assert_allclose(moved(read), moved(model), atol=1e-3)  # of its six digits


@pytest.mark.parametrize(("group", "name"), [(path.parent.name, path.stem) for path in sorted(CONF.glob("*/*.yaml"))])
def test_every_choice_makes_a_model_in_which_nothing_touches_at_first(arm, group, name):
    chosen = hybrid_settings(**({"robot": "fixed"} | {group: name}))
    top = np.array(chosen.world.surfaces["table"].top if chosen.world.surfaces else [0.5, 0.3, 0.0])
    placed = Placed(chosen.object, top + [0, 0, chosen.object.half_height + 1e-4])
    model = compose(arm, chosen.robot, chosen.world, placed).compile()
    data = mujoco.MjData(model)
    if group == "robot" and name == "panda":
        data.qpos[panda_joints(model)] = chosen.robot.ready
    mujoco.mj_forward(model, data)
    assert data.ncon == 0


def test_what_hangs_needs_a_hook(arm):
    chosen = hybrid_settings(robot="fixed", world="empty")
    with pytest.raises(InputError, match="world.hook"):
        compose(arm, chosen.robot, chosen.world, Placed(chosen.object, np.zeros(3), hanging=True))


def test_a_pose_beyond_a_joints_range_is_refused_by_its_name():
    robot = hybrid_settings(robot="panda").robot
    with pytest.raises(ValueError, match="joint_4: found 0.5 rad"):
        type(robot)(**vars(robot) | {"ready": [0, 0, 0, 0.5, 0, 1, 0]})
