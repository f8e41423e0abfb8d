"""A basket in MuJoCo: what its parts weigh, on what it stands, by what it hangs."""

import mujoco
import numpy as np
import pytest

from trunkline.ar.hybrid.basket import Basket
from trunkline.ar.hybrid.friction import make_holding
from trunkline.ar.hybrid.objects import GRIP, GraspObject, object_geoms
from trunkline.ar.hybrid.worlds import SupportSurface, WorldGeometry
from trunkline.frames import STANDARD_GRAVITY

BASKET = GraspObject("basket", 0.03, 0.06, 0.2, "plastic", basket=Basket(0.12, 0.16, 0.22))
TOP = [0.0, 0.0, 0.3]


def world(object: GraspObject, height: float, hook: str | None = None) -> mujoco.MjModel:
    spec = mujoco.MjSpec()
    spec.option.timestep, spec.option.integrator = 1 / 480, mujoco.mjtIntegrator.mjINT_IMPLICITFAST
    spec.option.gravity = [0, 0, -STANDARD_GRAVITY]
    make_holding(spec)
    WorldGeometry(None, {"table": SupportSurface(TOP, [0.4, 0.4, 0.03], "wood")}, [0.0, 0.0, 1.2]).add_to(spec)
    object.add_to(spec, np.array([0.0, 0.0, height]), hook=hook)
    return spec.compile()


def test_its_inertia_is_that_of_its_geoms():
    """MuJoCo's own sum over geoms that weigh what the parts do."""
    spec = mujoco.MjSpec()
    body = spec.worldbody.add_body(name="object")
    model = world(BASKET, 1.0)
    for (name, part), number in zip(BASKET.parts().items(), object_geoms(model), strict=True):
        assert model.geom(number).name == f"object_{name}"
        body.add_geom(type=model.geom_type[number], size=model.geom_size[number], pos=model.geom_pos[number],
                      quat=model.geom_quat[number], mass=BASKET.mass * part.share)  # fmt: skip
    separate = spec.compile()
    body_values, expected = model.body("object"), separate.body("object")
    assert expected.mass == pytest.approx(body_values.mass)
    np.testing.assert_allclose(expected.ipos, 0, atol=1e-12)
    data = mujoco.MjData(separate)
    mujoco.mj_forward(separate, data)
    axes = data.ximat[1].reshape(3, 3)  # MuJoCo sorts principal axes
    np.testing.assert_allclose(axes @ np.diag(expected.inertia) @ axes.T, np.diag(body_values.inertia), atol=1e-9)


def test_its_bar_is_above_its_box_along_y():
    model = world(BASKET, 1.0)
    data = mujoco.MjData(model)
    mujoco.mj_forward(model, data)
    bar, box = data.geom("object_bar"), data.geom("object_box")
    np.testing.assert_allclose(data.site(GRIP).xpos, bar.xpos, atol=1e-12)
    np.testing.assert_allclose(bar.xpos - box.xpos, [0, 0, 0.03 + 0.22], atol=1e-12)
    np.testing.assert_allclose(np.abs(bar.xmat.reshape(3, 3)[:, 2]), [0, 1, 0], atol=1e-12)
    assert box.xpos[2] - 0.03 == pytest.approx(1.0 - BASKET.half_height)


def test_it_stands_still_on_a_table():
    model = world(BASKET, TOP[2] + BASKET.half_height + 1e-4)
    data = mujoco.MjData(model)
    mujoco.mj_step(model, data, 240)
    first = data.body("object").xpos.copy()
    mujoco.mj_step(model, data, 5 * 480)
    assert np.abs(data.body("object").xpos - first).max() < 1e-4
    assert first[2] == pytest.approx(TOP[2] + BASKET.half_height, abs=1e-3)


def test_rocking_on_an_edge_it_gains_no_energy():
    """Leaning by 0.4 rad about x it falls back onto its box. Heights are those of half a step ago, as speeds are of an
    integrator that adds velocities first: so a free fall keeps its energy."""
    lean, box = 0.4, BASKET.parts()["box"]
    model = world(BASKET, TOP[2] + BASKET.half_height * np.cos(lean) + box.half[1] * np.sin(lean))
    data = mujoco.MjData(model)
    data.joint("object").qpos[3:] = [np.cos(lean / 2), np.sin(lean / 2), 0, 0]
    energies, weight = [], BASKET.mass * STANDARD_GRAVITY
    for _ in range(3 * 480):
        before = data.joint("object").qpos[2]
        mujoco.mj_step(model, data)
        mujoco.mj_energyVel(model, data)
        height = (before + data.joint("object").qpos[2]) / 2
        energies.append(data.energy[1] + weight * height)
    lost = energies[0] - energies[-1]
    assert lost > 0.05
    assert (
        energies - np.minimum.accumulate(energies)
    ).max() < 2e-3 * weight  # as much as contacts that give by 2 mm store
    assert data.body("object").xpos[2] == pytest.approx(TOP[2] + BASKET.half_height, abs=1e-3)


@pytest.mark.parametrize("shape", ["cylinder", "box", "sphere", "toy"])
def test_other_objects_are_one_geom_wrapped_in_its_middle(shape):
    object = GraspObject(shape, 0.06, 0.1, 0.1, "plastic")
    model = world(object, 1.0)
    assert [model.geom(number).name for number in object_geoms(model)] == ["object_geom"]
    np.testing.assert_array_equal(object.grip, 0)


def test_a_bar_that_touches_its_box_is_refused_by_name():
    with pytest.raises(ValueError, match=r"basket.rise: found 0.1 m, expected at least the bar's diameter, 0.2 m"):
        GraspObject("basket", 0.2, 0.06, 0.2, "plastic", basket=Basket(rise=0.1))
