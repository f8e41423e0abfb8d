"""The triangles that a page draws are the model's geoms."""

import base64

import mujoco
import numpy as np
import pytest
import trimesh

from trunkline.live.scene import CREASE, MOST_TRIANGLES, as_json, scene_of

XML = """
<mujoco>
  <worldbody>
    <geom name="floor" type="plane" size="2 1 0.1"/>
    <geom name="endless" type="plane" size="0 0 0.1"/>
    <geom name="table" type="box" size="0.3 0.2 0.1" pos="1 0 -0.1" rgba="1 0 0 1"/>
    <body name="foot" pos="0 0 0.1">
      <geom name="foot" type="cylinder" size="0.1 0.1"/>
      <body name="link" pos="0 0 0.1">
        <joint name="link" axis="0 1 0"/>
        <geom name="link" type="capsule" fromto="0 0 0 0.4 0 0" size="0.03"/>
        <geom name="hidden" type="sphere" size="0.3" group="3"/>
        <geom name="eye" type="ellipsoid" size="0.05 0.04 0.02" pos="0.4 0 0.1"/>
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
def scene(model):
    return scene_of(model)


def test_bodies_are_those_that_are_seen_in_the_models_order(scene, model):
    assert scene.bodies == ["foot", "link", "cup"]
    assert [model.body(int(body)).name for body in scene.ids] == scene.bodies


def test_parts_are_robot_world_and_things(scene):
    rows = {name: set(part.bodies.tolist()) for name, part in scene.parts.items()}
    assert rows == {"robot": {0, 1}, "world": {0}, "things": {2}}


@pytest.mark.parametrize(
    ("part", "row", "low", "high"),
    [
        ("robot", 0, (-0.1, -0.1, -0.1), (0.1, 0.1, 0.1)),
        ("robot", 1, (-0.03, -0.04, -0.03), (0.45, 0.04, 0.12)),  # capsule and ellipsoid, without what is hidden
        ("things", 2, (-0.04, -0.04, -0.06), (0.04, 0.04, 0.06)),
        ("world", 0, (-2, -1, -0.2), (2, 1, 0)),
    ],
)
def test_triangles_fill_their_geoms(scene, part, row, low, high):
    found = scene.parts[part]
    corners = found.positions[found.bodies == row]
    np.testing.assert_allclose(corners.min(axis=0), low, atol=1e-3)
    np.testing.assert_allclose(corners.max(axis=0), high, atol=1e-3)


def test_faces_look_outwards_and_are_shaded_so(scene):
    for part in scene.parts.values():
        corners = part.positions[part.faces]
        across = np.cross(corners[:, 1] - corners[:, 0], corners[:, 2] - corners[:, 0])
        across /= np.linalg.norm(across, axis=1, keepdims=True)
        assert (np.einsum("fk,fck->fc", across, part.normals[part.faces]) > np.cos(CREASE)).all()
    robot = scene.parts["robot"]
    foot = trimesh.Trimesh(robot.positions, robot.faces[robot.bodies[robot.faces[:, 0]] == 0])
    assert foot.volume > 0.9 * np.pi * 0.1**2 * 0.2


def test_json_holds_the_same_numbers(scene):
    found = as_json(scene)
    robot, packed = scene.parts["robot"], found["parts"]["robot"]

    def read(name: str, kind: str, width: int) -> np.ndarray:
        return np.frombuffer(base64.b64decode(packed[name]), kind).reshape(-1, width)

    assert (packed["vertices"], packed["triangles"]) == (len(robot.positions), len(robot.faces))
    np.testing.assert_array_equal(read("positions", "<f4", 3), robot.positions)
    np.testing.assert_array_equal(read("indices", "<u4", 3), robot.faces)
    np.testing.assert_array_equal(read("bodies", "<u2", 1)[:, 0], robot.bodies)
    np.testing.assert_array_equal(read("colours", "u1", 3), robot.colours)
    np.testing.assert_allclose(read("normals", "i1", 3) / 127, robot.normals, atol=0.5 / 127 + 1e-6)


def test_meshes_are_decimated_to_what_may_be_drawn_and_keep_their_size():
    panda = pytest.importorskip("trunkline.panda.shipped").shipped_panda(0.05).compile()
    whole, small = scene_of(panda, most_triangles=10**6), scene_of(panda)
    assert len(whole.parts["robot"].faces) > 100_000
    assert len(small.parts["robot"].faces) <= MOST_TRIANGLES
    for row in range(len(small.bodies)):
        sizes = [
            np.ptp(one.parts["robot"].positions[one.parts["robot"].bodies == row], axis=0) for one in (whole, small)
        ]
        np.testing.assert_allclose(sizes[1], sizes[0], atol=0.004)
