"""The budget is the textbook's where the arm is linear, and its draws are of what it says."""

from dataclasses import dataclass, replace

import numpy as np
import pytest
from scipy.stats import chi
from scipy.stats import t as student

from tests.support.matched_plant import small_model
from tests.support.residual import everywhere
from trunkline.identification.parameters.parameters import PARAMETERS
from trunkline.identification.simulate.experiment import SLACK
from trunkline.recordings.trials.conditions import Conditions
from trunkline.report.certificate import budget as budgets
from trunkline.report.certificate.arms import arm_of, arms_with
from trunkline.report.certificate.budget import FRICTION, LACKING, NOISE, Inputs, budget
from trunkline.report.certificate.discrepancy import discrepancy, holding
from trunkline.report.certificate.poses import StaticPoses, draw_poses
from trunkline.twin.discrepancy import Discrepancy
from trunkline.twin.posterior import Posterior

SMALL = 1e-3  # rad, of a mount: tips move along straight lines


@pytest.fixture(scope="module")
def model():
    model = small_model(3)
    model.tendon_frictionloss[:] = 0
    return model


def straight(model, count=1) -> StaticPoses:
    """Without weight and pull."""
    chain = arm_of(model).chain
    return StaticPoses(np.zeros((count, 3)), np.tile(chain.straight_lengths + SLACK, (count, 1)))


def mounts(correlation: float, degrees: float = 1e6) -> Posterior:
    """Of both tilts of a mount, alike."""
    names, wide = ["mount_tilt_x", "mount_tilt_y"], np.ones(2)
    matrix = np.array([[1, correlation], [correlation, 1]])
    return Posterior(names, ["a", "a"], 0 * wide, SMALL / PARAMETERS[names[0]].scale * wide, degrees * wide, matrix,
                      -1e3 * wide, 1e3 * wide)  # fmt: skip


def nothing_known() -> Posterior:
    none = np.zeros(0)
    return Posterior([], [], none, none, none, np.zeros((0, 0)), none, none)


def contributions(result) -> dict[str, float]:
    return {source.name: float(source.contributions[0]) for source in result.sources}


@dataclass
class MovedTip:
    """An arm of which nothing is asked but its tip, m. Shape (1, 3)."""

    tip: np.ndarray

    def tips(self, poses, near) -> np.ndarray:
        return self.tip


@pytest.fixture
def linear(model, monkeypatch):
    """Tips of tilted arms by the slopes of two arms, which 8 that are drawn meet: to solve 20,000 takes minutes."""
    poses, arm = straight(model), arm_of(model)
    straight_tip, near = arm.tips(poses), arm.rest(poses).qpos

    def solved(values) -> np.ndarray:
        return np.array([other.tips(poses, near) for other in arms_with(model, values)]) - straight_tip

    step = {"mount_tilt_x": np.array([SMALL, 0]), "mount_tilt_y": np.array([0, SMALL])}
    slopes = solved(step) / SMALL

    def lines(_, values):
        moved = np.tensordot(np.stack([values[name] for name in step], axis=1), slopes, axes=1)
        return [MovedTip(straight_tip + move) for move in moved]

    drawn = mounts(0.0, degrees=4).sample(8, 0)
    moved = np.array([line.tip for line in lines(model, drawn)]) - straight_tip
    np.testing.assert_allclose(moved, solved(drawn), rtol=1e-3, atol=5e-3 * np.abs(moved).max())
    monkeypatch.setattr(budgets, "arms_with", lines)


@pytest.mark.usefixtures("linear")
def test_two_uncorrelated_tilts_add_up_as_in_the_guide(model):
    length, rng = arm_of(model).chain.length, np.random.default_rng(0)
    result = budget(Inputs(model, mounts(0.0), None, 0.0), straight(model), 3000, 2, rng)
    lines = contributions(result)
    assert lines["mount_tilt_x"] == pytest.approx(length * SMALL, rel=1e-3)
    assert lines["mount_tilt_y"] == pytest.approx(length * SMALL, rel=1e-3)
    assert lines[FRICTION] == lines[NOISE] == 0
    assert result.combined[0] == pytest.approx(np.sqrt(2) * length * SMALL, rel=1e-3)
    assert result.radius[0] == pytest.approx(chi(2).ppf(0.95) * length * SMALL, rel=0.03)


