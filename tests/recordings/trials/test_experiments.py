"""The table of experiments says enough about each kind for every room that reads it."""

import runpy

import numpy as np
import pytest
from pydantic import TypeAdapter, ValidationError

from demo.experiments import PLANS
from trunkline.recordings.trials.experiments import EXPERIMENTS, ExperimentName, is_static
from trunkline.recordings.trials.trial import Trial
from trunkline.report.figures import data


@pytest.mark.parametrize("name", EXPERIMENTS)
def test_a_kind_rests_throughout_or_tells_when_it_begins(name):
    kind = EXPERIMENTS[name]
    assert kind.static == is_static(name) == (kind.start is None)
    assert kind.free is None or kind.start is not None
    assert not (kind.hangs and kind.needs_motors)
    assert kind.level is None or kind.level.low < kind.level.high


def test_no_two_kinds_have_the_same_words():
    words = [word for kind in EXPERIMENTS.values() for word in kind.words]
    assert len(words) == len(set(words))
    assert len({kind.plural for kind in EXPERIMENTS.values()}) == len(EXPERIMENTS), "tables tell kinds by it"
    signs = {name: (kind.needs_motors, kind.static) for name, kind in EXPERIMENTS.items()}
    assert {(True, False), (False, True), (False, False)} <= set(signs.values()), "what a log without a word can be"


def test_a_name_that_is_no_experiment_is_told_which_there_are():
    check = TypeAdapter(ExperimentName).validate_python
    assert [check(name) for name in EXPERIMENTS] == list(EXPERIMENTS)
    with pytest.raises(ValidationError, match="|".join(EXPERIMENTS)):
        check("tilt")


def test_the_stand_in_lab_plans_every_kind_by_its_name():
    assert set(PLANS) <= set(EXPERIMENTS)


def test_a_kind_that_is_declared_tomorrow_has_a_color_in_pictures(monkeypatch):
    monkeypatch.setitem(EXPERIMENTS, "tomorrow", EXPERIMENTS["curl"])
    assert set(runpy.run_path(data.__file__)["COLORS"]) == set(EXPERIMENTS)


def test_starts_are_found_in_the_signal_that_tells_them():
    """A release by how the arm moves, whatever motors do; a curl by its commands, however late the arm is."""
    time = np.arange(240) / 120
    swing = np.clip(time - 0.8, 0, None) ** 2
    pull = 0.02 * np.clip(time - 0.3, 0, 0.5)
    trial = Trial(
        name="a", experiment="release", split="identify", level=None, gravity=np.array([0, 0, -9.81]), time=time,
        markers=("unit_01",), positions=swing[:, None, None] * np.ones(3), quaternions=None,
        measured=np.ones((240, 1), bool), tendons=("tendon_1",), commands=pull[:, None], tendon_positions=pull[:, None],
    )  # fmt: skip
    assert EXPERIMENTS["release"].start(trial, lambda columns: columns).time == pytest.approx(0.8, abs=0.02)
    assert EXPERIMENTS["curl"].start(trial, lambda columns: columns).time == pytest.approx(0.3, abs=0.02)
