"""What a label of the rigid map says of a point: reached at first, after further starts, or not at all."""

from types import SimpleNamespace

import numpy as np
import pytest

from trunkline.errors import InputError
from trunkline.kinematics.panda import labels
from trunkline.kinematics.panda.inverse import POSITION_TOLERANCE, ROTATION_TOLERANCE, solve
from trunkline.kinematics.panda.kinematics import Q_MAX, Q_MIN, mount_pose
from trunkline.kinematics.panda.labels import _reached, agreement, label

OFFSET = 0.05  # m
SEED, STARTS, FURTHER = 7, 40, 100
NEAR, FAR = [0.4, 0.0, 0.2], [1.5, 0.0, 0.2]  # m; the latter beyond the links
NEVER = 10**6


@pytest.fixture
def asked(monkeypatch):
    """A solver that needs so many starts for each point, and what it was asked: seed, starts, the points' numbers."""
    calls = []

    def say(needed: list[int]):
        def answer(points, *, seed, starts, mount_offset, avoid_collisions, only):
            numbers = points[only, 1].round().astype(int)  # a point's number stands in its y
            calls.append((seed, starts, numbers.tolist()))
            assert (mount_offset, avoid_collisions) == (OFFSET, True)
            success = np.zeros(len(points), bool)
            success[only] = np.array(needed)[numbers] <= starts
            return SimpleNamespace(success=success)

        monkeypatch.setattr(labels, "solve", answer)
        monkeypatch.setattr(labels, "beyond_links", lambda points, offset: points[:, 0] > 1)
        return calls

    return say


def labelled(points) -> list[bool]:
    return label(
        np.array(points), seed=SEED, starts=STARTS, starts_in_doubt=FURTHER, mount_offset=OFFSET, avoid_collisions=True
    ).tolist()


@pytest.mark.parametrize(
    ("needed", "x", "reached", "rounds"),
    [
        (1, 0.4, True, 1),
        (STARTS, 0.4, True, 1),
        (STARTS + 1, 0.4, True, 2),
        (FURTHER, 0.4, True, 2),
        (FURTHER + 1, 0.4, False, 2),
        (NEVER, 0.4, False, 2),
        (1, 1.5, False, 0),  # the links rule it out
    ],
)
def test_every_point_not_reached_gets_the_same_further_starts(asked, needed, x, reached, rounds):
    """Beside one that is reached at once, one that never is, and one that is out of reach."""
    calls = asked([1, NEVER, needed, 1])
    points = [[0.4, 0, 0.2], [0.4, 1, 0.2], [x, 2, 0.2], [1.5, 3, 0.2]]
    assert labelled(points) == [True, False, reached, False]
    first = [0, 1, 2] if rounds else [0, 1]
    second = [1, 2] if rounds > 1 else [1]
    assert calls == [(SEED, STARTS, first), (SEED + 1, FURTHER, second)]


@pytest.mark.parametrize(
    ("numbers", "says"), [([0, 1, 2], [True, False, True]), ([1], [False]), ([2, 0], [True, True])]
)
def test_a_worker_says_of_its_own_points_what_the_solver_does(asked, numbers, says):
    """In their order, whichever of all the points are its own."""
    asked([1, NEVER, STARTS])
    points = np.array([[0.4, 0, 0.2], [0.4, 1, 0.2], [0.4, 2, 0.2]])
    how = {"seed": SEED, "starts": STARTS, "mount_offset": OFFSET, "avoid_collisions": True}
    (reached,) = _reached((points, how), (np.array(numbers),))
    assert reached.tolist() == says


def test_of_points_that_the_links_rule_out_nothing_is_asked(asked):
    calls = asked([1, 1])
    assert labelled([[1.5, 0, 0.2], [1.6, 1, 0.2]]) == [False, False]
    assert all(numbers == [] for _, _, numbers in calls)
    assert labelled(np.zeros((0, 3))) == []


@pytest.mark.parametrize(
    ("claimed", "reachable", "expected"),
    [
        ("1111", "1100", (0.5, 1.0, 1.0, 2, 2)),
        ("0000", "1100", (0.5, 0.0, 0.0, 2, 2)),
        ("1100", "1100", (1.0, 1.0, 0.0, 2, 2)),
        ("0011", "1100", (0.0, 0.0, 1.0, 2, 2)),
        ("1000", "1110", (0.5, 1 / 3, 0.0, 3, 1)),
    ],
)
def test_rates_are_of_the_points_of_their_kind(claimed, reachable, expected):
    rows = [np.array([letter == "1" for letter in text]) for text in (claimed, reachable)]
    assert agreement(*rows) == pytest.approx(expected)


