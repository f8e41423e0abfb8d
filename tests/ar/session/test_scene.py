"""What a page draws is what the model shows."""

import mujoco
import numpy as np
import pytest
import trimesh
from point_cloud_utils import signed_distance_to_mesh

from trunkline.ar.session.bodies import drawn_bodies
from trunkline.ar.session.scene import MOST_TRIANGLES, SHELL_TRIANGLES, scene
from trunkline.kinematics.panda.maker_model import shipped_panda

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


@pytest.fixture(scope="module")
def drawing(model) -> dict:
    return scene(model, drawn_bodies(model), empty(), 0.5)


def empty() -> dict[str, np.ndarray]:
    """Maps of a robot that reaches nothing."""
    return {"rigid": np.ones((4, 4, 4)), "rigid_origin": np.zeros(3), "rigid_spacing": np.array(0.1)}


def test_bodies_are_those_with_geoms_in_the_models_order(drawing):
    assert drawing["bodies"] == ["foot", "link", "cup"]


def test_geoms_are_those_that_are_seen_each_on_its_body(drawing):
    geoms = drawing["geoms"]
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
    meshes = scene(panda, drawn_bodies(panda), empty(), 0.5)["meshes"]
    assert panda.mesh_facenum.sum() > 5 * MOST_TRIANGLES
    assert sum(len(mesh["faces"]) for mesh in meshes) <= 3 * MOST_TRIANGLES
    assert len(meshes) == panda.nmesh
    for number, mesh in enumerate(meshes):
        corners = panda.mesh_vert[panda.mesh_vertadr[number] :][: panda.mesh_vertnum[number]].astype(float)
        faces = panda.mesh_face[panda.mesh_faceadr[number] :][: panda.mesh_facenum[number]]
        vertices = np.reshape(mesh["vertices"], (-1, 3))
        away, _, _ = signed_distance_to_mesh(vertices, corners, faces.astype(np.int64))
        assert np.quantile(np.abs(away), 0.99) < 0.002
        assert np.abs(away).max() < 0.005


def test_a_small_mesh_is_left_as_it_is():
    spec = mujoco.MjSpec()
    spec.add_mesh(name="wedge", uservert=[0, 0, 0, 1, 0, 0, 0, 1, 0, 0, 0, 1])
    spec.worldbody.add_geom(type=mujoco.mjtGeom.mjGEOM_MESH, meshname="wedge")
    model = spec.compile()
    assert len(scene(model, (), empty(), 0.5)["meshes"][0]["faces"]) == 3 * 4


def test_reach_of_the_mount_is_a_surface_in_the_base_frame():
    axis = -1.0 + 0.05 * np.arange(41)
    x, y, z = np.meshgrid(axis, axis, axis, indexing="ij")
    ball = np.sqrt((x - 0.1) ** 2 + y**2 + (z - 0.2) ** 2) - 0.6
    maps = {"rigid": ball, "rigid_origin": np.full(3, -1.0), "rigid_spacing": np.array(0.05)}
    reach = scene(mujoco.MjSpec().compile(), (), maps, 0.5)["reach"]
    surface = trimesh.Trimesh(*(np.reshape(reach[name], (-1, 3)) for name in ("vertices", "faces")))
    assert len(surface.faces) <= SHELL_TRIANGLES
    np.testing.assert_allclose(surface.center_mass, [0.1, 0, 0.2], atol=2e-3)
    assert surface.volume == pytest.approx(4 / 3 * np.pi * 0.6**3, rel=0.02)


def test_a_package_without_maps_has_no_reach(drawing):
    assert drawing["shell"] is None
    assert drawing["reach"] is None
