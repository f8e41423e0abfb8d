"""What a model fixes and no stage identifies: how far it moves estimates, against known answers."""

from dataclasses import replace

import mujoco
import numpy as np
import pytest

from tests.support.matched_plant import curl, markers_of, release, small_model, static_pull, tilt
from tests.support.noisy_trials import WEIGHTS, with_values
from trunkline.identification.fit.considered import EARLIER, SCALES, Earlier, Moves, considered, half_widths
from trunkline.identification.fit.intervals import certainty
from trunkline.identification.fit.linearisation import Linearisation, linearise
from trunkline.identification.fit.problem import Bounds, Problem
from trunkline.identification.fit.search import descend
from trunkline.identification.parameters.joints import unit_ends
from trunkline.identification.parameters.parameters import parameter_named
from trunkline.identification.parameters.tolerances import WAVES, WAVES_MOVING, Tolerances, changes, waves
from trunkline.identification.simulate.experiment import prepare
from trunkline.model.arm_model import ArmModel

TRIALS, ROWS = 12, 5
LINE = {"stiffness": Bounds(0.2, 20.0)}


def problem_of(trials, model: mujoco.MjModel, parameters: dict[str, Bounds], frames: int = 60) -> Problem:
    experiments = [prepare(trial, model, frames) for trial in trials]
    return Problem(model, experiments, markers_of(model), parameters, "positions", WEIGHTS)


def moves_of(problem: Problem, linear: Linearisation, sizes: Tolerances, earlier: list[Earlier]) -> Moves:
    """Where the arm bears all of them."""
    moves, lines = considered(problem, linear, sizes, earlier)
    assert lines == []
    return moves


def at_truth(problem: Problem) -> Linearisation:
    """Of the plant that is the model."""
    return linearise(problem, problem.start())


def tilts(truth: mujoco.MjModel):
    return [tilt(truth, angle) for angle in (30, 60, 90)]


def test_the_answer_is_that_of_least_squares_on_changed_residuals():
    rng = np.random.default_rng(1)
    designs, changed = rng.normal(size=(TRIALS, ROWS, 3)), rng.normal(size=(TRIALS, ROWS, 2))
    linear = Linearisation(np.zeros(3), list(rng.normal(size=(TRIALS, ROWS))), list(designs))
    exact = np.linalg.lstsq(designs.reshape(-1, 3), -changed.reshape(-1, 2), rcond=None)[0]
    np.testing.assert_allclose(linear.answers(list(changed)), exact.T, rtol=1e-9)
    pulled = replace(linear, prior=np.array([2.0, 0.0, 1.0]))
    rows = np.concatenate([designs.reshape(-1, 3), np.diag(pulled.prior)])
    target = np.concatenate([-changed.reshape(-1, 2), np.zeros((3, 2))])
    exact = np.linalg.lstsq(rows, target, rcond=None)[0]
    np.testing.assert_allclose(pulled.answers(list(changed)), exact.T, rtol=1e-9)


def test_intervals_hold_the_truth_where_what_is_fixed_is_off():
    """A line whose points all have an offset that the model lacks: given the model, intervals are far too narrow."""
    rng = np.random.default_rng(2)
    design = rng.uniform(0.5, 1.5, (TRIALS, ROWS, 1))
    offset, narrow, wide = 0.4, 0, 0
    for _ in range(500):
        residuals = offset * rng.normal() + 0.3 * rng.normal(size=(TRIALS, ROWS))
        estimate = -(design[..., 0] * residuals).sum() / (design**2).sum()
        linear = Linearisation(np.array([estimate]), list(residuals + design[..., 0] * estimate), list(design))
        half = certainty(linear).half_width
        moves = linear.answers([np.full((ROWS, 1), offset)] * TRIALS)
        narrow += abs(estimate) <= half[0]
        wide += abs(estimate) <= half_widths(half, {("offset", ""): moves[0]})[0]
    assert narrow / 500 < 0.5
    assert 0.93 <= wide / 500 <= 0.99


def test_a_half_width_is_that_of_all_quantities_together():
    moves = {("a", ""): np.array([3.0, 0.0]), ("b", ""): np.array([-4.0, 0.0])}
    np.testing.assert_allclose(half_widths(np.array([2.0, 1.0]), moves), [np.sqrt(4 + 1.96**2 * 25), 1.0], rtol=1e-4)
    assert half_widths(np.array([np.inf]), {("a", ""): np.ones(1)})[0] == np.inf


