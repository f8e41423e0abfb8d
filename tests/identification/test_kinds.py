"""Every kind of experiment, a load of its own and a mount at any angle: set up, simulated, scored."""

from dataclasses import replace

import numpy as np
import pytest

from tests.support.matched_plant import (
    curl,
    markers_of,
    motion,
    release,
    small_model,
    static_pull,
    tilt,
    with_load,
)
from trunkline.frames import gravity_in_base
from trunkline.identification.evaluation.evaluation import replay, scores
from trunkline.identification.parameters.parameters import candidate_fields
from trunkline.identification.simulate.experiment import prepare
from trunkline.identification.simulate.loss import position_error
from trunkline.identification.simulate.population import Population
from trunkline.recordings.trials.experiments import EXPERIMENTS, is_static

PULLS = [(30, -300, -300), (25, 10, -300), (10, 8, 12)]


def errors(model, trials, **changed):
    """Of each trial as the model replays it, m."""
    experiments = [replace(prepare(trial, model, 437), **changed) for trial in trials]
    simulated = replay(model, experiments, trials[0].markers).positions
    return np.array([position_error(p, e.positions, e.measured) for p, e in zip(simulated, experiments, strict=True)])


def every_kind(model, angle=0.0):
    """A trial of each kind, as its entry says that one is; `angle`: the mount's, in degrees."""
    return [replace(alike(kind, model, angle), name=f"{name}_{angle:.0f}", experiment=name)
            for name, kind in EXPERIMENTS.items()]  # fmt: skip


def alike(kind, model, angle):
    """A trial at rest or in motion, with motors or without; with motors and a level, of one tendon."""
    if kind.static:
        return static_pull(model, PULLS[1], angle) if kind.needs_motors else tilt(model, angle or 50)
    if not kind.needs_motors:
        return release(model, 0.25, frames=60, tilt_deg=angle)
    return motion(model, tilt_deg=angle) if kind.level is None else curl(model, 40, frames=90, tilt_deg=angle)


def driven(kind):
    """Whether all tendons move the arm together, which a load changes less."""
    return kind.needs_motors and not kind.static and kind.level is None


@pytest.mark.parametrize("angle", [35.0, 80.0])
def test_a_session_whose_trials_hang_at_different_angles_is_replayed(angle):
    model = small_model()
    trials = every_kind(model, angle) + every_kind(model)
    assert (errors(model, trials) < 0.8e-3).all(), errors(model, trials)
    moved = errors(model, trials[: len(EXPERIMENTS)], gravity=gravity_in_base(0.0))
    assert (moved > 2e-3).all(), f"gravity of the trial is not what is simulated: {moved}"


def test_loads_are_carried_by_a_model_that_has_none():
    model = small_model()
    heavy = with_load(model, 0.1)
    unloaded, loaded = every_kind(model), [replace(trial, load=0.1) for trial in every_kind(heavy)]
    mixed = [trial for pair in zip(loaded, unloaded, strict=True) for trial in pair]
    np.testing.assert_array_less(errors(model, mixed), 0.4e-3)
    least = [1.5e-3 if driven(kind) else 4e-3 for kind in EXPERIMENTS.values()]
    np.testing.assert_array_less(least, errors(model, loaded, load=0.0))


def test_a_trial_without_load_is_simulated_to_the_last_bit_as_if_there_were_none_beside_it():
    model = small_model()
    experiments = [prepare(trial, model, 437) for trial in every_kind(model)]
    fields = candidate_fields(model, {"stiffness": model.jnt_stiffness[:1] * [1.0, 1.2]})
    alone = Population(model, experiments, markers_of(model)).simulate(fields).positions
    population = Population(model, [*(replace(e, load=0.05) for e in experiments), *experiments], markers_of(model))
    for _ in range(2):  # the second call reuses the batch
        beside = population.simulate(fields).positions[len(experiments) :]
        for first, second in zip(alone, beside, strict=True):
            np.testing.assert_array_equal(first, second)


def test_a_static_pull_starts_from_the_measured_pose_with_its_mean_commands():
    model = small_model()
    trial = static_pull(model, PULLS[0], 20.0)
    experiment = prepare(trial, model, 437, command_delay=0.05)
    np.testing.assert_allclose(experiment.controls, model.tendon_length0 - trial.commands)
    assert (experiment.frames, experiment.lead) == (1, 0.0)
    assert is_static("static_pull")
    assert np.abs(experiment.start).max() > 0.05


@pytest.mark.parametrize("pulls", PULLS)
def test_a_static_pull_rests_where_the_plant_does_whatever_the_start(pulls):
    model = small_model()
    trial = static_pull(model, pulls, 15.0)
    experiment = prepare(trial, model, 437)
    away = replace(experiment, start=experiment.start + 0.02 * np.random.default_rng(0).normal(size=model.nq))
    for start in (experiment, away):
        positions = replay(model, [start], trial.markers).positions[0]
        assert position_error(positions, start.positions, start.measured) < 0.2e-3


def test_scores_have_every_kind():
    model = small_model()
    trials = every_kind(model)
    experiments = [prepare(trial, model, 437) for trial in trials]
    table = scores(replay(model, experiments, trials[0].markers), experiments)["identify"]["by_experiment"]
    assert set(table) == set(EXPERIMENTS)
    assert {kind for kind, row in table.items() if "e_velocity_mm_s" in row} == {k for k in table if not is_static(k)}
