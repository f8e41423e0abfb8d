"""The units' geoms: read from the arm, of the unit's shape, and closing on each other at the joint's limit."""

import mujoco
import numpy as np
import pytest
from scipy.spatial import ConvexHull

from trunkline.ar.hybrid.compose import compose
from trunkline.ar.hybrid.friction import SOLIMP, SOLREF
from trunkline.errors import InputError
from trunkline.kinematics.panda.mounts import FixedMount
from trunkline.model.arm.contact_geometry import TOUCH, add_touch, outline, read_geometry, unit_corners
from trunkline.model.arm.mjcf import unit_name

FREE = FixedMount("fixed")


def test_the_arms_file_says_its_geometry(arm, chain):
    read = read_geometry(mujoco.MjSpec.from_string(arm.to_xml()))
    for value, expected in zip((read.lengths, read.widths, read.joint_range), (chain.lengths, chain.widths,
                               chain.joint_range), strict=True):  # fmt: skip
        np.testing.assert_allclose(value, expected, rtol=1e-4)  # a file has six digits, and lengths are differences
    assert read.ratio == pytest.approx(chain.ratio, rel=1e-4)


def test_a_geom_is_the_units_solid_of_revolution(chain):
    """Its volume against Pappus' theorem, its cross-sections against the circle."""
    for unit in (0, 11, 23):
        rows = outline(chain, unit)
        (r0, z0), (r1, z1) = rows[:-1].T, rows[1:].T
        volume = np.sum(np.pi / 3 * (r0**2 + r0 * r1 + r1**2) * (z0 - z1))
        corners = unit_corners(chain, unit)
        assert ConvexHull(corners).volume == pytest.approx(volume, rel=0.006)
        ring = corners[1:25]
        radius = np.linalg.norm(ring[:, :2], axis=1)
        middles = np.linalg.norm((ring + np.roll(ring, 1, axis=0))[:, :2] / 2, axis=1)
        np.testing.assert_allclose(radius, chain.widths[unit] / 2, rtol=0.005)
        np.testing.assert_allclose(middles, chain.widths[unit] / 2, rtol=0.005)


def test_the_compiled_mesh_has_those_corners(arm, chain):
    model = compose(arm, FREE).compile()
    data = mujoco.MjData(model)
    mujoco.mj_kinematics(model, data)
    for unit in (0, 23):
        geom = model.geom(f"{unit_name(unit)}{TOUCH}")
        mesh = model.geom_dataid[geom.id]
        points = model.mesh_vert[model.mesh_vertadr[mesh] :][: model.mesh_vertnum[mesh]]
        world = points @ data.geom_xmat[geom.id].reshape(3, 3).T + data.geom_xpos[geom.id]
        expected = unit_corners(chain, unit) + data.xpos[model.body(unit_name(unit)).id]
        gaps = np.linalg.norm(world[:, None] - expected, axis=2).min(axis=0)
        assert gaps.max() < 1e-6


def test_neighbours_close_on_each_other_at_the_joints_limit(chain):
    """The wedge between the upper unit's lower face and the lower one's upper face is the joint's range."""
    for unit in (0, 12):
        rim, end = outline(chain, unit)[2:]
        upper_face = np.arctan2(*(rim - end)[::-1])
        lower_face = np.arctan2(*outline(chain, unit + 1)[1][::-1])
        assert upper_face - lower_face == pytest.approx(chain.joint_range[unit])
        assert rim[0] == pytest.approx(outline(chain, unit + 1)[1, 0])


def test_geoms_weigh_nothing_and_neighbours_do_not_touch(arm):
    bare, touching = compose(arm, FREE, touch=False).compile(), compose(arm, FREE).compile()
    np.testing.assert_array_equal(bare.body_mass, touching.body_mass)
    np.testing.assert_array_equal(bare.body_inertia, touching.body_inertia)
    np.testing.assert_array_equal(bare.dof_invweight0, touching.dof_invweight0)
    data = mujoco.MjData(touching)
    rng = np.random.default_rng(0)
    for _ in range(20):  # bends within limits, all to one side or mixed
        data.qpos[:] = 0
        for name in (f"{unit_name(unit)}_y" for unit in range(24)):
            data.joint(name).qpos[:] = rng.uniform(0, 0.1)
        mujoco.mj_forward(touching, data)
        assert data.ncon == 0


def test_an_arm_without_visible_units_is_refused():
    spec = mujoco.MjSpec()
    spec.worldbody.add_body(name="unit_01")
    with pytest.raises(InputError, match="unit_01_geom"):
        add_touch(spec, (0.4, 0.002, 1e-4), SOLREF, SOLIMP)