def test_scatter_is_made_of_waves_that_are_independent_and_alike():
    shapes = np.stack(waves(24))
    np.testing.assert_allclose(shapes @ shapes.T, np.eye(WAVES), atol=1e-12)
    assert len(waves(3)) == 3
    np.testing.assert_allclose(np.stack(waves(3)).T @ np.stack(waves(3)), np.eye(3), atol=1e-12)


def test_a_heavier_arm_is_as_much_stiffer():
    """Weight bends it, so the same shapes follow from a mass and a stiffness that are both larger."""
    model = small_model()
    problem = problem_of(tilts(model), model, LINE)
    moves = moves_of(problem, at_truth(problem), Tolerances(mass=0.03), [])
    assert moves["mass", ""][0] == pytest.approx(np.log(1.03), rel=0.02)


@pytest.mark.parametrize("source", ["stiffness_scatter", "clamp", "ovality", "place_taper", "mass_taper", "unit_end"])
def test_a_move_is_that_of_the_fit_by_the_changed_model(source):
    model = small_model()
    problem = problem_of(tilts(model), model, {**LINE, "mount_tilt_x": Bounds(-0.1, 0.1)})
    sizes = Tolerances(**{source: 3e-4 if source == "unit_end" else 0.02})
    moves = moves_of(problem, at_truth(problem), sizes, [])
    for change in changes(model, sizes, moving=False, pulled=False):
        fields = problem.fields(problem.start()[None], changes=[change])
        changed = model.__copy__()
        for name, values in fields.items():
            getattr(changed, name)[:] = values[0]
        mujoco.mj_setConst(changed, mujoco.MjData(changed))
        other = replace(problem, model=changed)
        exact = descend(other, problem.start(), 30, 1e-12, lambda best: None).vector - problem.start()
        exact[0] -= np.log(
            changed.jnt_stiffness[0] / model.jnt_stiffness[0]
        )  # a change is beside the scalar, not in it
        size = np.abs(exact).max() + 1e-6
        np.testing.assert_allclose(moves[source, change.label], exact, atol=0.1 * size)


def test_what_moved_an_earlier_stage_moves_the_next_by_both_ways():
    """With mass and stiffness, damping is larger too: motion tells forces only up to a common factor."""
    model = small_model()
    model.tendon_frictionloss[:] = 0
    sizes = Tolerances(mass=0.03)
    first = problem_of(tilts(model), model, LINE)
    stiffness = moves_of(first, at_truth(first), sizes, [])
    second = problem_of(
        [release(model, 0.3, frames=60), release(model, -0.2, frames=60)], model, {"damping": Bounds(0.001, 1)}
    )
    scatter = np.array([[0.01]])
    earlier = Earlier("identify_stiffness", ["stiffness"], first.start(), scatter, stiffness)
    moves = moves_of(second, at_truth(second), sizes, [earlier])
    assert moves["mass", ""][0] == pytest.approx(np.log(1.03), rel=0.1)
    alone = moves_of(second, at_truth(second), sizes, [])["mass", ""][0]
    assert abs(alone - np.log(1.03)) > 0.3 * np.log(1.03)
    stiffer = with_values(model, {"stiffness": 1.01 * parameter_named("stiffness").read(model)})
    exact = descend(replace(second, model=stiffer), second.start(), 30, 1e-12, lambda best: None).vector[0]
    scattered = moves[EARLIER, "identify_stiffness 1"][0]
    assert abs(scattered) == pytest.approx(abs(exact - second.start()[0]), rel=0.15)


def test_a_parameter_that_is_identified_anew_is_not_considered():
    model = small_model()
    problem = problem_of(tilts(model), model, LINE)
    earlier = Earlier("identify_stiffness", ["stiffness"], problem.start(), np.array([[0.1]]), {})
    assert moves_of(problem, at_truth(problem), Tolerances(), [earlier]) == {}


def test_markers_move_one_by_one_and_the_base_all_at_once():
    model = small_model()
    problem = problem_of(tilts(model), model, {"mount_tilt_x": Bounds(-0.1, 0.1), "mount_tilt_y": Bounds(-0.1, 0.1)})
    linear = at_truth(problem)
    moves = moves_of(problem, linear, Tolerances(marker_place=1e-3, base_place=1e-3), [])
    last = problem.markers[-1]
    shifted = [replace(e, positions=e.positions.copy()) for e in problem.experiments]
    exact = model.__copy__()
    exact.site_pos[exact.site(f"{last}_center").id, 1] += 1e-3
    blocks = replace(problem, model=exact).residuals(problem.start()[None])
    columns = [(after[0] - before)[:, None] for after, before in zip(blocks, linear.residuals, strict=True)]
    np.testing.assert_allclose(moves["marker_place", f"{last} y"], linear.answers(columns)[0], rtol=1e-6)
    for experiment in shifted:
        experiment.positions[...] += np.array([0, 1e-3, 0])
    blocks = replace(problem, experiments=shifted).residuals(problem.start()[None])
    columns = [(after[0] - before)[:, None] for after, before in zip(blocks, linear.residuals, strict=True)]
    np.testing.assert_allclose(moves["base_place", "y"], linear.answers(columns)[0], rtol=0.02, atol=1e-6)


