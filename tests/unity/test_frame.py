"""Unity's frame: what moves and turns in MuJoCo lands, converted, where Unity's own maths puts it."""

import numpy as np
import pytest
import trimesh
from hypothesis import given
from hypothesis import strategies as st

from tests.support.unity_frame import unity_quaternion
from trunkline.frames import rotation_from_wxyz
from trunkline.unity.frame import unity_obj, unity_position, unity_volume

numbers = st.floats(-1, 1)


def rotate(xyzw, vector):
    """Unity's `Quaternion * Vector3`: the Hamilton product, whatever the handedness of the frame."""
    axis, w = xyzw[:3], xyzw[3]
    return vector + 2 * np.cross(axis, np.cross(axis, vector) + w * vector)


@given(st.tuples(numbers, numbers, numbers, numbers), st.tuples(numbers, numbers, numbers))
def test_rotating_and_converting_commute(quaternion, vector):
    quaternion, vector = np.array(quaternion), np.array(vector)
    norm = np.linalg.norm(quaternion)
    if norm < 1e-2:
        return
    quaternion /= norm
    moved = unity_position(rotation_from_wxyz(quaternion).apply(vector))
    np.testing.assert_allclose(rotate(unity_quaternion(quaternion), unity_position(vector)), moved, atol=1e-9)


def test_up_is_y_and_the_arm_hangs_down():
    assert unity_position(np.array([0, 0, -9.81])).tolist() == [0, -9.81, 0]
    assert unity_quaternion(np.array([1.0, 0, 0, 0])).tolist() == [0, 0, 0, -1]


def unity_import(obj: bytes) -> tuple[np.ndarray, np.ndarray]:
    """What Unity makes of an OBJ: x negated, and the order of each face's corners turned round."""
    rows = [line.split() for line in obj.decode().splitlines()]
    vertices = np.array([row[1:] for row in rows if row[0] == "v"], float) * [-1, 1, 1]
    faces = np.array([row[1:] for row in rows if row[0] == "f"], int)[:, ::-1] - 1
    return vertices, faces


def test_a_mesh_arrives_in_place_with_its_faces_outwards():
    box = trimesh.creation.box(extents=(0.1, 0.2, 0.4))
    box.apply_translation([0.3, -0.1, 0.5])
    vertices, faces = unity_import(unity_obj(box.vertices, box.faces))
    np.testing.assert_allclose(vertices, unity_position(box.vertices), atol=1e-6)
    first, second, third = vertices[faces].transpose(1, 0, 2)
    outwards = (first + second + third) / 3 - vertices.mean(axis=0)
    left_handed_normal = np.cross(second - first, third - first)  # Unity: front faces run clockwise
    assert (np.einsum("fi,fi->f", left_handed_normal, outwards) > 0).all()


def test_a_volume_is_read_with_x_fastest():
    shape = (2, 3, 4)  # MuJoCo's x, y, z
    values = np.arange(24.0).reshape(shape)
    texels = np.frombuffer(unity_volume(values), "<f2")
    width, height = shape[0], shape[2]
    for x, y, z in np.ndindex(shape):
        assert texels[x + width * (z + height * y)] == values[x, y, z]


@pytest.mark.parametrize("value", [0.123456, -1.5, 60000.0])
def test_half_floats_keep_three_digits(value):
    assert np.frombuffer(unity_volume(np.full((1, 1, 1), value)), "<f2")[0] == pytest.approx(value, rel=1e-3)
