"""Samples of an arm whose motors are commanded by force: their commands are tensions; what needs lengths refuses it."""

from types import SimpleNamespace

import numpy as np
import pytest

from tests.support.bent_chain import stump_spec
from trunkline.errors import InputError
from trunkline.kinematics.dataset.columns import command_columns, tension_columns
from trunkline.kinematics.dataset.deviation import mujoco_deviation
from trunkline.kinematics.dataset.gather import gather
from trunkline.kinematics.dataset.table import sample_table
from trunkline.model.arm.mjcf import pull_with
from trunkline.model.arm_model import ArmModel
from trunkline.model.statics.chain import read_chain


@pytest.fixture(scope="module")
def model():
    spec = stump_spec()
    for actuator in spec.actuators:
        pull_with(actuator, 80.0)
    return spec.compile()


def test_commands_of_samples_are_tensions_at_which_mujoco_rests(model):
    chain, rng = read_chain(model), np.random.default_rng(1)
    table, _ = sample_table(chain, np.array([0.0, 0.0, -1.0]), 40, 6, 8, rng)
    tensions = table[tension_columns(3)].to_numpy()
    np.testing.assert_array_equal(table[command_columns(3)].to_numpy(), tensions)
    assert tensions.max() > 10
    deviation = mujoco_deviation(model, chain, table, 6, rng)
    assert deviation["rested"].all()
    assert deviation["deviation_mm"].max() < 0.05
    assert (deviation["friction_band_mm"] > 0).any()


def test_a_stroke_is_refused(model):
    sampling = SimpleNamespace(stroke=0.01)
    several = read_chain(model)._replace(crosses=np.tril(np.ones((7, 3)))[::-1])  # tendons that end at several units
    with pytest.raises(InputError, match="fk_dataset.stroke: found 0.01 m, expected null where motors are"):
        gather(model, several, sampling, lambda **_: None)


def test_what_needs_lengths_says_so_in_one_line(model):
    with pytest.raises(InputError, match="^train_ik.model: found an arm whose motors are commanded by force") as error:
        ArmModel(model).require_lengths("train_ik.model")
    assert "\n" not in str(error.value)
    ArmModel(stump_spec().compile()).require_lengths("train_ik.model")
