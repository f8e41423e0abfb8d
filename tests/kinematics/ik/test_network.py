"""From samples to an ONNX file: what is dropped, what is even, what the loss promises, what the file says."""

import json

import numpy as np
import onnx
import onnxruntime
import pandas as pd
import pytest
import torch

from trunkline.errors import InputError
from trunkline.frames import downwards, gravity_in_base
from trunkline.kinematics.dataset import sampling
from trunkline.kinematics.dataset.columns import DOWN, command_columns, length_columns, tension_columns
from trunkline.kinematics.dataset.deviation import mujoco_deviation
from trunkline.kinematics.dataset.samples import read_samples
from trunkline.kinematics.dataset.table import command_by_tension, sample_table, tip_by_tension
from trunkline.kinematics.ik.inputs import TILT, inputs_of
from trunkline.kinematics.ik.network import InverseKinematics
from trunkline.kinematics.ik.onnx import to_onnx
from trunkline.kinematics.ik.score import length_errors, tip_errors
from trunkline.kinematics.ik.tip_loss import tip_loss
from trunkline.kinematics.ik.training import Training, train
from trunkline.model.statics.equilibria import actuated

# ops of opset 15 that Unity's inference engine runs (its manual, "Supported ONNX operators")
UNITY_OPS = {"Gather", "Sin", "Cos", "Mul", "Add", "Sub", "Concat", "Gemm", "Relu", "Clip"}


@pytest.fixture(scope="module")
def samples(chain):
    rng = np.random.default_rng(0)
    return pd.concat(
        [sample_table(chain, downwards(tilt, 0.0), 500, 24, 60, rng)[0] for tilt in (0.0, 0.8)], ignore_index=True
    )


def loss_of(chain, samples):
    count = chain.tendons
    tensions = samples[tension_columns(count)].to_numpy()
    return tip_loss(tensions, tip_by_tension(samples, count), command_by_tension(samples, chain.gain))


def data_of(samples, tendons=3):
    columns = inputs_of(samples), command_columns(tendons), length_columns(tendons)
    return [samples[names].to_numpy() for names in columns]


def test_samples_rest_with_a_slack_tendon_and_name_the_planar_sets(chain, samples):
    tensions = samples[tension_columns(3)].to_numpy()
    assert (tensions >= 0).all()
    assert (tensions <= chain.max_tension).all()
    assert (tensions.min(axis=1) < 1e-9).all()
    dorsal, ventral = (samples[samples["set"] == name] for name in ("dorsal", "ventral"))
    assert len(dorsal) > 0
    assert (dorsal[["f2", "f3"]] == 0).all(axis=None)
    assert len(ventral) > 0
    np.testing.assert_array_equal(ventral["f2"], ventral["f3"])
    np.testing.assert_allclose(ventral["y"], 0, atol=1e-9)


def test_samples_are_where_mujoco_rests(model, chain, samples):
    deviation = mujoco_deviation(model, chain, samples, 10, np.random.default_rng(0))
    assert deviation["rested"].all()
    assert deviation["deviation_mm"].max() < 0.02


def test_failed_samples_are_counted_and_left_out(chain, monkeypatch):
    follow = sampling._follow

    def failing(*args):
        paths = follow(*args)
        paths.converged[:7], paths.snapped[7:10] = False, True
        return paths

    monkeypatch.setattr(sampling, "_follow", failing)
    samples = sampling.sample_at(chain, gravity_in_base(0.0), 8, 8, np.random.default_rng(0))
    assert (samples.failed, samples.snapped) == (14, 6)  # of the general and the planar rays
    assert len(samples.kind) == 8 * 8 + 2 * 4 * 8 - 20
    assert samples.equilibrium.converged.all()


def test_thinning_evens_out_a_crowd():
    rng = np.random.default_rng(0)
    crowd = np.concatenate([rng.normal(0, 0.003, (4000, 3)), rng.uniform(-0.1, 0.1, (4000, 3))])
    retained = sampling.thin(crowd, 1500, rng)
    assert len(np.unique(retained)) == len(retained)
    assert 1400 <= len(retained) <= 1500
    before, after = (sampling.crowding(p, 0.05) for p in (crowd, crowd[retained]))
    assert after.std() / after.mean() < 0.3 * before.std() / before.mean()


def test_loss_is_the_tips_motion_to_first_order(chain, samples):
    """Against the statics, for errors of 20 µm in every command, taut and slack, of either sign."""
    rows = samples[samples[["f1", "f2", "f3"]].max(axis=1).between(2, 30)].sample(40, random_state=0)
    delta = np.random.default_rng(1).uniform(-2e-5, 2e-5, (40, 3))
    gravity = gravity_in_base(rows["theta_g"].to_numpy())
    moved = actuated(chain, rows[command_columns(3)].to_numpy() + delta, gravity).position - rows[["x", "y", "z"]]
    predicted = loss_of(chain, rows)(torch.tensor(delta, dtype=torch.float32)).numpy()
    error = np.linalg.norm(moved.to_numpy() - predicted, axis=1)
    assert np.median(error) < 0.02 * np.median(np.linalg.norm(predicted, axis=1))


def test_extra_length_of_a_slack_tendon_costs_nothing(chain, samples):
    rows = samples[(samples["f3"] == 0) & (samples["f1"] > 0.1) & (samples["f2"] > 0.1)].head(5)
    loss = loss_of(chain, rows)
    longer = loss(torch.tensor([[0, 0, 1e-3]]).repeat(5, 1))
    shorter = loss(torch.tensor([[0, 0, -1e-3]]).repeat(5, 1))
    assert longer.abs().max() == 0
    assert (shorter.norm(dim=1) > 1e-4).all()