@pytest.mark.usefixtures("linear")
def test_tilts_that_are_one_move_the_tip_along_a_line(model):
    """u² does not change, as they move it across each other; but its radius is that of one normal variable."""
    length, rng = arm_of(model).chain.length, np.random.default_rng(1)
    result = budget(Inputs(model, mounts(1.0), None, 0.0), straight(model), 3000, 2, rng)
    assert result.correlated[0] == pytest.approx(0, abs=1e-3 * (length * SMALL) ** 2)
    assert result.radius[0] == pytest.approx(chi(1).ppf(0.95) * np.sqrt(2) * length * SMALL, rel=0.03)


def test_correlation_adds_where_inputs_move_the_tip_the_same_way(model):
    """Tilt and bend about one axis: u = |c_1 u_1 + c_2 u_2| where they are one, and the difference where they are
    opposite."""
    names = ["mount_tilt_x", "rest_bend_x"]
    units = np.array([SMALL / PARAMETERS[name].scale for name in names])
    combined = {}
    for correlation in (-1.0, 0.0, 1.0):
        matrix = np.array([[1, correlation], [correlation, 1]])
        far = np.full(2, 1e6)
        estimates = Posterior(names, ["a", "a"], np.zeros(2), units, far, matrix, -far, far)
        result = budget(Inputs(model, estimates, None, 0.0), straight(model), 4, 1, np.random.default_rng(2))
        combined[correlation] = result.combined[0]
        lines = contributions(result)
    first, second = lines["mount_tilt_x"], lines["rest_bend_x"]
    assert min(first, second) > 1e-4
    assert combined[0.0] == pytest.approx(np.hypot(first, second), rel=1e-6)
    assert sorted([combined[-1.0], combined[1.0]]) == pytest.approx([abs(first - second), first + second], rel=1e-3)


@pytest.mark.usefixtures("linear")
def test_few_degrees_of_freedom_make_it_wider_by_student_s_factor(model):
    rng = np.random.default_rng(3)
    result = budget(Inputs(model, mounts(1.0, degrees=4), None, 0.0), straight(model), 20_000, 1, rng)
    length = arm_of(model).chain.length
    assert result.radius[0] == pytest.approx(student(4).ppf(0.975) * np.sqrt(2) * length * SMALL, rel=0.04)


def test_noise_alone_is_a_ball_of_its_own(model):
    result = budget(Inputs(model, nothing_known(), None, 1e-3), straight(model), 20_000, 1, np.random.default_rng(4))
    assert result.combined[0] == pytest.approx(np.sqrt(3) * 1e-3)
    assert result.radius[0] == pytest.approx(chi(3).ppf(0.95) * 1e-3, rel=0.02)


def test_friction_is_rectangular_between_the_ends_of_its_band(model):
    rubbing = model.__copy__()
    rubbing.tendon_frictionloss[:] = 0.3
    arm = arm_of(rubbing)
    pulls = np.array([[0.015, -SLACK, -SLACK]])
    poses = StaticPoses(np.array([[0.0, 0.0, -9.81]]), arm.chain.straight_lengths - pulls)
    half = np.linalg.norm(arm.friction(poses)[0])
    assert half > 5e-4
    result = budget(Inputs(rubbing, nothing_known(), None, 0.0), poses, 20_000, 1, np.random.default_rng(5))
    assert contributions(result)[FRICTION] == pytest.approx(half / np.sqrt(3))
    assert result.radius[0] == pytest.approx(0.95 * half, rel=0.01)


def test_what_the_model_lacks_has_the_variance_that_it_says():
    lacking = Discrepancy(np.array([[2e-3, 0.01, 0.02]]), 5)
    ways, arms = np.array([[0.1, 0.0], [0.1, 0.3]]), np.array([[0, 0, -0.5], [0.3, 0, -0.3]])
    draws = lacking.offsets(ways, arms, 20_000, np.random.default_rng(6))
    deviation = np.sqrt((draws**2).sum(axis=2).mean(axis=0))
    expected = [np.hypot(2e-3, 1e-3), np.linalg.norm([2e-3, 1e-3, 6e-3])]
    np.testing.assert_allclose(deviation, expected, rtol=0.02)
    np.testing.assert_allclose(lacking.deviation(ways), expected)
    assert np.abs(np.einsum("dnk,nk->dn", draws, arms)).max() < 1e-15, "across the arm"


