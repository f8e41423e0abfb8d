"""The network's commands on the arm itself: what is sent, what is asked, and what no command mends."""

import numpy as np
import pytest

from tests.kinematics.ik.test_as_controls import ANGLES, exact
from trunkline.kinematics.ik.as_controls import draw_targets
from trunkline.kinematics.ik.inputs import gravity_of, position_of
from trunkline.kinematics.ik.on_plant import Rig, across_surface, record, score_on_plant
from trunkline.model.simulation.rest import settle
from trunkline.model.statics.equilibria import actuated

MM = 1e-3  # m


@pytest.fixture(scope="module")
def drawn(model, chain):
    return draw_targets(model, chain, ANGLES, np.full(3, 0.01), 12, np.random.default_rng(0))


class Shifted:
    """A rig whose arm is the model, its tips `shift` m aside; `never` of the drives do not rest."""

    def __init__(self, model, chain, shift=0.0, never=()):
        self.model, self.chain, self.shift, self.never, self.sent = model, chain, shift, list(never), []

    def reach(self, pulls, gravity):
        self.sent.append(pulls)
        commands = (self.chain.straight_lengths - pulls)[:, self.model.actuator_trnid[:, 0]]
        tips = settle(self.model, commands, gravity).position + [self.shift, 0.0, 0.0]
        tips[self.never] = np.nan
        return tips


def score(model, chain, drawn, rig: Shifted, ask=None, pulls=1.0):
    return score_on_plant(model, chain, ask or exact(chain), drawn.targets, drawn.commands, Rig(rig.reach, pulls))


def test_commands_go_to_the_arm_as_they_are(model, chain, drawn):
    """First those by which the targets were drawn, then the network's: idle motors are sent what they are sent."""

    def ask(poses):
        answer = exact(chain)(poses)
        return answer | {"commands": np.tile(chain.straight_lengths + [0.001, -0.002, 0.03], (len(poses), 1))}

    rig = Shifted(model, chain)
    score(model, chain, drawn, rig, ask)
    assert len(rig.sent) == 3
    np.testing.assert_allclose(rig.sent[0], chain.straight_lengths - drawn.commands)
    for sent in rig.sent[1:]:
        np.testing.assert_allclose(sent, np.tile([-0.001, 0.002, -0.03], (len(drawn.targets), 1)))


def test_an_arm_beside_its_twin_misses_the_twin_s_tips_and_less_its_own(model, chain, drawn):
    """The arm's surface is the twin's, 1 mm aside: for its own tips commands need be right by first order only."""
    result = score(model, chain, drawn, Shifted(model, chain, MM))
    assert result["position_error_mm"]["median"] == pytest.approx(1.0, abs=0.05)
    at_tips = result["own_surface"]
    assert at_tips["targets"] == len(drawn.targets)
    assert at_tips["across_mm"]["median"] < 1.0
    assert result["rested"] == at_tips["rested"] == 1.0
    exactly = score(model, chain, drawn, Shifted(model, chain))
    assert exactly["own_surface"]["position_error_mm"]["max"] < 0.05


def test_an_arm_that_does_not_rest_misses_by_its_length_and_is_no_target(model, chain, drawn):
    result = score(model, chain, drawn, Shifted(model, chain, never=[0]))
    count = len(drawn.targets)
    assert result["position_error_mm"]["max"] == pytest.approx(1e3 * chain.length)
    assert result["beyond_1pct"] == 1
    assert result["rested"] == pytest.approx(1 - 1 / count)
    assert result["across_mm"]["p95"] > 1.0
    assert result["own_surface"]["left_out"] == {"unrested": 1}
    assert result["own_surface"]["targets"] == count - 1
    none = score(model, chain, drawn, Shifted(model, chain, never=range(count)))
    assert none["own_surface"] == {"targets": 0, "left_out": {"unrested": count}}


@pytest.mark.parametrize(("off", "of"), [(0.0, 5), (1e-9, 6), (1.0, 12)])
def test_within_are_those_whose_pulls_add_up_to_no_more_than_the_session_s(model, chain, drawn, off, of):
    """Letting out does not count."""
    sums = 1e-3 * (1 + np.arange(12))

    def ask(poses):
        commands = np.tile(chain.straight_lengths, (len(poses), 1))
        commands -= np.stack([sums[: len(poses)] / 2, sums[: len(poses)] / 2, np.full(len(poses), -0.05)], axis=1)
        return {"commands": commands, **dict.fromkeys(("doubtful", "unsure"), np.zeros(len(poses), bool))}

    result = score(model, chain, drawn, Shifted(model, chain), ask, pulls=sums[5] - 1e-10 + off)
    assert result["within"]["targets"] == min(of, len(drawn.targets))
    assert score(model, chain, drawn, Shifted(model, chain), ask, pulls=0.0)["within"] == {"targets": 0}


