"""What an answer that misses, or never came, counts as in every number of the score."""

from types import SimpleNamespace

import numpy as np
import pytest

from trunkline.kinematics.ik import as_controls
from trunkline.kinematics.ik import score as scoring
from trunkline.kinematics.ik.as_controls import Reached
from trunkline.kinematics.ik.score import TipErrors
from trunkline.model.statics.chain import FORCE_ROUNDING
from trunkline.model.statics.equilibria import Equilibrium

LENGTH = 0.5  # m
NEVER = (np.nan, np.inf)


def reached(position, doubtful=False, seconds=np.nan, rested=True) -> Reached:
    position = np.array(position, dtype=float)
    rows = (np.broadcast_to(value, position.shape) for value in (doubtful, seconds, rested))
    return Reached(position, *rows)


@pytest.mark.parametrize("never", NEVER)
def test_a_command_after_which_no_end_came_misses_by_the_arm_s_length(never):
    scores = reached([0.001, never, 0.002]).metrics(LENGTH)
    assert scores["position_error_mm"] == pytest.approx({"median": 2.0, "p95": 450.2, "max": 500.0})
    assert scores["beyond_1pct"] == scores["beyond_1pct_unsaid"] == 1


@pytest.mark.parametrize("never", NEVER)
def test_an_answer_without_an_equilibrium_misses_by_the_arm_s_length_and_half_a_turn(never):
    scores = TipErrors(np.array([0.001, never, 0.002]), np.radians([1.0, never, 2.0])).metrics(LENGTH)
    assert scores["position_error_mm"] == pytest.approx({"median": 2.0, "p95": 450.2, "max": 500.0})
    assert scores["orientation_error_deg"] == pytest.approx({"median": 2.0, "p95": 162.2})
    assert (scores["targets"], scores["failed"]) == (3, 1)
    assert scores["within_1pct"] == pytest.approx(2 / 3)


def test_a_position_alone_decides_whether_an_answer_failed():
    """An orientation cannot come without it."""
    scores = TipErrors(np.array([0.001, 0.002]), np.array([0.0, 0.1])).metrics(LENGTH)
    assert (scores["failed"], scores["targets"]) == (0, 2)
    assert "beyond_force" not in scores


@pytest.mark.parametrize(
    ("miss", "within", "closely"),
    [(0.0, 1, 1), (0.0005, 1, 1), (0.00051, 1, 0), (0.005, 1, 0), (0.00501, 0, 0), (np.nan, 0, 0)],
)
def test_within_a_share_of_the_length_is_up_to_it(miss, within, closely):
    scores = TipErrors(np.array([miss]), np.array([0.0])).metrics(LENGTH)
    assert (scores["within_1pct"], scores["within_0p1pct"]) == (within, closely)


@pytest.mark.parametrize(
    ("miss", "doubtful", "beyond", "unsaid"),
    [
        (0.0, False, 0, 0),
        (0.0, True, 0, 0),
        (0.005, False, 0, 0),  # 1 % is not beyond 1 %
        (0.00501, False, 1, 1),
        (0.00501, True, 1, 0),
        (np.nan, False, 1, 1),
        (np.nan, True, 1, 0),
    ],
)
def test_a_miss_is_said_only_where_its_own_answer_was_doubted(miss, doubtful, beyond, unsaid):
    """Beside others that were doubted without need, and missed without."""
    scores = reached([0.0, miss, 0.1], [True, doubtful, False]).metrics(LENGTH)
    assert (scores["beyond_1pct"], scores["beyond_1pct_unsaid"]) == (beyond + 1, unsaid + 1)
    assert scores["doubted"] == pytest.approx((1 + doubtful) / 3)


def test_what_did_not_rest_is_counted_as_a_share():
    scores = reached([0.0, 0.0, 0.0, 0.0], rested=[True, False, True, True]).metrics(LENGTH)
    assert scores["rested"] == 0.75
    assert "seconds_to_rest" not in scores


def test_some_of_the_targets_keep_whether_they_rested():
    some = reached([0.001, 0.002, 0.003], rested=[True, False, True])[[1, 2]]
    assert some.rested is not None
    assert some.rested.tolist() == [False, True]
    assert Reached(np.zeros(2), np.zeros(2, bool), np.zeros(2))[[1]].rested is None


def test_of_rest_that_nobody_looked_at_nothing_is_said():
    """As of an arm on which a rig sends commands and gives back tips."""
    scores = Reached(np.zeros(2), np.zeros(2, bool), np.full(2, np.nan)).metrics(LENGTH)
    assert not {"rested", "seconds_to_rest"} & set(scores)


