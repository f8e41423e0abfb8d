"""What a page draws is what the model shows."""

import mujoco
import numpy as np
import pytest
import trimesh
from point_cloud_utils import signed_distance_to_mesh

from trunkline.live.scene import MOST_TRIANGLES, SHELL_TRIANGLES, drawn, shells
from trunkline.panda.shipped import shipped_panda
from trunkline.unity.frame import unity_obj
from trunkline.unity.twin import MANIFEST

XML = """
<mujoco>
  <asset><material name="green" rgba="0 1 0 1"/></asset>
  <worldbody>
    <geom name="table" type="box" size="0.3 0.2 0.1" pos="1 0 -0.1" rgba="1 0 0 1"/>
    <body name="foot" pos="0 0 0.1">
      <geom name="foot" type="cylinder" size="0.1 0.1" material="green"/>
      <body name="link" pos="0 0 0.1">
        <joint name="link" axis="0 1 0"/>
        <geom name="link" type="capsule" fromto="0 0 0 0.4 0 0" size="0.03"/>
        <geom name="touches" type="sphere" size="0.3" group="3"/>
        <geom name="clear" type="sphere" size="0.3" rgba="1 1 1 0"/>
        <body name="bare" pos="0.1 0 0"><inertial pos="0 0 0" mass="1" diaginertia="1 1 1"/></body>
      </body>
    </body>
    <body name="cup" pos="1 0 0.1"><freejoint/><geom name="cup" type="box" size="0.04 0.04 0.06"/></body>
  </worldbody>
</mujoco>
"""


@pytest.fixture(scope="module")
def model() -> mujoco.MjModel:
    return mujoco.MjModel.from_xml_string(XML)


def test_bodies_are_those_that_are_seen_in_the_models_order(model):
    found = drawn(model)
    assert found.scene["bodies"] == ["foot", "link", "cup"]
    assert [model.body(int(body)).name for body in found.ids] == found.scene["bodies"]


def test_geoms_are_those_that_are_seen_each_on_its_body(model):
    geoms = drawn(model).scene["geoms"]
    assert [(geom["body"], geom["shape"]) for geom in geoms] == [
        (-1, "box"),
        (0, "cylinder"),
        (1, "capsule"),
        (2, "box"),
    ]
    assert geoms[0]["position"] == [1, 0, -0.1]
    assert geoms[0]["rgba"] == [1, 0, 0, 1]
    assert geoms[1]["rgba"] == [0, 1, 0, 1]  # of its material
    assert geoms[2]["size"][:2] == pytest.approx([0.03, 0.2])


def test_meshes_are_decimated_to_what_may_be_drawn_and_stay_where_they_are():
    panda = shipped_panda(0.05).compile()
    whole, small = drawn(panda, most_triangles=10**7).scene, drawn(panda).scene
    assert sum(len(mesh["faces"]) for mesh in whole["meshes"]) > 3 * 5 * MOST_TRIANGLES
    assert sum(len(mesh["faces"]) for mesh in small["meshes"]) <= 3 * MOST_TRIANGLES
    for before, after in zip(whole["meshes"], small["meshes"], strict=True):
        corners, kept = (np.reshape(mesh["vertices"], (-1, 3)) for mesh in (before, after))
        away, _, _ = signed_distance_to_mesh(kept, corners, np.reshape(before["faces"], (-1, 3)))
        assert np.quantile(np.abs(away), 0.99) < 0.002
        assert np.abs(away).max() < 0.005


def test_reach_of_the_mount_is_in_the_base_frame():
    ball = trimesh.creation.icosphere(subdivisions=5, radius=0.8).apply_translation([0.1, 0.2, 0.3])
    files = {
        "rigid.obj": unity_obj(np.asarray(ball.vertices), np.asarray(ball.faces)),
        MANIFEST: b'{"meshes": {"rigid": {"file": "rigid.obj"}}, "reach": {"sheets": {"around": 5, "along": 7}}}',
    }
    found = shells(files)
    assert found["shell"] == {"around": 5, "along": 7}
    reach = trimesh.Trimesh(*(np.reshape(found["reach"][name], (-1, 3)) for name in ("vertices", "faces")))
    assert len(reach.faces) <= SHELL_TRIANGLES < len(ball.faces)
    np.testing.assert_allclose(reach.center_mass, [0.1, 0.2, 0.3], atol=1e-3)
    assert reach.volume == pytest.approx(4 / 3 * np.pi * 0.8**3, rel=0.01)


def test_a_package_without_maps_has_no_shells():
    assert shells({MANIFEST: b'{"meshes": {}, "reach": {}}'}) == {"shell": None, "reach": None}
