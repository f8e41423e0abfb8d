"""An arm of two sections, each with three tendons that end there, without gravity: from samples to a network."""

from dataclasses import replace

import numpy as np
import onnxruntime
import pytest
import torch

from tests.kinematics.ik.test_network import data_of, loss_of
from tests.model.arm.test_sections import ACTUATION, SOLVER
from trunkline.errors import InputError
from trunkline.kinematics.dataset.columns import DOWN, POSE, command_columns, length_columns, tension_columns
from trunkline.kinematics.dataset.gather import Sampling, gather
from trunkline.kinematics.dataset.gravities import Weightless
from trunkline.kinematics.dataset.samples import from_any_side, read_samples
from trunkline.kinematics.dataset.sampling import in_sections, sections
from trunkline.kinematics.ik.as_controls import DOUBT, draw_targets, settled
from trunkline.kinematics.ik.inference import ask
from trunkline.kinematics.ik.inputs import draw_gravity, gravity_of, inputs_of
from trunkline.kinematics.ik.learn import Unseen, doubt_beyond, sampled_gravities, unseen_targets
from trunkline.kinematics.ik.onnx import to_onnx
from trunkline.kinematics.ik.refine import refine
from trunkline.kinematics.ik.training import Training, train
from trunkline.kinematics.reachability.sampled import read_tips
from trunkline.kinematics.reachability.soft import SoftSettings, SurfaceSettings
from trunkline.model.arm.sections import Section, Sections
from trunkline.model.arm.tendons import Tendon
from trunkline.model.statics.chain import read_chain
from trunkline.model.statics.equilibria import equilibrium, forward

STROKE = 0.004  # m
SAMPLING = Sampling(1500, Weightless(100, 40, "none"), STROKE, 1, 0.2, 8)


@pytest.fixture(scope="module")
def model(tmp_path_factory):
    part = Section(length=0.08, units=3, width=0.02, mass=0.02, bending_stiffness=0.02)
    ways = (0.0, 120.0, -120.0)
    tendons = [Tendon(angle + turn, 0.006, end=end) for end, turn in ((3, 0.0), (6, 30.0)) for angle in ways]
    arm = Sections(
        kind="sections", sections=[part, part], joint_range_deg=60.0, damping_ratio=0.3, tendons=tendons,
        hole_ratio=0.8, tip_load=0.0, markers={"tip": 0.16},
    )  # fmt: skip
    return arm.build(ACTUATION, SOLVER, tmp_path_factory.mktemp("models")).spec.compile()


@pytest.fixture(scope="module")
def chain(model):
    return read_chain(model)


@pytest.fixture(scope="module")
def table(model, chain):
    return gather(model, chain, SAMPLING, lambda **_: None).table


def test_sections_are_the_tendons_that_end_together(chain):
    assert [section.tolist() for section in sections(chain)] == [[0, 1, 2], [3, 4, 5]]


def test_every_section_keeps_a_slack_tendon_and_no_motor_goes_beyond_its_stroke(chain, table):
    tensions = table[tension_columns(6)].to_numpy()
    for section in sections(chain):
        assert (tensions[:, section] == 0).any(axis=1).all()
        assert ((tensions[:, section] > 0).sum(axis=1) == 2).mean() > 0.9
    pulls = chain.straight_lengths - table[command_columns(6)].to_numpy()
    assert 0.9 * STROKE < pulls.max() <= STROKE


def test_what_is_drawn_reaches_as_far_as_one_motor_alone_by_its_stroke(chain):
    rng = np.random.default_rng(0)
    result, within = in_sections(chain, np.zeros(3), 4000, np.full(6, STROKE), rng)
    assert 0.2 < within.mean() < 1
    for tendon in range(6):
        alone = np.zeros((1, 6))
        alone[0, tendon] = result.tensions[:, tendon].max()
        pull = chain.straight_lengths - equilibrium(chain, alone, np.zeros(3)).commands[0]
        assert pull[tendon] == pytest.approx(STROKE, rel=0.05)
    every, all_within = in_sections(chain, np.zeros(3), 500, None, rng)
    assert all_within.all()
    np.testing.assert_allclose(every.tensions.max(), chain.max_tension[0], rtol=0.05)


def test_without_gravity_there_is_one_angle_and_the_pose_is_all_that_is_asked(chain, table, tmp_path):
    assert not table[DOWN].to_numpy().any()
    assert not table["theta_g"].any()
    table.to_parquet(tmp_path / "samples.parquet")
    assert not from_any_side(read_samples(tmp_path / "samples.parquet", 6, "split"))
    assert inputs_of(table) == POSE
    assert sampled_gravities(table).shape == (1, 0)
    assert draw_gravity(np.zeros((1, 0)), 5, np.random.default_rng(0)).shape == (5, 0)
    np.testing.assert_array_equal(gravity_of(table[POSE].to_numpy()[:4]), np.zeros((4, 3)))
    fresh = unseen_targets(chain, np.zeros((1, 0)), Unseen(1, 20, 20, 150), 7, np.full(6, STROKE))
    assert len(fresh) > 100
    assert not set(fresh["x"]) & set(table["x"])