@pytest.mark.parametrize(
    ("seconds", "median", "late"),
    [
        ([1.0, 2.0, 3.0], 2.0, 3.0),
        ([1.0, np.nan, 3.0], 3.0, None),  # what never rested took longer than all others
        ([np.nan, np.nan, 3.0], None, None),
        ([np.nan] * 3, None, None),
        ([*range(1, 40), np.nan], 21, 39),
        ([*range(1, 20), np.nan], 11, None),
    ],
)
def test_times_to_rest_count_what_never_did(seconds, median, late):
    assert reached([0.0] * len(seconds), seconds=seconds).time_to_rest() == {"median": median, "p95": late}


def test_the_time_to_rest_is_beside_errors_where_any_was_looked_at():
    scores = reached([0.0, 0.0], seconds=[2.0, np.nan]).metrics(LENGTH)
    assert scores["seconds_to_rest"] == {"median": None, "p95": None}


def found_at(positions, quaternions, converged, tensions=None) -> Equilibrium:
    count = len(positions)
    blank = {name: np.zeros((count, 3)) for name in Equilibrium.__dataclass_fields__}
    tensions = np.zeros((count, 3)) if tensions is None else tensions
    return Equilibrium(**blank | {
        "position": np.array(positions, float), "quaternion": np.array(quaternions, float),
        "converged": np.array(converged), "tensions": np.array(tensions, float),
    })  # fmt: skip


def test_errors_are_of_position_and_the_shorter_turn_and_of_nothing_without_an_equilibrium(monkeypatch):
    quarter = [np.sqrt(0.5), np.sqrt(0.5), 0, 0]
    places = found_at(
        [[0, 0, -0.4]] * 4, [[1 + 1e-15, 0, 0, 0], [-1, 0, 0, 0], quarter, quarter], [True, True, True, False]
    )
    monkeypatch.setattr(scoring, "actuated", lambda chain, commands, gravity: places)
    targets = np.tile([0.0, 0, 0.003, -0.404, 1, 0, 0, 0], (4, 1))
    errors = scoring.tip_errors(None, targets, np.zeros((4, 3)))
    np.testing.assert_allclose(errors.position, [0.005, 0.005, 0.005, np.nan])
    np.testing.assert_allclose(errors.orientation, [0, 0, np.pi / 2, np.nan], atol=1e-7)
    assert errors.beyond_force is None


def test_lengths_beyond_the_motors_force_are_those_of_any_tendon_at_an_equilibrium(monkeypatch):
    most = np.array([10.0, 20.0, 20.0])
    rounding = 1 + FORCE_ROUNDING
    cases = [
        ([0, 0, 0], True, False),
        ([10 * rounding * 0.999999, 0, 0], True, False),
        ([rounding * 10, 0, 0], True, False),
        ([10 * rounding * 1.000001, 0, 0], True, True),
        ([9, 0, 20 * rounding * 1.000001], True, True),  # any one of them
        ([15, 0, 0], False, False),  # no equilibrium
        ([0, 15, 15], True, False),  # each its own limit
    ]
    tensions, converged, expected = zip(*cases, strict=True)
    places = found_at([[0, 0, -0.4]] * len(cases), [[1, 0, 0, 0]] * len(cases), converged, tensions)
    monkeypatch.setattr(scoring, "forward", lambda chain, lengths, gravity: places)
    targets = np.tile([0.0, 0, 0, -0.4, 1, 0, 0, 0], (len(cases), 1))
    errors = scoring.length_errors(SimpleNamespace(max_tension=most), targets, np.zeros((len(cases), 3)))
    assert errors.beyond_force.tolist() == list(expected)
    assert errors.metrics(LENGTH)["beyond_force"] == pytest.approx(2 / 7)


@pytest.mark.parametrize("end", [np.nan, np.inf])
def test_a_drive_that_ends_nowhere_is_a_miss_not_a_hit(end, monkeypatch):
    """From the simulator to the metric: of three arms the first is lost on its way, the last still moves."""
    targets = np.tile([0.0, 0, 0, -0.4, 1, 0, 0, 0], (3, 1))
    tips = np.array([[end, end, end], [0.0, 0.0, -0.401], [0.0, 0.0, -0.402]])
    model = SimpleNamespace(actuator_trnid=np.arange(3)[:, None])
    answer = {"commands": np.zeros((3, 3)), "doubtful": np.array([False, True, False])}
    rested = np.array([False, True, False])
    ends = SimpleNamespace(end=tips, seconds_to_rest=np.where(rested, 2.0, np.nan), rested=rested)
    monkeypatch.setattr(as_controls, "drive", lambda *_, **__: ends)
    monkeypatch.setattr(as_controls, "settle", lambda *_: SimpleNamespace(position=tips, rested=rested))
    for reached in (
        as_controls.driven(model, lambda _: answer, targets, 5.0),
        as_controls.settled(model, lambda _: answer, targets),
    ):
        metrics = reached.metrics(LENGTH)
        assert metrics["position_error_mm"]["max"] == 500
        assert metrics["beyond_1pct_unsaid"] == 1
        assert metrics["rested"] == metrics["doubted"] == pytest.approx(1 / 3)
