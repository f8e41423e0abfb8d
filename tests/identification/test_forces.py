"""Arms whose motors are commanded by force: which parameters they have, and known ones that come back."""

from dataclasses import replace

import mujoco
import numpy as np
import pytest

from tests.identification.test_recovery import identified
from tests.model.simulation.test_shortening import soft_model
from tests.support.forced_arm import MARKERS, forced_model, forced_pull, holding_model
from tests.support.noisy_trials import WEIGHTS, with_values
from trunkline.errors import InputError
from trunkline.identification.evaluation.baselines import noise_floor
from trunkline.identification.evaluation.evaluation import replay
from trunkline.identification.fit.considered import considered
from trunkline.identification.fit.linearisation import linearise
from trunkline.identification.fit.problem import Bounds, Problem
from trunkline.identification.parameters.parameters import PARAMETERS, candidate_fields, parameter_of, parameters_of
from trunkline.identification.parameters.tolerances import Tolerances
from trunkline.identification.simulate.checks import check_trials
from trunkline.identification.simulate.experiment import prepare
from trunkline.identification.simulate.markers import with_measured_markers
from trunkline.identification.simulate.population import Population
from trunkline.model.simulation.shortening import shortened
from trunkline.model.statics.chain import read_chain

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


SOFT = ("unit_02", "unit_04", "end")
SOFT_PULLS = ([4.0, 0, 0], [0, 5.0, 1.0], [4.0, 0, 0])


def test_soft_arms_rest_shorter_by_each_trials_tensions():
    """Two candidates with their own EA and force scale, as MuJoCo settles arms that are as short."""
    model = with_values(soft_model(), {"axial_stiffness": 300.0})
    trials = [forced_pull(shortened(model, np.array(pull)), pull, markers=SOFT) for pull in SOFT_PULLS]
    experiments = [prepare(trial, model, 1) for trial in trials]
    assert max(experiment.fit.residuals.max() for experiment in experiments) < 1e-4  # the pose is that of a shorter arm
    values = {"axial_stiffness": np.array([300.0, 150.0]), "force_scale": np.array([1.0, 0.8])}
    shapes = Population(model, experiments, SOFT).simulate(candidate_fields(model, values)).positions
    other = with_values(model, {"axial_stiffness": 150.0})
    for trial, pull, shape in zip(trials, SOFT_PULLS, shapes, strict=True):
        weaker = forced_pull(shortened(other, 0.8 * np.array(pull)), pull, scale=0.8, markers=SOFT)
        np.testing.assert_allclose(shape[:, 0], [trial.positions[0], weaker.positions[0]], atol=2e-6)


def test_markers_of_a_soft_arm_are_where_it_is_as_short():
    model = soft_model()
    trials = [forced_pull(shortened(model, np.array(pull)), pull, markers=SOFT) for pull in SOFT_PULLS]
    np.testing.assert_allclose(with_measured_markers(model, trials).site_pos, model.site_pos, atol=2e-4)


def test_soft_arms_do_not_move_yet():
    rest = forced_pull(soft_model(), SOFT_PULLS[0], markers=SOFT)
    trial = replace(rest, experiment="motion", time=np.arange(30) / 60)
    many = {name: np.repeat(getattr(trial, name), 30, axis=0)
            for name in ("positions", "measured", "commands", "tendon_positions")}  # fmt: skip
    experiment = prepare(replace(trial, **many), soft_model(), 5)
    with pytest.raises(InputError, match="^trial pull_4_0_0_identify, which moves: found an arm with axial_stiffness"):
        Population(soft_model(), [experiment], SOFT)


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


def test_statics_and_mujoco_pull_as_strongly_as_a_candidate_may(model):
    """Whatever the arm was described with."""
    stronger, sent = with_values(forced_model(max_force=3.0), {"force_range": 5.0}), np.array([6.0, 0.0, 0.0, 0.0])
    data = mujoco.MjData(stronger)
    data.ctrl[:] = sent
    mujoco.mj_step(stronger, data, 2000)
    assert -data.actuator_force[0] == pytest.approx(5.0, abs=1e-3)
    np.testing.assert_array_equal(read_chain(stronger).pulls(sent)[0], [5.0, 0.0, 0.0, 0.0])
    lengths = with_values(holding_model(), {"force_range": 5.0})
    np.testing.assert_array_equal(lengths.actuator_ctrlrange, holding_model().actuator_ctrlrange)


def test_a_motor_that_pulls_by_more_than_the_first_is_considered(model):
    """By what it would change of the trials: one that bends by this motor alone is as if its tension were larger."""
    trials = [forced_pull(model, pull) for pull in PULLS[:2]]
    problem = Problem(
        model, [prepare(trial, model, 1) for trial in trials], MARKERS, {"stiffness": Bounds(0.2, 20.0)}, "positions",
        WEIGHTS,
    )  # fmt: skip
    moves, lines = considered(problem, linearise(problem, problem.start()), Tolerances(gain=0.05), [])
    assert lines == []
    assert set(moves) == {("gain", str(motor)) for motor in (2, 3, 4)}
    assert moves["gain", "2"][0] > 0.005, "what pulls more is held by what is stiffer"
    np.testing.assert_array_equal([moves["gain", motor] for motor in ("3", "4")], np.zeros((2, 1)))


def test_the_noise_floor_is_of_the_arm_as_short_as_it_is_pulled():
    model = soft_model()
    trials = [forced_pull(shortened(model, np.array(pull)), pull, markers=SOFT) for pull in SOFT_PULLS]
    experiments = [prepare(trial, model, 1) for trial in trials]
    floor = noise_floor(trials, experiments, model, replay(model, experiments, SOFT))
    for shape, experiment in zip(floor.replay.positions, floor.experiments, strict=True):
        assert np.linalg.norm(shape - experiment.positions, axis=-1).max() < 1e-4
