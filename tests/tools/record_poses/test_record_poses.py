"""`trunkline record-poses`: poses that an arm can rest in, and what a lab does with them."""

from itertools import groupby
from pathlib import Path
from types import SimpleNamespace

import mujoco
import numpy as np
import pytest

from tests.model.arm.test_sections import ACTUATION, SOLVER, arm
from tests.support.small_arm import small_spec
from trunkline.ar.preview.preview_twin import RobotModel
from trunkline.errors import InputError
from trunkline.frames import STANDARD_GRAVITY, downwards
from trunkline.identification.parameters.spool_scale import wound
from trunkline.kinematics.dataset.sampling import around_the_arm
from trunkline.kinematics.ik.as_controls import NEAR_LIMIT, PULL_SHARE
from trunkline.model.arm.joints import Joints, MaxwellElement, add_elements
from trunkline.model.arm.tendons import Tendon
from trunkline.model.arm_model import PRELOAD, WINDING, ArmModel
from trunkline.model.simulation.rest import settle
from trunkline.model.statics.chain import read_chain
from trunkline.report.certificate.arms import StaticArm
from trunkline.tools.record_poses.draw import Mounts, PoseSampler, PosesToRecord
from trunkline.tools.record_poses.order import ordered, short_way
from trunkline.tools.record_poses.words import LEAST_WAIT, Schedule

UNITS = 16  # with few units, some pulls have two shapes
SIDEWAYS = downwards(np.radians([0, 90, 90]), np.radians([0, 0, 180]))
SIX = [Tendon(angle + turn, end=end) for end, turn in ((2, 0.0), (5, 40.0)) for angle in (0.0, 120.0, 240.0)]


@pytest.fixture(scope="module")
def model() -> mujoco.MjModel:
    return small_spec(UNITS).compile()


@pytest.fixture(scope="module")
def source(model) -> PoseSampler:
    return PoseSampler(model, SIDEWAYS, None)


def draw(source: PoseSampler, mounts: Mounts, count: int = 30, pull: float | None = 0.03, seed: int = 1):
    return source.draw(count, mounts, pull, np.random.default_rng(seed))


def at_rest(model: mujoco.MjModel, poses: PosesToRecord, mounts: Mounts):
    """As MuJoCo has it, motors sent what the table says."""
    straight = model.tendon_length0[model.actuator_trnid[:, 0]]
    sent = wound(model, straight - poses.pulls[:, np.argsort(ArmModel(model).actuators)])
    return settle(model, sent, mounts.gravity(poses.mounts))


def test_pulls_and_tilts_stay_in_their_ranges_and_fill_them(model, source):
    poses = draw(source, Mounts(6, tilt_deg=25.0), count=40)
    assert len(poses) == 40
    assert 0.025 < poses.pulls.max() <= 0.03
    assert 15 < poses.mounts[:, 0].max() <= 25
    assert len(np.unique(poses.mounts, axis=0)) == 6
    assert np.ptp(poses.mounts[:, 1]) > 120, "to any side"
    pulling = poses.pulls >= 0
    assert set(pulling.sum(axis=1).tolist()) == {1, 2}
    around = pulling[:, around_the_arm(read_chain(model))]
    assert (around & np.roll(around, -1, axis=1)).any(axis=1)[pulling.sum(axis=1) == 2].all(), "neighbours"
    assert pulling.any(axis=0).all(), "every motor"


def test_loose_cables_are_let_out_alike_and_stay_slack(model, source):
    mounts = Mounts(3, tilt_deg=40.0)
    poses = draw(source, mounts)
    loose = poses.pulls < 0
    assert len(np.unique(poses.pulls[loose])) == 1
    assert -0.2 < poses.pulls.min() <= -0.02
    assert at_rest(model, poses, mounts).tensions[loose] == pytest.approx(0, abs=1e-9)


@pytest.mark.parametrize("mounts", [Mounts(4, 30.0), Mounts(4, 20.0, standing=True), Mounts(1, weightless=True)])
def test_the_twin_rests_in_every_pose_and_its_tip_is_in_the_table(model, source, mounts):
    poses = draw(source, mounts, count=16)
    rest = at_rest(model, poses, mounts)
    assert rest.rested.all()
    np.testing.assert_allclose(poses.tips, rest.position, atol=1e-5)


def test_poses_near_the_motors_limit_are_dropped_and_counted():
    weak = small_spec(UNITS, max_force=5.0).compile()
    source, mounts = PoseSampler(weak, SIDEWAYS, None), Mounts(1)
    poses = draw(source, mounts, count=30, pull=None)
    assert poses.near_limit > 3
    assert 3.5 < at_rest(weak, poses, mounts).tensions.max() < NEAR_LIMIT * 5.0


def test_poses_that_the_arm_reaches_by_a_jump_are_dropped(model, monkeypatch):
    sampler, mounts = PoseSampler(model, SIDEWAYS, None), Mounts(1)
    rest = StaticArm.rest

    def jumping(arm, poses):
        """Where tendon 1 pulls, the arm jumps, or is not found at rest."""
        result, first = rest(arm, poses), poses.commands[:, 0] < arm.chain.straight_lengths[0]
        result.snapped |= first & (poses.commands[:, 1] < arm.chain.straight_lengths[1])
        result.converged &= ~first | result.snapped
        return result

    monkeypatch.setattr(StaticArm, "rest", jumping)
    poses = draw(sampler, mounts)
    assert (poses.pulls[:, 0] < 0).all()
    assert poses.unrested > 10


