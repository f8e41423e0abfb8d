"""The table of choices: each row changes what it says, and settings that a stage accepts."""

from dataclasses import dataclass
from importlib import import_module

import pytest

from studies.choices import CHOICES, quick
from studies.demo_session import STAGES
from trunkline.identification.fit.optimizers import LeastSquares
from trunkline.identification.fit.setup import fit_of
from trunkline.pipeline.config import load_config


@pytest.fixture(scope="module")
def settings():
    return {stage: load_config(import_module(f"stages.{stage}").Config, stage) for stage in STAGES}


@pytest.mark.parametrize("name", CHOICES)
def test_a_choice_changes_what_its_title_says_and_nothing_else(name, settings):
    choice, changed = CHOICES[name], set()
    for stage, config in settings.items():
        before, after = vars(config), vars(choice.settings(stage, config))
        for key in (key for key in before if before[key] != after[key]):
            changed |= before[key].keys() ^ after[key].keys() if key == "parameters" else {key}
    assert all(key in choice.title for key in changed), changed
    changes_trials = choice.trials is not CHOICES["committed"].trials
    assert bool(changed) + changes_trials == (name != "committed")


def test_a_choice_of_trials_starts_those_that_move_with_their_velocity():
    @dataclass
    class Trial:
        experiment: str
        in_motion: bool = False

    trials = [Trial(kind) for kind in ("static_tilt", "release", "curl")]
    assert [trial.in_motion for trial in CHOICES["velocity"].trials(trials)] == [False, True, True]
    assert all(choice.trials(trials) is trials for name, choice in CHOICES.items() if name != "velocity")


def test_least_squares_is_the_method_of_every_stage(settings):
    for stage, config in settings.items():
        method = fit_of(CHOICES["least-squares"].settings(stage, config), ()).method
        assert isinstance(method.optimizer, LeastSquares)


@pytest.mark.parametrize("name", CHOICES)
def test_quick_settings_are_small_and_valid(name, settings):
    for stage, config in settings.items():
        small = quick(stage, CHOICES[name].settings(stage, config))
        assert small.frames <= 60
        assert fit_of(small, ()).method.optimizer.steps() <= 3