def residuals_of(true, count: int, rng: np.random.Generator) -> tuple[np.ndarray, np.ndarray]:
    """Lengths (N,) of what a model with the scales `true` (3,) lacks, and ways (N, 2), some of them 0."""
    ways = rng.uniform(0, 0.3, (count, 2)) * rng.integers(0, 2, (count, 2))
    deviation = Discrepancy(np.array([true]), count).deviation(ways) / np.sqrt(2)
    return np.linalg.norm(deviation[:, None] * rng.standard_normal((count, 2)), axis=1), ways


def test_scales_of_what_the_model_lacks_come_back_from_many_residuals_and_few_leave_them_wide():
    true = np.array([2e-3, 0.01, 0.03])
    residuals, ways = residuals_of(true, 300, np.random.default_rng(7))
    many = discrepancy(residuals, ways, np.zeros(300))
    np.testing.assert_allclose(many.rms, true, rtol=0.15)
    few = discrepancy(residuals[:4], ways[:4], np.zeros(4))

    def spread(lacking: Discrepancy) -> float:
        return float(np.std(np.log(lacking.draw(4000, np.random.default_rng(8))[:, 2])))

    assert spread(few) > 4 * spread(many)


def test_a_model_that_is_off_where_it_hardly_moves_is_so_said_to_be():
    """Residuals that are as large at the smallest ways as at the largest: shares alone would state next to nothing."""
    residuals, _ = residuals_of(np.array([8e-3, 0, 0]), 16, np.random.default_rng(3))
    lacking = discrepancy(residuals, np.linspace(0.002, 0.3, 16)[:, None] * np.ones(2), np.zeros(16))
    small = lacking.offsets(np.full((1, 2), 0.002), np.array([[0, 0, -0.5]]), 4000, np.random.default_rng(4))
    assert 0.008 < np.quantile(np.linalg.norm(small, axis=2), 0.95) < 0.025


def test_the_constant_covers_small_and_large_ways_alike():
    """Of 25 models, each with its own scales and 12 residuals, the 90 % radius holds 90 % of what comes next."""
    rng, inside = np.random.default_rng(12), []
    for _ in range(25):
        true = np.exp(rng.normal(np.log([4e-3, 0.01, 0.03]), 0.4))
        residuals, ways = residuals_of(true, 62, rng)
        lacking = discrepancy(residuals[:12], ways[:12], np.zeros(12))
        arms = np.tile([0.0, 0.0, -0.5], (50, 1))
        radius = np.quantile(np.linalg.norm(lacking.offsets(ways[12:], arms, 1000, rng), axis=2), 0.9, axis=0)
        inside.append(residuals[12:] <= radius)
    assert 0.87 < np.mean(inside) < 0.97


def test_residuals_that_other_sources_explain_leave_nothing_to_the_model():
    rng, wide = np.random.default_rng(9), 2e-3
    residuals = np.linalg.norm(wide / np.sqrt(2) * rng.standard_normal((200, 2)), axis=1)
    ways = np.full((200, 2), 0.2)
    assert discrepancy(residuals, ways, np.full(200, wide**2)).deviation(ways).max() < 0.4 * wide
    assert discrepancy(residuals, ways, np.zeros(200)).deviation(ways).max() > 0.9 * wide


def test_poses_lie_within_the_conditions(model):
    conditions = Conditions(tilt_deg=60.0, pulled_tilt_deg=10.0, pull=0.04, pulls=0.05)
    chain = arm_of(model).chain
    poses = draw_poses(chain, conditions, 400, np.random.default_rng(11))
    pulls = np.maximum(chain.straight_lengths - poses.commands, 0)
    pulled = pulls.max(axis=1) > 0
    assert 0.7 < pulled.mean() < 0.9
    assert pulls.max() <= 0.04
    assert pulls.sum(axis=1).max() <= 0.05
    tilt = np.degrees(np.arccos(-poses.gravity[:, 2] / np.linalg.norm(poses.gravity, axis=1)))
    assert tilt[pulled].max() <= 10.0
    assert 10.0 < tilt[~pulled].max() <= 60.0