def test_without_a_pull_it_is_the_share_that_users_reach(source):
    poses = draw(source, Mounts(1), count=40, pull=None)
    deepest = source.deepest
    assert (poses.pulls <= PULL_SHARE * deepest).all()
    assert (poses.pulls.max(axis=0) > 0.4 * deepest).all()


def test_where_drums_are_of_another_size_commands_are_what_the_log_will_say():
    spec = small_spec(UNITS)
    spec.add_numeric(name=WINDING, data=[1.25], size=1)
    spec.add_numeric(name=PRELOAD, data=[0.004, 0.0, -0.002], size=3)
    wound_model, mounts = spec.compile(), Mounts(1)
    source = PoseSampler(wound_model, SIDEWAYS, None)
    true = PoseSampler(small_spec(UNITS).compile(), SIDEWAYS, None)
    np.testing.assert_allclose(source.deepest * 1.25 + [0.004, 0.0, -0.002], true.deepest)
    poses = draw(source, mounts, count=20, pull=0.03)
    assert 0.025 < poses.pulls.max() <= 0.03
    np.testing.assert_allclose(poses.tips, at_rest(wound_model, poses, mounts).position, atol=1e-5)


def test_an_arm_of_two_sections_pulls_both_and_turns_by_its_mount():
    built = arm(tendons=SIX).build(ACTUATION, SOLVER, Path()).spec.compile()
    mounts = Mounts(3, tilt_deg=20.0, sides_deg=(90.0, 270.0))
    poses = draw(PoseSampler(built, SIDEWAYS, None), mounts, count=15, pull=0.008)
    assert set(poses.mounts[:, 1].tolist()) <= {90.0, 270.0}
    assert poses.pulls.max() <= 0.008
    loose = poses.pulls <= -0.02
    assert ((~loose[:, :3]).sum(axis=1) <= 2).all()
    assert ((~loose[:, 3:]).sum(axis=1) <= 2).all()
    np.testing.assert_allclose(poses.tips, at_rest(built, poses, mounts).position, atol=1e-5)


def test_arms_that_cannot_be_drawn_are_refused_in_a_line():
    late = [*SIX[:3], *(Tendon(t.angle, end=5, start=2) for t in SIX[3:])]
    spec = arm(tendons=late).build(ACTUATION, SOLVER, Path()).spec
    with pytest.raises(InputError, match="model: found cables .* such as tendon_4, expected none"):
        PoseSampler(spec.compile(), SIDEWAYS, None)


def test_a_mount_where_nothing_can_be_recorded_is_named(source, monkeypatch):
    monkeypatch.setattr("trunkline.tools.record_poses.draw.NEAR_LIMIT", 0.0)
    with pytest.raises(InputError, match="the mount at 0° towards 0°: found 0 poses .* expected 15: a smaller --pull"):
        draw(source, Mounts(1), count=15)


def test_gravity_pulls_towards_the_side_to_which_the_mount_tilts():
    place = np.array([[30.0, 90.0]])
    half, most = 0.5 * STANDARD_GRAVITY, np.sqrt(0.75) * STANDARD_GRAVITY
    np.testing.assert_allclose(Mounts(1, 30.0).gravity(place), [[0, half, -most]], atol=1e-12)
    np.testing.assert_allclose(Mounts(1, 30.0, standing=True).gravity(place), [[0, half, most]], atol=1e-12)
    assert not Mounts(1, weightless=True).gravity(place).any()


def test_the_order_moves_the_mount_seldom_and_all_by_short_ways(source):
    mounts = Mounts(5, tilt_deg=40.0)
    drawn = draw(source, mounts, count=40)
    mixed = drawn[np.random.default_rng(0).permutation(40)]
    rows = ordered(mixed, mounts)
    assert sorted(rows.tolist()) == list(range(40))
    poses = mixed[rows]
    places = [place for place, _ in groupby(map(tuple, poses.mounts.tolist()))]
    assert len(places) == len(set(places)) == 5
    assert places[0][0] == min(tilt for tilt, _ in places)
    assert _way(poses) < 0.7 * _way(drawn) < _way(mixed)


def test_a_short_way_goes_to_the_nearest_that_is_left():
    assert short_way(np.array([[5.0], [1.0], [-2.0], [2.5]]), np.zeros(1)) == [1, 3, 0, 2]


def _way(poses: PosesToRecord) -> float:
    """That motors go from pose to pose, m."""
    return float(np.linalg.norm(np.diff(np.maximum(poses.pulls, 0), axis=0), axis=1).sum())


def test_it_waits_for_the_slowest_branch_as_a_preview_does():
    joints = Joints(branches=[MaxwellElement(share=0.3, time=6.0), MaxwellElement(share=0.2, time=0.5)])
    spec = small_spec(4)
    add_elements(spec, joints, 1e-5)
    schedule = Schedule.of(ArmModel(spec.compile()))
    preview = SimpleNamespace(arm=spec)
    assert schedule.wait == schedule.hang == np.ceil(RobotModel.rest_time.func(preview)) == 28
    assert schedule.window == (33, 36), "of a log that begins 2 s before the motors move, for 3 s"
    at_once = Schedule.of(ArmModel(small_spec(4).compile()))
    assert at_once.wait == LEAST_WAIT
    assert at_once.hang < 5
