"""Commands corrected by the tip as it is seen: on arms that are not as their twin, and where no step may follow."""

from dataclasses import replace
from itertools import pairwise

import numpy as np
import pytest

from tests.model.arm.test_sections import ACTUATION, SOLVER
from tests.support.small_arm import small_spec
from trunkline.ar.correction import correction
from trunkline.ar.correction.correction import CorrectionSettings, TipCorrection, tip_by_pulls
from trunkline.model.arm.sections import Section, Sections
from trunkline.model.arm.tendons import Tendon
from trunkline.model.statics.chain import read_chain
from trunkline.model.statics.equilibria import actuated

DOWN = np.array([0.0, 0.0, -9.81])
SETTINGS = CorrectionSettings(astray=60e-3)  # these arms go far


@pytest.fixture(scope="module")
def chain():
    return read_chain(small_spec(8).compile()).smooth


@pytest.fixture(scope="module")
def two_sections(tmp_path_factory):
    part = Section(length=0.08, units=3, width=0.02, mass=0.02, bending_stiffness=0.02)
    tendons = [Tendon(a + turn, 0.006, end=end) for end, turn in ((3, 0.0), (6, 30.0)) for a in (0.0, 120.0, -120.0)]
    arm = Sections(
        kind="sections", sections=[part, part], joint_range_deg=60.0, damping_ratio=0.3, tendons=tendons,
        hole_ratio=0.8, tip_load=0.0, markers={"tip": 0.16},
    )  # fmt: skip
    return read_chain(arm.build(ACTUATION, SOLVER, tmp_path_factory.mktemp("models")).spec.compile())


def tip_of(chain, commands):
    rest = actuated(chain, commands[None], DOWN)
    assert rest.converged[0]
    return rest.position[0]


def pulled(chain, *pulls, slack=0.2):
    """Commands of these pulls, m; the cables of the other motors are loose by `slack`, m, at most in many steps."""
    pulling, straight = np.array(pulls) > 0, chain.straight_lengths
    loose = np.where(pulling, straight - np.array(pulls), straight + chain.length)
    return np.where(pulling, loose, actuated(chain, loose[None], DOWN).lengths[0] + slack)


def corrected(twin, arm, commands, target, settings=SETTINGS) -> tuple[TipCorrection, list]:
    """The loop until it ends, and all commands that it sent."""
    loop, sent = TipCorrection(twin, DOWN, target, commands, settings), [commands]
    while not loop.ended:
        loop.measured(tip_of(arm, loop.commands))
        sent.append(loop.commands)
    return loop, sent


ARMS = {  # beside the twin
    "softer": lambda chain: chain._replace(stiffness=0.75 * chain.stiffness),
    "stiffer": lambda chain: chain._replace(stiffness=1.3 * chain.stiffness),
    "bent at rest": lambda chain: chain._replace(rest=chain.rest + 0.01),
    "heavier": lambda chain: chain._replace(mass=1.2 * chain.mass),
    "soft cables": lambda chain: chain._replace(gain=0.5 * chain.gain),
}
PULLS = [(0.02, 0.0, 0.0), (0.03, 0.02, 0.0), (0.0, 0.012, 0.02)]


@pytest.mark.parametrize("pulls", PULLS)
@pytest.mark.parametrize("name", ARMS)
def test_the_tip_arrives_on_an_arm_that_is_not_as_its_twin(chain, name, pulls):
    arm = ARMS[name](chain)
    target = tip_of(arm, pulled(chain, *pulls))
    loop, sent = corrected(chain, arm, pulled(chain, *(0.9 * np.array(pulls))), target)
    assert loop.errors[0] > 3e-3, "the open loop"
    assert loop.arrived or min(loop.errors) < 0.3 * loop.errors[0]
    assert max(after - before for before, after in pairwise(loop.errors)) < 2e-3
    assert np.array_equal(sent[-1], sent[int(np.argmin(loop.errors))])