@pytest.mark.parametrize("labels_alike", ["111", "000"])
def test_labels_of_one_kind_say_nothing(labels_alike):
    rows = np.array([letter == "1" for letter in labels_alike])
    with pytest.raises(InputError, match="reachability.labels: found [03] reachable and [03] .* expected some of both"):
        agreement(np.ones(3, bool), rows)


@pytest.fixture
def descents(monkeypatch):
    """Makes every start of the solver end with the errors of its round, of one target, and the gap of its round."""

    def say(errors: list[tuple[float, float]], gaps: list[float]):
        ends = iter(zip(errors, gaps, strict=True))
        gap_of = {}

        def descend(q, positions, rotations, mount_offset):
            drawn = np.array([next(ends) for _ in range(len(q))], dtype=object)
            for row, (_, gap) in zip(q, drawn, strict=True):
                gap_of[row.tobytes()] = gap
            pairs = np.array([pair for pair, _ in drawn], dtype=float)
            return q, pairs[:, 0], pairs[:, 1]

        monkeypatch.setattr("trunkline.kinematics.panda.inverse._descend", descend)
        monkeypatch.setattr(
            "trunkline.kinematics.panda.inverse.clearance",
            lambda q, offset: np.array([gap_of[row.tobytes()] for row in q]),
        )

    return say


EXACT = (0.5 * POSITION_TOLERANCE, 0.5 * ROTATION_TOLERANCE)


@pytest.mark.parametrize(
    ("errors", "gap", "avoid", "success"),
    [
        ((0.0, 0.0), 0.1, True, True),
        ((POSITION_TOLERANCE, ROTATION_TOLERANCE), 0.1, True, True),
        ((1.001 * POSITION_TOLERANCE, 0.0), 0.1, True, False),  # the place alone
        ((0.0, 1.001 * ROTATION_TOLERANCE), 0.1, True, False),  # the turn alone
        (EXACT, 1e-9, True, True),
        (EXACT, 0.0, True, False),  # it touches itself
        (EXACT, -0.1, True, False),
        (EXACT, -0.1, False, True),  # which is not asked for
        (EXACT, np.nan, True, False),
        ((np.nan, 0.0), 0.1, True, False),
        ((0.0, np.nan), 0.1, True, False),
        ((np.inf, np.inf), 0.1, True, False),
    ],
)
def test_a_solution_is_within_both_tolerances_and_free(descents, errors, gap, avoid, success):
    descents([errors], [gap])
    result = solve(np.array([NEAR]), seed=0, starts=1, avoid_collisions=avoid)
    assert result.success.tolist() == [success]
    assert result.starts.tolist() == [1]


@pytest.mark.parametrize(
    ("errors", "gaps", "success", "starts", "position"),
    [
        ([EXACT, (0.0, 0.0)], [0.1, 0.1], True, 1, EXACT[0]),  # the first success counts
        ([(0.2, 0.0), EXACT], [0.1, 0.1], True, 2, EXACT[0]),
        ([(0.2, 0.0), (0.1, 0.0), (0.3, 0.0), (0.4, 0)], [0.1] * 4, False, 4, 0.1),  # of failures the nearest
        ([EXACT, (0.1, 0.0), EXACT, EXACT], [-0.1, 0.1, 0.1, 0.1], True, 3, EXACT[0]),
        ([(0.0, 0.0), (0.1, 0.0)], [-0.1, 0.1], False, 2, 0.0),  # near, but it touches itself
    ],
)
def test_starts_follow_each_other_until_one_succeeds(descents, errors, gaps, success, starts, position):
    descents(errors, gaps)
    result = solve(np.array([NEAR]), seed=0, starts=len(errors))
    assert (result.success.item(), result.starts.item()) == (success, starts)
    assert result.position_error.item() == position


def test_only_the_targets_that_are_asked_for_are_sought():
    q = np.random.default_rng(3).uniform(Q_MIN, Q_MAX, size=(3, 7))
    positions, rotations = mount_pose(q)
    result = solve(positions, rotations, seed=0, starts=20, avoid_collisions=False, only=np.array([1]))
    assert result.success.tolist() == [False, True, False]
    assert result.starts[[0, 2]].tolist() == [0, 0]
