"""The study of starts: it searches for what the stages search for, as they do, and finds it."""

import pytest

from studies import starts
from studies.starts import STAGES, WITHIN, session, settings_of


@pytest.mark.parametrize("name", STAGES)
def test_a_stage_is_searched_for_today_s_parameters_with_its_own_optimizer(name, monkeypatch):
    settings = settings_of(name)
    lacking = {"capstan_friction"} if name == "control" else set()  # the plant's cables do not rub
    assert set(settings.parameters) - set(STAGES[name].true) == lacking
    assert set(STAGES[name].true) <= set(settings.parameters)

    def seen(problem, optimizer, *rest):
        raise StopIteration(problem, optimizer)

    monkeypatch.setattr(starts, "search", seen)
    with pytest.raises(StopIteration) as stopped:
        session(name, 0)
    problem, optimizer = stopped.value.args
    assert optimizer == settings.optimizer
    assert list(problem.parameters) == list(STAGES[name].true)


def test_a_session_of_motors_that_are_off_is_found_from_several_starts():
    ratio, converged, agreeing, count = session("control", 0)
    assert 1 <= ratio <= WITHIN
    assert converged
    assert 2 <= agreeing <= count == 3