def test_kinds_that_differ_share_the_estimate():
    """Of one kind alone the estimate is off by as much as that kind is; of two, both moves make it up."""
    model = small_model()
    alone = problem_of(tilts(model), model, LINE)
    sizes = Tolerances(by_kind={"stiffness": 0.04})
    assert moves_of(alone, at_truth(alone), sizes, [])["by_kind", "stiffness static_tilt"][0] == pytest.approx(-0.04)
    both = problem_of([*tilts(model), static_pull(model, [12, 0, 0])], model, LINE)
    moves = moves_of(both, at_truth(both), sizes, [])
    assert sum(move[0] for move in moves.values()) == pytest.approx(-0.04)
    assert [-0.04 < move[0] < 0 for move in moves.values()] == [True, True]


def test_a_zero_of_a_cable_is_like_a_command_that_is_off():
    model = small_model()
    trials = [curl(model, 20, frames=40), curl(model, 35, frames=40)]
    problem = problem_of(trials, model, {"kp": Bounds(10, 1e4)})
    linear = at_truth(problem)
    moves = moves_of(problem, linear, Tolerances(zero=5e-4, backlash=4e-4, hole_place=2e-4, gain=0.05), [])
    shifted = [replace(e, controls=e.controls + np.array([5e-4, 0, 0])) for e in problem.experiments]
    blocks = replace(problem, experiments=shifted).residuals(problem.start()[None])
    columns = [(after[0] - before)[:, None] for after, before in zip(blocks, linear.residuals, strict=True)]
    np.testing.assert_allclose(moves["zero", "1"], linear.answers(columns)[0], rtol=2e-3)  # by a coarser step
    assert moves["backlash", ""][0] != 0
    assert moves["gain", "2"][0] == pytest.approx(0, abs=1e-3)  # the curls are of the first cable
    assert len([key for key in moves if key[0] == "hole_place"]) == 2 * model.nu


def test_nothing_is_considered_where_nothing_is_asked_for():
    model = small_model()
    problem = problem_of(tilts(model), model, LINE)
    assert [sizes.none for sizes in (Tolerances(), Tolerances(clamp=0.1), Tolerances(by_kind={"kp": 0.1}))] == [
        True, False, False,
    ]  # fmt: skip
    assert moves_of(problem, at_truth(problem), Tolerances(), []) == {}
    assert changes(model, Tolerances(hole_place=1e-4, gain=0.1), moving=False, pulled=False) == []


def changed_fields(source: str, size: float, moving: bool = True) -> tuple[mujoco.MjModel, list[dict[str, np.ndarray]]]:
    """A model, and its fields after each of the changes of a source."""
    model = small_model()
    problem = problem_of(tilts(model), model, LINE)
    listed = changes(model, Tolerances(**{source: size}), moving, pulled=True)
    assert {change.source for change in listed} == {source}
    return model, [problem.fields(problem.start()[None], changes=[change]) for change in listed]


def test_thicker_cores_are_stiffer_by_the_fourth_power_of_their_diameter():
    model, [fields] = changed_fields("diameter", 0.01)
    hinges = model.nq
    thickness = np.cbrt(model.jnt_stiffness[:hinges] / model.jnt_stiffness[0])
    grown = (thickness + 0.01) / thickness
    np.testing.assert_allclose(fields["jnt_stiffness"][0, :hinges] / model.jnt_stiffness[:hinges], grown**4, rtol=2e-2)


def test_an_oval_section_is_stiffer_to_one_side_and_softer_to_the_other():
    model, [fields] = changed_fields("ovality", 0.03)
    about_x = np.abs(model.jnt_axis[:, 0]) > 0.5
    ratios = fields["jnt_stiffness"][0] / model.jnt_stiffness
    np.testing.assert_allclose(ratios[about_x], 1.03)
    np.testing.assert_allclose(ratios[~about_x], 0.97)


