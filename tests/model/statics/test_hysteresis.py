"""Both ends of the friction band, against MuJoCo drawn in, and let go again, slowly with its friction on."""

import mujoco
import numpy as np
import pytest

from tests.support.bent_chain import stump, stump_spec
from tests.support.small_arm import small_spec
from trunkline.frames import gravity_in_base
from trunkline.model.arm.joints import JenkinsElement, Joints, MaxwellElement, add_elements
from trunkline.model.statics.chain import read_chain
from trunkline.model.statics.equilibria import equilibrium
from trunkline.model.statics.hysteresis import friction_band, model_friction

GRAVITY = gravity_in_base(0.6)
TENSIONS = np.array([[24.0, 9.0, 0.0]])
# they slip at small bends, as all joints bend by more
SLIDERS = [JenkinsElement(1.0, 0.005), JenkinsElement(0.5, 0.01)]


def rubbing_stump(tendon_friction=1.0, joint_friction=0.0, sliders=()):
    """The stump, heavily damped so that it follows slow motors without swinging, its friction as dry as it gets."""
    spec = stump_spec()
    add_elements(spec, Joints(sliders=list(sliders)), 1e-5)
    model = spec.compile()
    model.tendon_frictionloss[:], model.dof_frictionloss[:] = tendon_friction, joint_friction
    model.tendon_solimp_fri[:, :2] = model.dof_solimp[:, :2] = 0.9999
    model.tendon_solref_fri[:, 0] = model.dof_solref[:, 0] = 0.002
    model.dof_damping[:] = 0.1 * model.jnt_stiffness[model.dof_jntid]
    model.opt.gravity[:] = GRAVITY
    return model


def tip_after(model, commands):
    """Tip in the base frame after moving the motors through `commands`, 1.5 s for each step, and half a second more."""
    data = mujoco.MjData(model)
    data.ctrl[:] = data.act[:] = commands[0]
    for start, end in zip(commands[:-1], commands[1:], strict=True):
        for share in np.linspace(0, 1, round(1.5 / model.opt.timestep)):
            data.ctrl[:] = start + share * (end - start)
            mujoco.mj_step(model, data)
    for _ in range(round(0.5 / model.opt.timestep)):
        mujoco.mj_step(model, data)
    return data.site("tip").xpos - data.body("base").xpos


@pytest.mark.parametrize(
    ("friction", "agreement"),
    [((1.0, 0.0), 0.05), ((0.0, 0.02), 0.15), ((0.0, 0.0, SLIDERS), 0.1)],
    ids=["tendons", "joints", "sliders"],
)
def test_band_ends_where_mujoco_stops_on_the_way_in_and_on_the_way_back(friction, agreement):
    model = rubbing_stump(*friction)
    chain = read_chain(model)
    band = friction_band(chain, TENSIONS, GRAVITY[None], *model_friction(model))
    rest = equilibrium(chain, TENSIONS, GRAVITY)
    steps = np.array([0.0, 0.25, 0.5, 0.75, 1.0, 1.3])[:, None]
    way = equilibrium(chain, steps * TENSIONS, GRAVITY)
    commands = way.lengths - steps * TENSIONS / chain.gain
    loaded = tip_after(model, commands[:5])
    unloaded = tip_after(model, commands[[0, 1, 2, 3, 4, 5, 4]])
    width = np.linalg.norm(band.loaded - band.unloaded)
    assert width > 5e-4
    assert np.linalg.norm(loaded - band.loaded[0]) < agreement * width
    assert np.linalg.norm(unloaded - band.unloaded[0]) < agreement * width
    assert np.linalg.norm(band.loaded - rest.position) < width


def test_no_friction_no_band():
    chain = read_chain(stump())
    band = friction_band(chain, TENSIONS, GRAVITY[None], np.zeros(3), np.zeros((chain.units, 2)))
    rest = equilibrium(chain, TENSIONS, GRAVITY)
    np.testing.assert_allclose(band.loaded, rest.position, atol=1e-8)
    np.testing.assert_allclose(band.unloaded, rest.position, atol=1e-8)


def test_band_grows_in_proportion_to_small_friction():
    chain = read_chain(stump())
    widths = []
    for share in (0.01, 0.02):
        band = friction_band(chain, TENSIONS, GRAVITY[None], np.full(3, share), np.full((chain.units, 2), share / 100))
        widths.append(np.linalg.norm(band.loaded - band.unloaded))
    assert widths[1] == pytest.approx(2 * widths[0], rel=0.02)


def test_a_slider_is_dry_friction_of_its_joint_and_a_branch_is_none():
    """Both hang on tendons of their own, which are none of the cables."""
    joints, bands = Joints([MaxwellElement(0.3, 0.5)], [JenkinsElement(0.2, 0.02), JenkinsElement(0.1, 0.01)]), []
    for elements, friction in ((joints, 0.0), (Joints(), 0.2 * 0.02 + 0.1 * 0.01), (Joints(joints.branches), 0.0)):
        spec = small_spec()
        add_elements(spec, elements, 1e-5)
        model = spec.compile()
        model.tendon_frictionloss[:] = 0
        model.dof_frictionloss[:] += friction * model.jnt_stiffness[model.dof_jntid]
        bands.append(friction_band(read_chain(model), TENSIONS / 10, GRAVITY[None], *model_friction(model)))
    assert bands[0].width > 1e-3 > 1e-6 > bands[2].width
    np.testing.assert_allclose(bands[0].loaded, bands[1].loaded, atol=1e-9)
    np.testing.assert_allclose(bands[0].unloaded, bands[1].unloaded, atol=1e-9)
