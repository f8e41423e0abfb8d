"""Arms whose motors are commanded by force: which parameters they have, and known ones that come back."""

from dataclasses import replace

import numpy as np
import pytest

from tests.identification.test_recovery import identified
from tests.support.forced_arm import forced_model, forced_pull, holding_model
from tests.support.noisy_trials import with_values
from trunkline.errors import InputError
from trunkline.identification.parameters.parameters import PARAMETERS, parameter_of, parameters_of
from trunkline.identification.simulate.checks import check_trials
from trunkline.identification.simulate.experiment import prepare

PULLS = ([6.0, 0, 0, 0], [0, 5.0, 0, 0], [0, 0, 4.0, 0], [0, 2.0, 0, 6.0])
OF_LENGTHS = ["kp", "kp_ratio_2", "kv", "winding", "preload_1", "rate_limit", "backlash"]


@pytest.fixture(scope="module")
def model():
    return forced_model()


@pytest.mark.parametrize("name", OF_LENGTHS)
def test_what_belongs_to_lengths_is_refused(model, name):
    assert name not in parameters_of(model)
    with pytest.raises(InputError, match="^found it for ") as error:
        parameter_of(model, name)
    assert "\n" not in str(error.value)


def test_a_scale_of_forces_is_refused_where_none_are_commanded(model):
    assert parameter_of(model, "force_scale").read(model) == 1.0
    with pytest.raises(InputError, match="not commanded by force, expected build_mjcf.actuation.commands: force"):
        parameter_of(holding_model(), "force_scale")


def test_stiffness_and_the_scale_of_forces_come_back(model):
    """At rest under known masses, both: torques of drums whose radius was mistaken."""
    true = {"stiffness": 0.6 * PARAMETERS["stiffness"].read(model), "force_scale": 1.3}
    truth = with_values(model, {"stiffness": true["stiffness"]})
    splits = ["identify"] * 3 + ["validate"]
    trials = [forced_pull(truth, pull, split, 1.3) for pull, split in zip(PULLS, splits, strict=True)]
    result = identified(trials, model, {"stiffness": (1.0, 100.0), "force_scale": (0.3, 3.0)})
    assert result.values["stiffness"] == pytest.approx(true["stiffness"], rel=0.01)
    assert result.values["force_scale"] == pytest.approx(1.3, rel=0.01)


def test_trials_are_set_up_with_their_tensions(model):
    trial = forced_pull(model, PULLS[3])
    experiment = prepare(trial, model, 1)
    np.testing.assert_array_equal(experiment.controls, [PULLS[3]])
    assert not experiment.slack(model)
    assert prepare(replace(trial, commands=np.zeros((1, 4))), model, 1).slack(model)
    check_trials([trial], model)


def test_units_of_the_session_are_those_of_the_model(model):
    trial = forced_pull(model, PULLS[0])
    with pytest.raises(InputError, match="trial pull_6_0_0_0_identify: found commands in N, expected m, as the model"):
        check_trials([trial], holding_model())
    with pytest.raises(InputError, match="found commands in m, expected N, as the model's motors take"):
        check_trials([replace(trial, command_unit="m")], model)