@pytest.fixture(scope="module")
def trained(chain, samples):
    inputs = samples[TILT].to_numpy()
    is_train = np.arange(len(samples)) % 5 > 0
    errors = []
    network = train(
        *data_of(samples), loss_of(chain, samples), is_train, Training(64, 60, 32, 3e-3, 1),
        lambda epoch, train_error, validate_error: errors.append(validate_error),
    )  # fmt: skip
    return network, errors, inputs[~is_train]


def test_training_brings_the_tip_home(chain, trained):
    network, errors, held_out = trained
    with torch.no_grad():
        answer = [values.double().numpy() for values in network(torch.tensor(held_out, dtype=torch.float32))]
    metrics = tip_errors(chain, held_out, answer[0]).metrics(chain.length)
    assert errors[-1] < 0.2 * errors[0]
    assert metrics["failed"] == 0
    assert metrics["position_error_mm"]["median"] < 0.03 * chain.length * 1e3
    as_lengths = length_errors(chain, held_out, answer[1]).metrics(chain.length)
    assert as_lengths["position_error_mm"]["median"] < 0.05 * chain.length * 1e3


def test_training_foresees_where_the_tip_comes_to(chain, trained):
    network, _, held_out = trained
    with torch.no_grad():
        answer = [values.double().numpy() for values in network(torch.tensor(held_out, dtype=torch.float32))]
    reached = actuated(chain, answer[0], gravity_in_base(held_out[:, 0])).position
    assert np.median(np.linalg.norm(answer[2] - reached, axis=1)) < 0.03 * chain.length


def test_exact_answers_score_zero_and_lengths_are_no_commands(chain, samples):
    inputs, commands, lengths = data_of(samples.sample(50, random_state=1))
    for errors in (tip_errors(chain, inputs, commands), length_errors(chain, inputs, lengths)):
        assert errors.position.max() < 1e-6
        assert errors.orientation.max() < 1e-4
    assert np.median(tip_errors(chain, inputs, lengths).position) > 1e-4


def test_onnx_file_is_the_network_and_says_what_it_takes(trained, samples):
    network, _, held_out = trained
    model = to_onnx(network, ["tendon_1", "tendon_2", "tendon_3"], 0.005)
    assert [(o.domain, o.version) for o in model.opset_import] == [("", 15)]
    assert {node.op_type for node in model.graph.node} <= UNITY_OPS
    assert not any(onnx.external_data_helper.uses_external_data(t) for t in model.graph.initializer)
    assert sum(node.op_type == "Relu" for node in model.graph.node) == 6
    meaning = {entry.key: entry.value for entry in model.metadata_props}
    assert json.loads(meaning["inputs"]) == TILT
    assert json.loads(meaning["output_units"]) == ["m", "m", "m"]
    session = onnxruntime.InferenceSession(model.SerializeToString(), providers=["CPUExecutionProvider"])
    far = np.concatenate([held_out, held_out + np.random.default_rng(0).normal(0, 1, held_out.shape)])
    flipped = far * [1, 1, 1, 1, -1, -1, -1, -1]
    for pose in (far.astype(np.float32), far[:1].astype(np.float32)):
        with torch.no_grad():
            expected = network(torch.tensor(pose))
        for output, wanted in zip(session.run(["commands", "lengths", "tip"], {"pose": pose}), expected, strict=True):
            np.testing.assert_allclose(output, wanted.numpy(), rtol=0, atol=2e-6)
    out = session.run(None, {"pose": far.astype(np.float32)})[0]
    np.testing.assert_array_equal(session.run(None, {"pose": flipped.astype(np.float32)})[0], out)
    commands = samples[command_columns(3)].to_numpy()
    assert (out >= commands.min(axis=0) - 1e-6).all()
    assert (out <= commands.max(axis=0) + 1e-6).all()


def test_same_seed_and_threads_give_the_same_file_and_other_threads_nearly_the_same_answers(
    chain, samples, monkeypatch
):
    poses, commands, lengths = data_of(samples)
    is_train = np.arange(len(samples)) % 5 > 0
    files, answers = [], []
    for threads in (1, 2, 2):
        monkeypatch.setenv("TRUNKLINE_THREADS", str(threads))
        training = Training(16, 2, 64, 1e-3, 3)
        network = train(poses, commands, lengths, loss_of(chain, samples), is_train, training, lambda *_: None)
        assert isinstance(network, InverseKinematics)
        files.append(to_onnx(network, ["a", "b", "c"], 0.005).SerializeToString())
        with torch.no_grad():
            answers.append(network(torch.tensor(poses, dtype=torch.float32)).commands.numpy())
    assert files[1] == files[2]
    np.testing.assert_allclose(answers[0], answers[1], rtol=0, atol=1e-3 * np.ptp(commands))


def test_a_learning_rate_that_diverges_is_an_error_of_one_line(chain, samples):
    is_train = np.arange(len(samples)) % 5 > 0
    with pytest.raises(InputError, match=r"learning_rate: found 1e\+30, by which .* is not finite in epoch 1"):
        train(*data_of(samples), loss_of(chain, samples), is_train, Training(16, 2, 64, 1e30, 3), lambda *_: None)


def test_a_single_gravity_angle_is_refused_before_anything_is_trained(tmp_path):
    samples = pd.DataFrame(np.zeros((3, 16)), columns=[*TILT, *DOWN, "l1", "l2", "c1", "c2", "split"])
    samples["gz"] = -1.0
    samples.to_parquet(tmp_path / "samples.parquet")
    with pytest.raises(InputError, match="samples.parquet: found 1 gravity angle, expected at least 2"):
        read_samples(tmp_path / "samples.parquet", 2)