def test_the_samples_are_mujoco_s_at_rest(model, chain):
    gathered = gather(model, chain, replace(SAMPLING, seed=2), lambda **_: None)
    assert gathered.deviation["rested"].all()
    assert gathered.deviation["deviation_mm"].max() < 1e-3


def test_a_stroke_is_of_arms_of_several_sections(model, chain):
    single = chain._replace(crosses=np.ones_like(chain.crosses))
    with pytest.raises(InputError, match=r"^fk_dataset.stroke: found 0.004, expected null for an arm of one section$"):
        gather(model, single, SAMPLING, lambda **_: None)


def test_gauss_newton_steps_bring_the_tip_to_its_target(chain, table):
    rows = table.sample(80, random_state=0)
    targets, lengths = rows[POSE].to_numpy(), rows[length_columns(6)].to_numpy()
    commands = rows[command_columns(6)].to_numpy()
    wrong = commands + np.random.default_rng(1).uniform(-5e-4, 5e-4, commands.shape)
    before, after = (refine(chain, targets, lengths, steps, commands=wrong) for steps in (0, 4))
    assert before.converged.all()
    assert np.median(before.position_error) > 0.01 * chain.length
    assert np.median(after.position_error) < 1e-4 * chain.length
    assert np.quantile(after.position_error, 0.9) < 2e-3 * chain.length


def test_one_map_of_the_samples_that_train_stands_for_every_tilt(chain, table, tmp_path):
    table.to_parquet(tmp_path / "samples.parquet")
    soft = SoftSettings(0.01, 0.02, 0.7, 60, 0.01, 5.0, 8, 8, [0.0, 30.0], SurfaceSettings(8, 8, 8, 1))
    tips_at = read_tips(tmp_path / "samples.parquet", chain, soft, 0)
    trains = table["split"] == "train"
    assert tips_at.angles.tolist() == [0.0]
    for angle in (0.0, 0.7):
        np.testing.assert_array_equal(tips_at(angle).positions, table.loc[trains, ["x", "y", "z"]].to_numpy())
    assert tips_at.unseen is not None
    assert len(tips_at.unseen.positions) == (~trains).sum()
    fixed = forward(chain, tips_at(0.0).lengths[:40], np.zeros(3))  # what is slack is paid out, so that all are found
    assert fixed.converged.all()
    np.testing.assert_allclose(fixed.position, tips_at(0.0).positions[:40], atol=1e-6)
    from_one_side = table.assign(gx=np.sin(table["theta_g"] + 1), gy=0.6, gz=-0.8, theta_g=np.arange(len(table)) % 2)
    from_one_side.to_parquet(tmp_path / "samples.parquet")
    with pytest.raises(InputError, match="from any side, expected tilts or none: it has several sections"):
        read_tips(tmp_path / "samples.parquet", chain, soft, 0)


def test_a_network_of_poses_alone_is_exported_as_it_is_and_beats_the_straight_arm(model, chain, table):
    training = Training(width=48, epochs=60, batch=64, learning_rate=5e-3, seed=1)
    trains = (table["split"] == "train").to_numpy()
    network = train(*data_of(table, 6), loss_of(chain, table), trains, training, lambda *_: None)
    names = [f"tendon_{k + 1}" for k in range(6)]
    runtime = onnxruntime.InferenceSession(to_onnx(network, names, 0.01).SerializeToString())
    asked = table[POSE].to_numpy()[:50]
    with torch.no_grad():
        outputs = network(torch.tensor(asked, dtype=torch.float32))
    answer = ask(runtime, asked)
    np.testing.assert_allclose(answer["commands"], outputs.commands.numpy(), atol=1e-6)
    np.testing.assert_allclose(answer["tip"], outputs.tip.numpy(), atol=1e-6)
    drawn = draw_targets(model, chain, np.zeros((1, 0)), np.full(6, STROKE), 60, np.random.default_rng(3))
    assert drawn.targets.shape[1] == 7
    missed = settled(model, lambda poses: ask(runtime, poses), drawn.targets).position
    straight = np.linalg.norm(drawn.targets[:, :3] - [0, 0, -chain.length], axis=1)
    assert np.median(missed) < 0.25 * np.median(straight)

    loose, tight = (doubt_beyond(network, table[POSE].to_numpy(), length) for length in (1e-6, 10.0))
    foreseen = np.linalg.norm(outputs.tip.numpy() - asked[:, :3], axis=1)
    assert 0.8 < (foreseen <= loose).mean() <= 1, "nineteen in twenty are beyond doubt"
    assert tight == DOUBT * 10.0, "however well it foresees"