@pytest.mark.parametrize("name", ARMS)
def test_a_tip_of_the_twin_is_met_as_nearly_as_the_arm_can(chain, name):
    """Under two motors tips are a surface, and the arm's is not the twin's."""
    for pulls in PULLS:
        commands = pulled(chain, *pulls)
        loop, _ = corrected(chain, ARMS[name](chain), commands, tip_of(chain, commands))
        assert min(loop.errors) == pytest.approx(
            np.linalg.norm(loop._target - tip_of(ARMS[name](chain), loop.commands))
        )
        assert loop.arrived or min(loop.errors) < loop.errors[0] - 0.2e-3


def test_an_arm_of_two_sections_uses_the_motors_of_both(two_sections):
    true = two_sections._replace(stiffness=0.8 * two_sections.stiffness)
    commands = two_sections.straight_lengths - np.array([0.002, 0.0, 0.0, 0.002, 0.0, 0.0])
    loop, sent = corrected(two_sections, true, commands, tip_of(two_sections, commands))
    assert loop.arrived
    moved = np.abs(sent[-1] - commands) > 1e-6
    assert moved[:3].any()
    assert moved[3:].any()


def test_nothing_is_sent_where_the_tip_has_arrived(chain):
    commands = pulled(chain, 0.02, 0.0, 0.0)
    loop, sent = corrected(chain, chain, commands, tip_of(chain, commands) + [0.0007, 0.0, 0.0])
    assert (loop.ended, loop.arrived, len(loop.errors)) == ("arrived", True, 1)
    assert all(np.array_equal(each, commands) for each in sent)


@pytest.mark.parametrize(("off", "reason"), [
    ([0.031, 0.0, 0.0], "the tip is 31 mm off, expected at most 30 mm"),
    ([np.nan, 0.0, 0.0], "the tip is nan mm off, expected at most 30 mm"),
])  # fmt: skip
def test_a_tip_that_is_far_off_ends_it(chain, off, reason):
    commands = pulled(chain, 0.02, 0.0, 0.0)
    loop = TipCorrection(chain, DOWN, tip_of(chain, commands), commands, CorrectionSettings())
    loop.measured(tip_of(chain, commands) - np.array(off))
    assert (loop.ended, loop.arrived) == (reason, False)
    assert np.array_equal(loop.commands, commands)


def test_after_as_many_steps_as_are_allowed_the_best_is_sent_again(chain):
    commands, rng = pulled(chain, 0.03, 0.02, 0.0), np.random.default_rng(0)
    target = tip_of(chain, commands)
    loop, sent = TipCorrection(chain, DOWN, target, commands, replace(SETTINGS, steps=3)), [commands]
    for error in (9e-3, 5e-3, 7e-3, 6e-3):  # an arm that does as it likes
        assert not loop.ended
        way = rng.normal(size=3)
        loop.measured(target + error * way / np.linalg.norm(way))
        sent.append(loop.commands)
    assert loop.ended == "3 steps are done"
    assert len({each.tobytes() for each in sent}) == 4
    assert np.array_equal(sent[-1], sent[1])


def test_a_step_is_no_longer_than_its_radius_which_halves_where_the_tip_went_away(chain):
    commands = pulled(chain, 0.03, 0.02, 0.01)
    start = tip_of(chain, commands)
    loop = TipCorrection(chain, DOWN, start + [0.05, 0.0, 0.0], commands, replace(SETTINGS, longest=2e-3))
    lengths, before = [], commands
    for tip in (start, start + [0.001, 0.0, 0.0], start - [0.002, 0.0, 0.0], start - [0.004, 0.0, 0.0]):
        loop.measured(tip)
        lengths.append(np.linalg.norm(np.minimum(before, 1.0) - loop.commands))
        before = loop.commands
    np.testing.assert_allclose(lengths, [2e-3, 2e-3, 1e-3, 0.5e-3], rtol=0.01)


