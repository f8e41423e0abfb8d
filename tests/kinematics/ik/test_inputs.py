"""Two forms of a target: the angle of a tilt, or the direction of gravity."""

import numpy as np
import onnxruntime
import pandas as pd
import pytest
import torch

from tests.kinematics.ik.test_as_controls import exact
from tests.kinematics.ik.test_network import data_of, loss_of
from trunkline.errors import InputError
from trunkline.frames import downwards
from trunkline.kinematics.dataset.table import sample_table
from trunkline.kinematics.ik.as_controls import draw_targets, settled
from trunkline.kinematics.ik.inference import ask
from trunkline.kinematics.ik.inputs import (
    DIRECTION,
    TILT,
    draw_gravity,
    gravity_columns,
    gravity_of,
    inputs_of,
    position_of,
    quaternion_of,
)
from trunkline.kinematics.ik.onnx import to_onnx
from trunkline.kinematics.ik.score import outside_targets, tip_errors
from trunkline.kinematics.ik.training import Training, train

UNITY_OPS = {"Gather", "Mul", "Add", "Sub", "Concat", "Gemm", "Relu", "Clip"}


@pytest.fixture(scope="module")
def table(chain):
    rng = np.random.default_rng(0)
    downs = downwards(rng.uniform(0, 1.0, 40), rng.uniform(0, 2 * np.pi, 40))
    return pd.concat([sample_table(chain, down, 60, 8, 16, rng)[0] for down in downs], ignore_index=True)


@pytest.fixture(scope="module")
def network(chain, table):
    trains, training = np.arange(len(table)) % 5 > 0, Training(48, 40, 64, 5e-3, 1)
    return train(*data_of(table), loss_of(chain, table), trains, training, lambda *_: None)


def test_both_forms_tell_the_same_gravity_and_pose(table):
    pose = table[DIRECTION[3:]].to_numpy()[:2]
    tilts = np.array([0.0, 0.7])
    forms = np.column_stack([tilts, pose]), np.column_stack([downwards(tilts, 0 * tilts), pose])
    assert [targets.shape[1] for targets in forms] == [len(TILT), len(DIRECTION)]
    np.testing.assert_allclose(gravity_of(forms[0]), gravity_of(forms[1]), atol=1e-12)
    for targets in forms:
        np.testing.assert_array_equal(position_of(targets), pose[:, :3])
        np.testing.assert_array_equal(quaternion_of(targets), pose[:, 3:])


def test_samples_say_which_form_their_network_takes(chain, table):
    assert inputs_of(table) == DIRECTION
    rng = np.random.default_rng(0)
    tilted = [sample_table(chain, downwards(tilt, 0.0), 20, 8, 8, rng)[0] for tilt in (0.0, 0.5)]
    assert inputs_of(pd.concat(tilted)) == TILT


def test_gravities_are_drawn_within_those_known_and_all_around():
    rng = np.random.default_rng(0)
    sampled = downwards(np.array([0.0, 1.2]), np.array([0.0, 1.0]))
    drawn = draw_gravity(sampled, 500, rng)
    np.testing.assert_allclose(np.linalg.norm(drawn, axis=1), 1)
    angles = np.arccos(-drawn[:, 2])
    assert 1.1 < angles.max() <= 1.2
    assert np.histogram(np.arctan2(drawn[:, 1], drawn[:, 0]), 6)[0].min() > 50
    tilts = draw_gravity(np.array([[0.2], [0.9]]), 500, rng)
    assert tilts.shape == (500, 1)
    assert tilts.min() >= 0.2
    assert tilts.max() <= 0.9


def test_training_brings_the_tip_home_under_gravity_from_any_side(chain, table, network):
    inputs = table[DIRECTION].to_numpy()[::5].copy()
    with torch.no_grad():
        commands = network(torch.tensor(inputs, dtype=torch.float32)).commands.double().numpy()
    home = tip_errors(chain, inputs, commands).position
    assert np.median(home) < 0.03 * chain.length
    astray = inputs.copy()
    astray[:, :2] *= -1  # gravity from the other side
    assert np.median(tip_errors(chain, astray, commands).position) > 3 * np.median(home)


def test_the_file_takes_a_direction_and_refuses_one_that_is_none(table, network):
    model = to_onnx(network, ["a", "b", "c"], 0.005)
    assert {node.op_type for node in model.graph.node} <= UNITY_OPS
    session = onnxruntime.InferenceSession(model.SerializeToString(), providers=["CPUExecutionProvider"])
    poses = table[DIRECTION].to_numpy()[:9].copy()
    with torch.no_grad():
        expected = network(torch.tensor(poses, dtype=torch.float32))._asdict()
    for name, values in ask(session, poses).items():
        if name in expected:
            np.testing.assert_allclose(values, expected[name].numpy(), rtol=0, atol=2e-6)
    poses[3, :3] *= 9.81
    with pytest.raises(InputError, match=r"pose 3: found a direction of gravity of length 9\.81, expected unit length"):
        ask(session, poses)
    with pytest.raises(InputError, match=r"expected \(N, 10\): gx, gy, gz, x, y, z, qw"):
        ask(session, poses[:, :8])


def test_exact_commands_settle_on_targets_under_gravity_from_any_side(model, chain):
    """In MuJoCo, which shares nothing with the statics that find the commands."""
    sampled = downwards(np.array([0.0, 1.0]), np.zeros(2))
    drawn = draw_targets(model, chain, sampled, np.full(3, 0.01), 6, np.random.default_rng(0)).targets
    assert drawn.shape[1] == len(DIRECTION)
    assert len(drawn) >= 3
    assert np.abs(gravity_columns(drawn)[:, 1]).max() > 0.1
    assert settled(model, exact(chain), drawn).position.max() < 2e-5


def test_far_targets_have_any_gravity():
    far = outside_targets(500, 0.5, np.random.default_rng(0), columns=3)
    assert far.shape == (500, len(DIRECTION))
    np.testing.assert_allclose(np.linalg.norm(gravity_columns(far), axis=1), 1)
