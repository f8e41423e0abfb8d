"""A parameter that two stages identify: intervals without a common value are said."""

import pytest

from trunkline.identification.stages import contradicted


def table(*ends: float, key: str = "interval_95") -> dict:
    return {"parameters": {"kp": {"value": sum(ends) / 2, key: list(ends)}, "damping": {"value": 1.0}}}


@pytest.mark.parametrize(("before", "now", "count"), [
    ((1.0, 2.0), (2.1, 3.0), 1), ((2.1, 3.0), (1.0, 2.0), 1), ((1.0, 2.2), (2.1, 3.0), 0), ((1.0, 4.0), (2.0, 3.0), 0),
])  # fmt: skip
def test_intervals_of_two_stages_that_do_not_overlap_are_said(before, now, count):
    lines = contradicted({"identify_stiffness": table(*before)}, table(*now))
    assert len(lines) == count
    if lines:
        assert lines[0].startswith(f"kp: found {now[0]:g} to {now[1]:g} here and {before[0]:g} to {before[1]:g} in ide")


def test_what_is_considered_counts_where_a_stage_has_it():
    wide = table(1.0, 2.5)
    wide["parameters"]["kp"]["interval_95_given_model"] = [1.0, 1.5]
    assert contradicted({"identify_stiffness": wide}, table(2.1, 3.0, key="interval_95_given_model")) == []
    assert contradicted({"identify_stiffness": table()}, table(2.1, 3.0)) == []


def test_parameters_of_a_session_count_too():
    before, now = ({"parameters": {}, "per_session": table(*ends)["parameters"]} for ends in ((1.0, 2.0), (2.1, 3.0)))
    (line,) = contradicted({"identify_stiffness": before}, now)
    assert line.startswith("kp: found 2.1 to 3 here")