def test_no_motor_pushes_and_a_loose_cable_is_wound_a_little_beyond_where_it_pulls(chain):
    commands = pulled(chain, 0.02, 0.0, 0.0)
    rest = actuated(chain, commands[None], DOWN)
    for away in np.vstack([np.eye(3), -np.eye(3)]):
        loop = TipCorrection(chain, DOWN, rest.position[0] + 0.03 * away, commands, replace(SETTINGS, longest=0.05))
        loop.measured(rest.position[0])
        wound = rest.lengths[0] - loop.commands
        assert (wound[1:] <= correction.BEGINS + 1e-6).all()
        assert wound[0] >= -2 * correction.NEGLIGIBLE, "no looser than just loose"


def test_a_loose_cable_is_wound_up_over_several_steps_and_the_arm_then_follows(chain):
    commands = pulled(chain, 0.03, 0.0, 0.0, slack=8e-3)
    target = tip_of(chain, pulled(chain, 0.03, 0.008, 0.0, slack=8e-3))
    loop, sent = corrected(chain, chain, commands, target)
    changes = np.linalg.norm(np.diff(sent, axis=0), axis=1)
    assert max(changes) <= SETTINGS.longest + 1e-12
    assert changes[0] == pytest.approx(SETTINGS.longest)
    assert loop.errors[1] == pytest.approx(loop.errors[0], abs=0.7e-3), "while the cable is loose the arm rests"
    assert min(loop.errors) < 0.3 * loop.errors[0]


@pytest.mark.parametrize(("slack", "steps", "wound"), [(8e-3, 5, True), (8e-3, 2, False), (19e-3, 5, True),
                                                       (21e-3, 5, False)])  # fmt: skip
def test_a_loose_cable_is_wound_up_only_if_a_step_is_left_to_pull(chain, slack, steps, wound):
    """Of `steps` all but one may wind up 5 mm each."""
    commands = pulled(chain, 0.03, 0.0, 0.0, slack=slack)
    target = tip_of(chain, pulled(chain, 0.03, 0.008, 0.0, slack=slack))
    loop = TipCorrection(chain, DOWN, target, commands, replace(SETTINGS, steps=steps))
    loop.measured(tip_of(chain, commands))
    assert (loop.commands[1] < commands[1]) == wound
    assert loop.commands[2] == commands[2]


def test_a_loose_cable_stays_loose_where_the_others_bring_the_tip_most_of_the_way(chain):
    commands = pulled(chain, 0.03, 0.02, 0.0, slack=2e-3)
    loop = TipCorrection(chain, DOWN, tip_of(chain, pulled(chain, 0.032, 0.02, 0.0, slack=2e-3)), commands, SETTINGS)
    loop.measured(tip_of(chain, commands))
    assert loop.commands[2] == commands[2]
    assert (loop.commands[:2] != commands[:2]).all()


def test_an_arm_that_rests_only_as_its_motors_hold_their_place_is_left_alone(chain):
    commands = pulled(chain, 0.015, 0.01, 0.0, slack=1e-4)
    rest = actuated(chain, commands[None], DOWN)
    assert rest.converged[0]
    assert np.isnan(tip_by_pulls(chain, rest, DOWN)).all()
    loop = TipCorrection(chain, DOWN, rest.position[0] + [0.0, 0.0, 5e-3], commands, SETTINGS)
    loop.measured(rest.position[0])
    assert loop.ended == "the twin is near snapping through under these commands"
    assert np.array_equal(loop.commands, commands)


def test_an_arm_that_answers_otherwise_is_learnt(chain):
    """Of a tip that goes twice as far as the twin's, the second step is not too long again."""
    commands = pulled(chain, 0.03, 0.02, 0.0)
    start, target = tip_of(chain, commands), tip_of(chain, pulled(chain, 0.032, 0.021, 0.0))
    loop = TipCorrection(chain, DOWN, target, commands, SETTINGS)
    foreseen = np.linalg.norm(loop._jacobian @ [0.0, 1.0, 0.0])
    loop.measured(start)
    loop.measured(start + 2 * (tip_of(chain, loop.commands) - start))
    assert np.linalg.norm(loop._jacobian @ [0.0, 1.0, 0.0]) > 1.2 * foreseen


