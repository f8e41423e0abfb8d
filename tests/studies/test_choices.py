"""The table of choices: each row changes what it says, and settings that a stage accepts."""

from dataclasses import dataclass

import pytest

from studies.choices import CHOICES
from studies.stage_chain import STAGES, committed
from trunkline.identification.fit.setup import fit_of


@pytest.mark.parametrize("name", CHOICES)
def test_a_choice_changes_what_its_title_says_and_nothing_else(name):
    choice, changed = CHOICES[name], set()
    for stage in STAGES:
        before, after = vars(committed(stage)), vars(choice.settings(stage))
        for key in (key for key in before if before[key] != after[key]):
            changed |= before[key].keys() ^ after[key].keys() if key == "parameters" else {key}
    assert all(key in choice.title for key in changed), changed
    assert bool(changed) + choice.moving == (name != "committed")


def test_a_choice_of_trials_starts_those_that_move_with_their_velocity():
    @dataclass
    class Trial:
        experiment: str
        in_motion: bool = False

    trials = [Trial(kind) for kind in ("static_tilt", "release", "curl")]
    assert [trial.in_motion for trial in CHOICES["velocity"].trials(trials)] == [False, True, True]
    assert all(choice.trials(trials) is trials for name, choice in CHOICES.items() if name != "velocity")


@pytest.mark.parametrize("name", CHOICES)
def test_settings_of_a_choice_are_valid_in_every_stage(name):
    for stage in STAGES:
        fit_of(CHOICES[name].settings(stage), ())
