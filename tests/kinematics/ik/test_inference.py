"""The network's file is asked for poses alone: whatever else is an error of one line."""

import numpy as np
import onnx
import onnxruntime
import pytest
import torch

from trunkline.errors import InputError
from trunkline.frames import STANDARD_GRAVITY
from trunkline.kinematics.ik.inference import ask, tilts_of
from trunkline.kinematics.ik.inputs import gravity_of, position_of
from trunkline.kinematics.ik.network import InverseKinematics
from trunkline.kinematics.ik.onnx import TrialsAtRest, to_onnx
from trunkline.kinematics.residual.residual_map import ResidualMap, RestingPoses

POSE = np.array([[0.3, 0.1, 0.0, -0.4, 1.0, 0.0, 0.0, 0.0], [0.2, 0.1, 0.1, -0.3, 0.6, 0.0, -0.8, 0.0]])
QUATERNION = slice(4, 8)


def session(model) -> onnxruntime.InferenceSession:
    return onnxruntime.InferenceSession(model.SerializeToString(), providers=["CPUExecutionProvider"])


@pytest.fixture(scope="module")
def model():
    commands = np.array([[0.4, 0.5, 0.6], [0.5, 0.6, 0.7]])
    return to_onnx(InverseKinematics(8, POSE, commands, commands + 0.01), ["a", "b", "c"], 0.05)


@pytest.fixture(scope="module")
def network(model):
    return session(model)


def changed(row, columns, value):
    pose = POSE.copy()
    pose[row, columns] = value
    return pose


def test_it_answers_as_the_file_does_for_either_sign_and_rounded_quaternions(network):
    expected = network.run(None, {"pose": POSE.astype(np.float32)})[0]
    np.testing.assert_array_equal(ask(network, POSE)["commands"], expected)
    np.testing.assert_array_equal(ask(network, POSE * np.repeat([1, -1], 4))["commands"], expected)
    assert ask(network, POSE.astype(np.float32).round(3).tolist())["commands"].shape == (2, 3)
    assert ask(network, POSE[:0])["commands"].shape == (0, 3)


@pytest.mark.parametrize(
    ("poses", "problem"),
    [
        (changed(1, 2, np.nan), r"pose 1: y: found nan, expected a finite number"),
        (changed(0, 0, np.inf), r"pose 0: theta_g: found inf, expected a finite number"),
        (changed(0, 3, -1e300), r"pose 0: z: found -1e\+300, expected a finite number"),
        (changed(0, 4, np.nan), r"pose 0: qw: found nan"),
        (changed(1, QUATERNION, 0.0), r"pose 1: found a quaternion of length 0, expected unit length"),
        (changed(0, QUATERNION, [2.0, 0, 0, 0]), r"pose 0: found a quaternion of length 2, expected unit length"),
        (changed(0, QUATERNION, [0.99, 0, 0, 0]), r"pose 0: found a quaternion of length 0.99, expected unit length"),
        (POSE[0], r"poses: found shape \(8,\), expected \(N, 8\): theta_g, x, y, z, qw, qx, qy, qz"),
        (POSE[:, :7], r"poses: found shape \(2, 7\), expected \(N, 8\)"),
        (POSE[None], r"poses: found shape \(1, 2, 8\)"),
        ([["a"] * 8], r"poses: could not convert string to float.* expected numbers of shape \(N, 8\)"),
        ([[1.0], [1.0, 2.0]], r"poses: .*expected numbers of shape \(N, 8\)"),
    ],
)
def test_what_is_no_pose_is_an_error(network, poses, problem):
    with pytest.raises(InputError, match=problem):
        ask(network, poses)


def test_an_answer_that_is_not_finite_is_an_error(model):
    broken = onnx.ModelProto.FromString(model.SerializeToString())
    (middle,) = (tensor for tensor in broken.graph.initializer if tensor.name == "middle")
    middle.CopyFrom(onnx.numpy_helper.from_array(np.array([np.nan, 0, 0], np.float32), "middle"))
    with pytest.raises(InputError, match="pose 0: found commands .*nan"):
        ask(session(broken), POSE)


def test_a_network_of_somebody_else_is_an_error(model):
    other = onnx.ModelProto.FromString(model.SerializeToString())
    del other.metadata_props[:]
    with pytest.raises(InputError, match="found no 'inputs' in the file's metadata"):
        ask(session(other), POSE)