def test_a_motor_at_its_largest_force_ends_it(chain):
    commands = pulled(chain, 0.03, 0.0, 0.0)
    rest = actuated(chain, commands[None], DOWN)
    most = rest.tensions[0].max() / correction.STRONGEST
    weak = chain._replace(max_tension=np.full(3, most))
    target = tip_of(chain, pulled(chain, 0.034, 0.0, 0.0))
    loop = TipCorrection(weak, DOWN, target, commands, SETTINGS)
    loop.measured(rest.position[0])
    assert loop.ended == "a motor would be at its largest force"
    assert np.array_equal(loop.commands, commands)
    strong = TipCorrection(chain, DOWN, target, commands, SETTINGS)
    strong.measured(rest.position[0])
    assert not strong.ended


def test_an_arm_near_snapping_through_is_left_alone(chain):
    commands = pulled(chain, 0.03, 0.0, 0.0, slack=2e-3)
    rest = actuated(chain, commands[None], DOWN)
    steep = np.linalg.norm(tip_by_pulls(chain, rest, DOWN), axis=0).max()
    for factor, ends in ((0.9, True), (1.1, False)):
        settings = replace(SETTINGS, steepest=factor * steep)
        loop = TipCorrection(chain, DOWN, rest.position[0] + [0.0, 0.004, 0.004], commands, settings)
        loop.measured(rest.position[0])
        assert (": near snapping through" in loop.ended) == ends


def test_commands_under_which_the_twin_does_not_rest_are_left_alone(chain):
    commands = pulled(chain, 0.02, 0.02, 0.02)
    assert not actuated(chain, commands[None], DOWN).converged[0]
    loop = TipCorrection(chain, DOWN, np.array([0.1, 0.0, -0.4]), commands, SETTINGS)
    loop.measured(np.array([0.1, 0.01, -0.4]))
    assert loop.ended == "the twin does not rest under these commands"
    assert np.array_equal(loop.commands, commands)


def test_it_ends_from_outside_at_the_best_command(chain):
    commands = pulled(chain, 0.02, 0.0, 0.0)
    target = tip_of(chain, pulled(chain, 0.025, 0.0, 0.0))
    loop = TipCorrection(chain, DOWN, target, commands, SETTINGS)
    loop.measured(tip_of(chain, commands))
    loop.refuse("the stream is not sound")
    assert loop.ended == "the stream is not sound"
    assert np.array_equal(loop.commands, commands)


@pytest.mark.parametrize("pulls", [(0.02, 0.0, 0.0), (0.0, 0.012, 0.02), (0.03, 0.02, 0.01)])
def test_the_jacobian_is_that_of_small_changes(chain, pulls):
    commands, step = pulled(chain, *pulls), 1e-5
    rest = actuated(chain, commands[None], DOWN)
    jacobian = tip_by_pulls(chain, rest, DOWN)
    for motor in range(3):
        begin = np.where(np.arange(3) == motor, np.minimum(commands, rest.lengths[0] - step), commands)
        ways = [tip_of(chain, begin - change * np.eye(3)[motor]) for change in (0.0, step)]
        np.testing.assert_allclose((ways[1] - ways[0]) / step, jacobian[:, motor], rtol=0.02, atol=0.02)


def test_two_steps_are_those_of_the_page(chain):
    """With all cables taut and steps that no bound cuts: the least of what is missing and of caution, and a Kalman
    filter's update of both."""
    commands = pulled(chain, 0.03, 0.02, 0.01)
    start = tip_of(chain, commands)
    missing = np.array([0.3e-3, -0.2e-3, 0.4e-3])
    jacobian = tip_by_pulls(chain, actuated(chain, commands[None], DOWN), DOWN)
    variance = (correction.UNSURE**2 * (jacobian**2).sum() / 3) * np.eye(3)
    loop = TipCorrection(chain, DOWN, start + missing, commands, replace(SETTINGS, tolerance=1e-6))
    assert not loop.arrived
    tip = start
    for moved in (np.array([0.5e-3, 0.1e-3, 0.2e-3]), np.zeros(3)):
        loop.measured(tip)
        left = start + missing - tip
        step = np.linalg.solve(jacobian.T @ jacobian + correction.CAUTION * variance, jacobian.T @ left)
        np.testing.assert_allclose(commands - loop.commands, step, atol=1e-8)
        gain = variance @ step / (step @ variance @ step + correction.FRICTION**2)
        jacobian = jacobian + np.outer(moved - jacobian @ step, gain)
        variance = variance - np.outer(gain, variance @ step)
        commands, tip = loop.commands, tip + moved