def test_units_that_end_aside_bend_by_that_over_their_length():
    model, every = changed_fields("unit_end", 1e-4, moving=False)
    lengths = np.linalg.norm(unit_ends(model), axis=1)
    squares = sum(np.square(fields["qpos_spring"][0] - model.qpos_spring) for fields in every)
    assert len(every) == 2 * WAVES  # with as many waves as units, they add up to independent scatter
    np.testing.assert_allclose(np.sqrt(squares), 1e-4 / lengths, rtol=1e-9)


def test_holes_move_out_and_round_as_far_and_motors_differ():
    model, every = changed_fields("hole_place", 2e-4)
    arm = ArmModel(model)
    for cable in range(model.nu):
        sites = arm.cable_sites(arm.cables[cable])
        place = model.site_pos[sites, :2]
        out, aside = (fields["site_pos"][0, sites, :2] - place for fields in every[2 * cable : 2 * cable + 2])
        np.testing.assert_allclose(np.sum(out * place, axis=1), 2e-4 * np.linalg.norm(place, axis=1))
        np.testing.assert_allclose(np.linalg.norm(aside, axis=1), 2e-4)
        np.testing.assert_allclose(np.sum(aside * place, axis=1), 0, atol=1e-12)
    model, every = changed_fields("gain", 0.05)
    gains = [fields["actuator_gainprm"][0, :, 0] / model.actuator_gainprm[:, 0] for fields in every]
    np.testing.assert_allclose(gains, [[1, 1.05, 1], [1, 1, 1.05]])
    biases = [fields["actuator_biasprm"][0, :, 1] / model.actuator_biasprm[:, 1] for fields in every]
    np.testing.assert_allclose(biases, gains)


