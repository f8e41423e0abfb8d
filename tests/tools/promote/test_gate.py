"""The replay gate, by a table of cases."""

import math

import pytest

from trunkline.tools.promote.gate import FACTOR, against


def metrics(kinds: dict[str, tuple], noise=0.0) -> dict:
    """Of a twin by kind its errors of position and, unless None, tip, mm; the noise floor has the same everywhere."""
    names = ("e_position_mm", "e_tip_mm")
    table = {k: {n: v for n, v in zip(names, values, strict=True) if v is not None} for k, values in kinds.items()}
    mean = sum(row["e_position_mm"] for row in table.values()) / len(table)
    floor = {kind: dict.fromkeys(names, noise) for kind in kinds}
    return {"model": {"by_experiment": table, "e_position_mm": mean}, "noise_floor": {"by_experiment": floor}}


OLD = {"curl": (2.0, 6.0), "release": (4.0, 8.0)}


@pytest.mark.parametrize(
    ("new", "noise", "better", "faults"),
    [
        (OLD, 0.0, False, []),  # the same is good enough on the old session,
        (OLD, 0.0, True, ["e_position_mm"]),  # and no reason to exchange twins on the new one
        ({"curl": (1.9, 6.0), "release": (4.0, 8.0)}, 0.0, True, []),
        ({"curl": (2.0 * FACTOR, 6.0 * FACTOR), "release": (1.0, 8.0)}, 0.0, True, []),  # just as bad as may be
        ({"curl": (2.0, 6.001 * FACTOR), "release": (1.0, 8.0)}, 0.0, True, ["curl: e_tip_mm"]),
        ({"curl": (2.001 * FACTOR, 6.0), "release": (1.0, 8.0)}, 0.0, False, ["curl: e_position_mm"]),
        ({"curl": (2.6, 6.0), "release": (1.0, 8.6)}, 0.6, False, []),  # within the noise
        ({"curl": (2.7, 6.0), "release": (1.0, 8.0)}, 0.6, False, ["curl: e_position_mm"]),
        ({"curl": (3.0, 9.0), "release": (9.0, 9.0)}, 0.0, True,
         ["curl: e_position_mm", "curl: e_tip_mm", "release: e_position_mm", "release: e_tip_mm", "e_position_mm"]),
        ({"curl": (math.nan, 6.0), "release": (1.0, 8.0)}, 0.0, True, ["curl: e_position_mm", "e_position_mm"]),
        ({"curl": (1.0, 6.0)}, 0.0, True, ["release: e_position_mm", "release: e_tip_mm"]),  # a kind is missing
        ({"curl": (1.0, None), "release": (1.0, 8.0)}, 0.0, True, ["curl: e_tip_mm"]),
    ],
)  # fmt: skip
def test_a_twin_passes_where_it_replays_every_kind_about_as_well(new, noise, better, faults):
    reasons = against("spring", metrics(OLD), metrics(new, noise), better)
    assert [reason.removeprefix("spring: ").partition(": found")[0] for reason in reasons] == faults


def test_a_tip_that_nobody_saw_is_not_asked_for():
    old, new = ({"curl": (value, None)} for value in (2.0, 1.0))
    assert against("spring", metrics(old), metrics(new), better=True) == []
