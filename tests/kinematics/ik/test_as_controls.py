"""Commands as a user sends them: exact ones bring MuJoCo's tip home, lengths sent in their place do not."""

import copy

import numpy as np
import pytest

from trunkline.frames import gravity_in_base
from trunkline.kinematics.ik import as_controls
from trunkline.kinematics.ik.as_controls import AsControls, draw_targets, driven, score, settled
from trunkline.kinematics.ik.inputs import position_of
from trunkline.kinematics.ik.refine import refine
from trunkline.model.simulation.drive import drive
from trunkline.model.simulation.rest import settle

ANGLES = np.radians([[0.0], [60.0]])


@pytest.fixture(scope="module")
def targets(model, chain):
    drawn = draw_targets(model, chain, ANGLES, np.full(3, 0.01), 12, np.random.default_rng(0)).targets
    assert len(drawn) >= 6
    return drawn


def exact(chain, wrong: str | None = None):
    """What a perfect network would answer, of the statics; with `wrong`, lengths for commands."""

    def ask(poses):
        first = np.tile(chain.straight_lengths, (len(poses), 1))
        answer = refine(chain, poses, first, steps=30)
        commands = answer.lengths if wrong else answer.commands
        tip, doubtful = position_of(poses), answer.steps < 0
        return {"commands": commands, "lengths": answer.lengths, "tip": tip, "doubtful": doubtful,
                "unsure": doubtful}  # fmt: skip

    return ask


def test_exact_commands_settle_on_their_targets_and_lengths_do_not(model, chain, targets):
    home = settled(model, exact(chain), targets)
    assert home.rested.all()
    assert home.position.max() < 2e-5
    short = settled(model, exact(chain, "lengths"), targets)
    assert np.median(short.position) > 10 * home.position.max()


def test_a_drive_without_friction_ends_where_settling_does_and_says_when(model, chain, targets):
    reached = driven(model, exact(chain), targets, 20.0, friction=False)
    assert reached.rested.all()
    assert reached.position.max() < 3e-4
    assert ((reached.seconds > 0) & (reached.seconds < 20)).all()


def test_the_score_has_the_model_with_friction_beside_it_without(model, chain):
    settings = AsControls(targets=12, timed=8, sent=4, on_rig=4, seconds=10.0)
    rng = np.random.default_rng(0)
    on_model, drawn, sent = score(model, chain, exact(chain), ANGLES, np.full(3, 0.01), settings, rng)
    assert len(drawn.targets) == len(drawn.commands) == on_model["targets"]
    assert len(sent.position) == on_model["friction"]["targets"] == 4
    assert on_model["targets"] + sum(on_model["left_out"].values()) == 12
    taut = on_model["all_taut"]
    assert taut["targets"] + sum(taut["left_out"].values()) == 12 // 8
    assert "rested" in on_model["friction"], "of the model it is known"
    assert on_model["frictionless"]["position_error_mm"]["max"] < 0.02
    assert on_model["friction"]["dry_friction"]["tendons_n"] == model.tendon_frictionloss.max() > 0


def test_a_target_is_where_its_commands_settle(model, chain):
    drawn = draw_targets(model, chain, ANGLES, np.full(3, 0.01), 12, np.random.default_rng(0))
    rest = settle(model, drawn.commands[:, model.actuator_trnid[:, 0]], gravity_in_base(drawn.targets[:, 0]))
    np.testing.assert_allclose(rest.position, drawn.targets[:, 1:4], atol=2e-5)


def test_a_drive_on_the_twin_that_diverges_misses_by_the_arm_s_length(model, chain, monkeypatch):
    def never_ends(*arguments, **more):
        motion = drive(*arguments, **more)
        motion.end[0] = np.nan
        return motion

    monkeypatch.setattr(as_controls, "drive", never_ends)
    settings, rng = AsControls(targets=12, timed=1, sent=1, on_rig=1, seconds=2.0), np.random.default_rng(0)
    _, _, sent = score(model, chain, exact(chain), ANGLES, np.full(3, 0.01), settings, rng)
    assert sent.missed(chain.length).tolist() == [chain.length]


def test_a_model_without_friction_is_driven_once_and_damped_at_last(model, chain, monkeypatch):
    smooth, driven_arms = copy.copy(model), []
    smooth.tendon_frictionloss[:] = 0

    def counted(model, commands, *rest, **more):
        driven_arms.append(len(commands))
        return drive(model, commands, *rest, **more)

    monkeypatch.setattr(as_controls, "drive", counted)
    settings = AsControls(targets=12, timed=2, sent=4, on_rig=4, seconds=10.0)
    metrics, _, _ = score(smooth, chain, exact(chain), ANGLES, np.full(3, 0.01), settings, np.random.default_rng(0))
    assert driven_arms == [2, metrics["targets"] - 2]
    friction = metrics["friction"]
    assert friction["rested"] == 1.0
    assert friction["position_error_mm"]["max"] < 0.02
    assert friction["seconds_to_rest"] == metrics["frictionless"]["seconds_to_rest"]
    assert friction["dry_friction"] == {
        "tendons_n": 0.0, "joints_nm": 0.0, "sliders": 0, "capstan": 0.0, "backlash_m": 0.0,
    }  # fmt: skip