def test_what_a_command_moves_is_along_the_surface_and_its_normal_is_across(chain, drawn):
    """Steps of either motor that pulls, and what is upright on both."""
    gravity = gravity_of(drawn.targets)
    commands = np.tile(chain.straight_lengths + [-0.012, -0.009, 0.2], (len(gravity), 1))
    here, steps = actuated(chain, commands, gravity).position, []
    for motor in (0, 1):
        moved = commands.copy()
        moved[:, motor] -= 1e-5
        steps.append(actuated(chain, moved, gravity).position - here)
    for step in steps:
        size = np.linalg.norm(step, axis=1)
        assert (across_surface(chain, commands, gravity, step) < 0.01 * size).all()
    normal = np.cross(*steps)
    normal *= MM / np.linalg.norm(normal, axis=1, keepdims=True)
    np.testing.assert_allclose(across_surface(chain, commands, gravity, normal), MM, rtol=1e-3)
    np.testing.assert_allclose(across_surface(chain, commands, gravity, normal + 100 * steps[0]), MM, rtol=1e-2)
    lost = np.full_like(normal, np.nan)
    assert np.isnan(across_surface(chain, commands, gravity, lost)).all()
    assert position_of(drawn.targets).shape == normal.shape


def test_beyond_the_session_s_pulls_where_the_tip_comes_is_in_doubt(model, chain, drawn):
    """All are 1 % and more of the length off; without a doubt of the network's, those within say nothing."""
    far = score(model, chain, drawn, Shifted(model, chain, 0.02 * chain.length), pulls=np.inf)
    assert (far["beyond_1pct"], far["beyond_1pct_unsaid"], far["doubted"]) == (12, 12, 0.0)
    pulls = np.maximum(chain.straight_lengths - exact(chain)(drawn.targets)["commands"], 0).sum(axis=1)
    half = score(model, chain, drawn, Shifted(model, chain, 0.02 * chain.length), pulls=float(np.sort(pulls)[5]))
    assert (half["beyond_1pct"], half["beyond_1pct_unsaid"], half["doubted"]) == (12, 6, 0.5)
    assert half["within"]["beyond_1pct_unsaid"] == 6


@pytest.mark.parametrize("warning", ["doubtful", "unsure"])
def test_either_warning_of_the_network_s_counts(model, chain, drawn, warning):
    def ask(poses):
        return exact(chain)(poses) | {warning: np.arange(len(poses)) < 4}

    far = score(model, chain, drawn, Shifted(model, chain, 0.02 * chain.length), ask, pulls=np.inf)
    assert (far["beyond_1pct"], far["beyond_1pct_unsaid"]) == (12, 8)


def test_the_trusted_are_within_and_not_doubted_and_the_sure_are_those_of_them_that_are_not_unsure(model, chain, drawn):
    def ask(poses):
        rows = np.arange(len(poses))
        return exact(chain)(poses) | {"doubtful": rows < 3, "unsure": (rows < 1) | (rows > 9)}

    result = score(model, chain, drawn, Shifted(model, chain, 0.02 * chain.length), ask, pulls=np.inf)
    assert [result[name]["targets"] for name in ("within", "trusted", "sure")] == [12, 9, 7]
    assert [result[name]["beyond_1pct"] for name in ("within", "trusted", "sure")] == [12, 9, 7]
    nothing = score(model, chain, drawn, Shifted(model, chain), ask, pulls=0.0)
    assert nothing["sure"] == nothing["trusted"] == {"targets": 0}


def test_poses_of_the_arm_tell_how_far_it_is_aside(model, chain):
    many = draw_targets(model, chain, ANGLES, np.full(3, 0.01), 24, np.random.default_rng(1))
    shift, rig = 2 * MM, Shifted(model, chain, 2 * MM, never=[0])
    learnt = record(model, chain, many.targets, many.commands, Rig(rig.reach, 1.0))
    assert learnt is not None
    assert len(learnt.poses) == len(many.targets) - 1
    np.testing.assert_allclose(learnt.residuals, np.tile([shift, 0, 0], (len(learnt.poses), 1)), atol=0.05 * MM)
    few = Shifted(model, chain, never=range(len(many.targets) - 14))
    assert record(model, chain, many.targets, many.commands, Rig(few.reach, 1.0)) is None


def test_other_networks_are_scored_beside_on_the_same_tips(model, chain, drawn):
    """One that knows of the arm misses nothing. The arm's own tips are sought for the first alone."""
    rig, knows = Shifted(model, chain, MM), exact(chain)

    def informed(poses):
        aimed = poses.copy()
        position_of(aimed)[:, 0] -= MM
        return knows(aimed)

    result = score_on_plant(
        model, chain, exact(chain), drawn.targets, drawn.commands, Rig(rig.reach, 1.0), {"with_poses": informed}
    )
    assert len(rig.sent) == 4
    medians = [part["position_error_mm"]["median"] for part in (result["with_poses"], result)]
    assert medians[0] < 0.4 < 0.9 < medians[1]  # mm; aimed off the twin's surface, exact to first order
    assert set(result["with_poses"]) == set(result) - {"with_poses", "own_surface"}