def test_the_tip_that_it_is_about_is_moved_by_the_residual_map(model):
    poses, inputs = straight(model, 2), Inputs(model, nothing_known(), None, 1e-4)
    turn, shift = arm_of(model).turn, np.array([0.002, -0.001, 0.003])
    maps = None, everywhere(list(shift))
    tips = [budget(replace(inputs, residual_map=m), poses, 2, 5, np.random.default_rng(0)) for m in maps]
    np.testing.assert_allclose(tips[1].tips - tips[0].tips, [turn @ shift] * 2, atol=1e-7)
    np.testing.assert_array_equal(tips[1].radius, tips[0].radius)


@pytest.mark.parametrize(("far", "wider"), [(0, 1.0), (1, 1.0), (3, 4.0)])
def test_scales_are_so_wide_that_so_many_trials_are_within_their_radii(far, wider):
    """Forty trials, all but a few within the radius, these four times as far off: of 40, one may be beyond."""
    inferred, ways = Discrepancy(np.tile([0.003, 0.01, 0.02], (400, 1)), 40), np.full((40, 2), 0.05)
    radius = np.sqrt((inferred.scales[0] ** 2) @ np.array([1, 0.0025, 0.0025])) * np.sqrt(-np.log(0.05))
    residuals = 0.9 * radius * np.linspace(0.1, 1.0, 40)
    residuals[:far] = wider * radius if far == 3 else 4 * radius
    widened = holding(inferred, residuals, ways, 0.95)
    np.testing.assert_allclose(widened.scales / inferred.scales, wider, rtol=0.1)
    assert holding(inferred, residuals[:15], ways[:15], 0.95).scales[0, 0] == pytest.approx(
        0.003 * max(residuals[:15].max() / radius, 1.0), rel=0.1
    )


def both_ways(unknown: float) -> tuple[Inputs, StaticPoses]:
    """Of an arm of which a map leaves that share `unknown` everywhere; 3 mm is lacking of it, 6 mm of the twin."""
    model = small_model(3)
    poses = draw_poses(arm_of(model).chain, Conditions(20.0, 20.0, 0.02, 0.02), 6, np.random.default_rng(1))
    scales = [Discrepancy(np.array([[scale, 0.0, 0.0]]), 30) for scale in (0.006, 0.003)]
    learnt = everywhere([0.0, 0.0, 0.001])
    object.__setattr__(learnt, "unknown", lambda at: np.full(len(at), unknown))
    return Inputs(model, mounts(0.0), scales[0], 1e-4, learnt, scales[1]), poses


def test_where_a_map_tells_all_what_it_is_missed_by_is_the_uncertainty_and_where_nothing_the_twin_s():
    all_of_it, poses = both_ways(0.0)
    mapped = budget(all_of_it, poses, 20, 50, np.random.default_rng(0))
    np.testing.assert_allclose(mapped.radius, 0.003 * np.sqrt(-np.log(0.05)), rtol=0.1)
    values = contributions(mapped)
    assert values[FRICTION] == values["mount_tilt_x"] == 0.0
    assert values[LACKING] == pytest.approx(0.003)
    nothing, _ = both_ways(1.0)
    without = replace(nothing, residual_map=None, left=None)
    radii = [budget(each, poses, 20, 50, np.random.default_rng(0)).radius for each in (nothing, without)]
    np.testing.assert_allclose(*radii, rtol=0.02)  # the arm's tip, and so what is across it, is a mm aside
    half = budget(both_ways(0.5)[0], poses, 20, 50, np.random.default_rng(0))
    assert contributions(half)[LACKING] == pytest.approx(np.sqrt((0.006**2 + 0.003**2) / 2))
    assert np.median(mapped.radius) < np.median(half.radius) < np.median(radii[0])


def test_what_a_map_lacks_holds_as_many_of_its_poses_as_are_stated():
    model, rng = small_model(3), np.random.default_rng(1)
    poses = draw_poses(arm_of(model).chain, Conditions(20.0, 20.0, 0.02, 0.02), 40, rng)
    missed = np.full(40, 1e-3)
    missed[:3] = 0.02
    left = budgets.left_by_map(arm_of(model), 1e-4, poses, missed)
    radius = left.deviation(arm_of(model).ways(poses)) * np.sqrt(-np.log(0.05))
    assert np.sum(missed > 1.1 * radius) <= 2