def test_a_tip_foreseen_far_from_its_target_is_doubted(network):
    tip = ask(network, POSE)["tip"].astype(float)
    for distance, doubtful in ((0.01, False), (0.06, True)):
        near = POSE.copy()
        for _ in range(200):  # where the network foresees the tip that it is asked for, but for `distance`
            near[:, 1:4] = ask(network, near)["tip"] + [0, 0, distance]
        np.testing.assert_array_equal(ask(network, near)["doubtful"], doubtful)
    assert np.isfinite(tip).all()


@pytest.mark.parametrize(
    ("most", "tilts", "pulls", "unsure"),
    [(11.9, (90, 90), (5, 7, -30), True), (12.1, (90, 90), (5, 7, -30), False), (12.1, (90, 10), (5, 7, 0), True),
     (12.1, (10, 90), (5, 7, 0), False), (12.1, (90, 10), (0.9, 0.9, 0), False), (12.1, (10, 90), (0.9, 0, 0), True),
     (None, (90, 90), (0, 0, 0), True)],
)  # fmt: skip
def test_beyond_what_a_certificate_vouches_for_it_is_unsure_and_without_one_everywhere(most, tilts, pulls, unsure):
    """The mount is tilted by 17 and 11 deg. What a motor lets out makes up for nothing; pulls in mm."""
    commands = np.tile([0.4, 0.5, 0.6], (2, 1))
    network = InverseKinematics(8, POSE, commands, commands + 0.01)
    sure = None if most is None else TrialsAtRest(commands[0] + 1e-3 * np.array(pulls), 1e-3 * most, *tilts)
    assert ask(session(to_onnx(network, ["a", "b", "c"], 0.05, sure)), POSE)["unsure"].tolist() == [unsure] * 2


GRAVITIES = {7: np.zeros((2, 0)), 8: np.array([[0.3], [-0.4]]), 10: np.array([[0.6, 0.0, -0.8], [0.0, 0.6, -0.8]])}


@pytest.mark.parametrize("gravity", GRAVITIES.values(), ids=GRAVITIES)
def test_with_a_residual_map_commands_are_for_the_twin_s_tip_less_the_map_and_the_tip_is_the_arm_s(gravity):
    """The map is one that pulls and gravity change by tenths of a millimetre from pose to pose, at 2 cm in the middle;
    a last step changes hardly anything."""
    poses = np.column_stack([gravity, POSE[:, 1:]])
    commands, rng = np.array([[0.4, 0.5, 0.6], [0.41, 0.52, 0.58]]), np.random.default_rng(0)
    torch.manual_seed(0)  # steps come to rest for networks that are not too steep, as trained ones are
    network, straight = InverseKinematics(8, poses, commands, commands + 0.01), np.array([0.42, 0.53, 0.6])
    down = np.tile([0.0, 0.0, -STANDARD_GRAVITY], (6, 1)) + rng.normal(size=(6, 3)) * (gravity.shape[1] > 0)
    learnt = ResidualMap(RestingPoses(rng.uniform(0, 0.03, (6, 3)), down * (gravity.shape[1] > 0)),
                         np.array([0.01, -0.015, 0.008]) + 1e-3 * rng.normal(size=(6, 3)), np.ones(6),
                         np.array([0.01, 1e-4, 2.0, 3.0, 1.5]))  # fmt: skip
    alone, at_rest = to_onnx(network, ["a", "b", "c"], 0.05), TrialsAtRest(straight, 0.0, 0.0, 0.0, learnt)
    both = ask(session(to_onnx(network, ["a", "b", "c"], 0.05, at_rest)), poses)
    shift = learnt.mean(RestingPoses(straight - both["commands"], gravity_of(poses)))
    assert np.linalg.norm(shift, axis=1).min() > 5e-3
    aimed = poses.copy()
    position_of(aimed)[:] -= shift
    again = ask(session(alone), aimed)
    for name in ("commands", "lengths"):
        np.testing.assert_allclose(both[name], again[name], atol=2e-5)
        assert np.abs(both[name] - ask(session(alone), poses)[name]).max() > 2e-4
    np.testing.assert_allclose(both["tip"], again["tip"] + shift, atol=2e-5)


def test_tilts_of_every_form_of_gravity():
    rest = np.tile([0.0, 0, -0.4, 1, 0, 0, 0], (3, 1))
    down = [[0, 0, -1], [0.6, 0, -0.8], [0, -1, 0]]
    np.testing.assert_allclose(tilts_of(np.column_stack([down, rest])), [0, np.degrees(np.arctan(0.75)), 90])
    np.testing.assert_allclose(tilts_of(np.column_stack([np.radians([0, -30, 60]), rest])), [0, 30, 60])
    np.testing.assert_array_equal(tilts_of(rest), 0)