def test_joints_lie_further_along_towards_the_tip():
    model, [fields] = changed_fields("place_taper", 0.03)
    ends = unit_ends(model)
    moved = np.sum((fields["jnt_pos"][0] - model.jnt_pos) * ends, axis=1) / np.sum(ends**2, axis=1)
    np.testing.assert_allclose(moved[::2], np.linspace(-0.03, 0.03, len(moved) // 2), atol=1e-12)


def test_motion_is_considered_by_slow_waves_at_a_coarser_step_where_the_arm_bears_it(monkeypatch):
    model = small_model(4)
    problem = problem_of([release(model, 0.2, frames=20)], model, LINE, frames=20)
    linear, sizes = at_truth(problem), Tolerances(stiffness_scatter=0.02)
    coarse = moves_of(problem, linear, sizes, [])
    simulate = Problem.simulate

    def broken(self, *args, **more):
        simulated = simulate(self, *args, **more)
        simulated.diverged[:] = self.step_factor > 1
        return simulated

    monkeypatch.setattr(Problem, "simulate", broken)
    fine = moves_of(problem, linear, sizes, [])
    monkeypatch.undo()
    monkeypatch.setattr("trunkline.identification.fit.considered.COARSER", 1.0)
    exact = moves_of(problem, linear, sizes, [])
    assert len(exact) == WAVES_MOVING
    for key, move in exact.items():
        np.testing.assert_array_equal(fine[key], move)
        assert (coarse[key] != move).all()
        np.testing.assert_allclose(coarse[key], move, rtol=0.05, atol=1e-5)


def test_what_a_quantity_moves_is_the_same_whatever_was_simulated_before_it(monkeypatch):
    """Batches of simulations are used again: what another quantity changed in them is there no more."""
    model = small_model()
    problem = problem_of([release(model, 0.2, frames=20)], model, LINE, frames=20)
    sizes = Tolerances(place_taper=0.1, unit_end=3e-4)
    together = moves_of(problem, at_truth(problem), sizes, [])
    monkeypatch.setattr("trunkline.identification.fit.considered.AT_ONCE", 1)
    alone = moves_of(problem, at_truth(problem), sizes, [])
    assert alone.keys() == together.keys()
    for key, move in alone.items():
        np.testing.assert_allclose(move, together[key], rtol=1e-6, atol=1e-12)


def diverging(monkeypatch, too_much) -> None:
    """Makes every simulation diverge in which `too_much` of the problem and a change, or None, is true."""
    simulate = Problem.simulate

    def broken(self, vectors, *args, changes=(), **more):
        simulated = simulate(self, vectors, *args, changes=changes, **more)
        for number in range(len(vectors)):
            if too_much(self, changes[number] if changes else None):
                simulated.diverged[number] = True
                for places in simulated.positions:
                    places[number] = np.nan
        return simulated

    monkeypatch.setattr(Problem, "simulate", broken)


def test_less_of_what_makes_the_arm_diverge_is_taken(monkeypatch):
    """By an eighth of the deviation, times eight; of changes of the model and of trials."""
    model = small_model()
    problem = problem_of([static_pull(model, [12, 0, 0]), static_pull(model, [6, 0, 0])], model, LINE)
    sizes = Tolerances(clamp=0.02, mass=0.01, zero=1e-4, gravity=1e-3)
    whole, linear, share = moves_of(problem, at_truth(problem), sizes, []), at_truth(problem), SCALES[-1]
    pulls = [e.controls for e in problem.experiments]

    def too_much(problem, change):
        stiffer = change and problem.fields(problem.start()[None], changes=[change])["jnt_stiffness"][0, 0]
        longer = [np.abs(e.controls - pull).max() for e, pull in zip(problem.experiments, pulls, strict=True)]
        clamped = change and change.source == "clamp" and stiffer > 1.01 * model.jnt_stiffness[0]
        return bool(clamped) or max(longer) > 5e-5

    diverging(monkeypatch, too_much)
    moves = moves_of(problem, linear, sizes, [])
    assert moves.keys() == whole.keys()
    for key, move in whole.items():
        np.testing.assert_allclose(moves[key], move, rtol=0.05, atol=1e-5)
    smaller = problem_of([static_pull(model, [12, 0, 0]), static_pull(model, [6, 0, 0])], model, LINE)
    monkeypatch.undo()
    for key in [("clamp", ""), ("zero", "1")]:
        expected = moves_of(smaller, linear, sizes.scaled(share), [])[key] / share
        np.testing.assert_allclose(moves[key], expected, rtol=1e-6)
        assert (moves[key] != whole[key]).all()


def test_what_no_deviation_bears_is_left_out_with_a_line(monkeypatch):
    model = small_model()
    problem = problem_of([static_pull(model, [12, 0, 0]), static_pull(model, [6, 0, 0])], model, LINE)
    earlier = Earlier("identify_stiffness", ["kp", "joint_place"], np.array([6.0, 0.1]), np.eye(2) * 0.03, {})
    sizes, linear = Tolerances(clamp=0.02, mass=0.01, gravity=1e-3), at_truth(problem)
    whole = moves_of(problem, linear, sizes, [earlier])
    upright = problem.experiments[0].gravity

    def too_much(problem, change):
        turned = not np.array_equal(problem.experiments[0].gravity, upright)
        return turned or (change is not None and (change.source, change.label) in broken)

    broken = {("clamp", ""), ("identify_stiffness", "1")}
    diverging(monkeypatch, too_much)
    moves, lines = considered(problem, linear, sizes, [earlier])
    assert whole.keys() - moves.keys() == {("clamp", ""), ("gravity", "x"), ("gravity", "y")}
    assert [line.partition(":")[0] for line in lines] == [
        "considered.clamp", "considered.identify_stiffness 1", "considered.gravity x", "considered.gravity y",
    ]  # fmt: skip
    assert all("0.125" in line and "left out" in line for line in lines)
    np.testing.assert_array_equal(moves["mass", ""], whole["mass", ""])
    assert all(np.isfinite(move).all() for move in moves.values())


def test_an_earlier_stage_scatters_the_same_way_for_all_that_come_after_it():
    """A later stage's moves by it, and its own, are of the same directions: they may cancel."""
    model = small_model()
    values = {"stiffness": 1.0, "kp": 600.0}
    correlation = {a: {b: 1.0 if a == b else 0.9 for b in values} for a in values}
    rows = {name: {"value": v, "interval_95_given_model": [0.9 * v, 1.1 * v]} for name, v in values.items()}
    table = {"parameters": rows, "correlation": correlation, "fitted_to": {str(i): "" for i in range(9)}}
    whole = Earlier.from_table("identify_stiffness", table)
    part = whole.without({"kp": Bounds(1, 1e4)})
    assert part.names == ["stiffness"]
    np.testing.assert_array_equal(part.scatter, whole.scatter[:1])
    covariance = whole.scatter @ whole.scatter.T
    assert covariance[0, 1] / np.sqrt(covariance[0, 0] * covariance[1, 1]) == pytest.approx(0.9)
    problem = problem_of([static_pull(model, [12, 0, 0])], model, {"kp": Bounds(10, 1e4)})
    moves = moves_of(problem, at_truth(problem), Tolerances(mass=1e-9), [whole])
    assert [label for source, label in moves if source == EARLIER] == ["identify_stiffness 1", "identify_stiffness 2"]