@pytest.mark.parametrize(("errors", "halved"), [([50, 50.2], 0), ([50, 50.4], 1), ([50, 40, 45], 1), ([50, 40, 39], 0)])
def test_a_step_is_bad_that_leaves_the_tip_farther_off_than_the_best_did(chain, errors, halved):
    commands = pulled(chain, 0.03, 0.02, 0.01)
    start = tip_of(chain, commands)
    loop = TipCorrection(chain, DOWN, start, commands, SETTINGS)
    for error in errors:
        loop.measured(start + [1e-3 * error, 0.0, 0.0])
    assert loop._radius == SETTINGS.longest / 2**halved


def test_where_no_motor_helps_or_the_twin_would_not_rest_nothing_is_sent(chain, monkeypatch):
    commands = pulled(chain, 0.02, 0.0, 0.0)
    start = tip_of(chain, commands)
    loop = TipCorrection(chain, DOWN, start + [0.004, 0.0, 0.0], commands, SETTINGS)
    monkeypatch.setattr(loop, "_change", lambda missing: np.zeros(3))
    loop.measured(start)
    assert loop.ended == "no motor brings the tip nearer"
    loop = TipCorrection(chain, DOWN, start + [0.004, 0.0, 0.0], commands, SETTINGS)
    monkeypatch.setattr(correction, "actuated", lambda *of: replace(actuated(*of), converged=np.array([False])))
    loop.measured(start)
    assert loop.ended == "a motor would be at its largest force"
    assert np.array_equal(loop.commands, commands)


@pytest.mark.parametrize(("short", "at_most"), [((0, 1, 0), 3.5e-3), ((0, 1, 1), 6e-3)])
@pytest.mark.parametrize("loose", [2e-3, 4e-3])
def test_no_step_leads_far_away_where_a_loose_cable_pulls_sooner_than_the_twin_says(chain, short, at_most, loose):
    """Without the limit by up to 25 mm, with that of each loose cable alone by up to 11 mm."""
    rng, away = np.random.default_rng(0), []
    for pull in (0.02, 0.03):
        commands = pulled(chain, pull, 0.0, 0.0, slack=loose)
        earlier = loose * np.array(short)  # m by which the arm's cables are shorter than the twin's
        tip = tip_of(chain, commands - earlier)
        for direction in rng.normal(size=(8, 3)):
            target = tip + rng.uniform(2e-3, 8e-3) * direction / np.linalg.norm(direction)
            loop = TipCorrection(chain, DOWN, target, commands, SETTINGS)
            while not loop.ended:
                loop.measured(tip_of(chain, loop.commands - earlier))
            away.append(max([after - before for before, after in pairwise(loop.errors)], default=0.0))
    assert max(away) < at_most


def test_a_step_whose_cables_together_have_no_known_way_is_not_taken(chain, monkeypatch):
    commands = pulled(chain, 0.02, 0.0, 0.0, slack=2e-3)
    tip, way = tip_of(chain, commands), correction.tip_by_pulls

    def unknown(chain, rest, gravity, taut=False):
        return way(chain, rest, gravity) * (np.nan if np.any(taut) else 1.0)

    monkeypatch.setattr(correction, "tip_by_pulls", unknown)
    loop = TipCorrection(chain, DOWN, tip + np.array([-4e-3, 0.0, -2e-3]), commands, SETTINGS)
    loop.measured(tip)
    assert loop.ended == "the twin is near snapping through once its loose cables pull"
    np.testing.assert_array_equal(loop.commands, commands)
