"""What stands in a plan's way is named, with when: of the rigid robot, and of the arm wherever its statics have it."""

from dataclasses import replace

import numpy as np
import pytest

from tests.support.bent_chain import hardening_stump
from tests.support.operator import READY_JOINTS, config
from trunkline.ar.preview.package import Package
from trunkline.ar.teleop import plan_checks
from trunkline.ar.teleop.alignment import base_quaternion
from trunkline.ar.teleop.config import TeleoperationConfig
from trunkline.ar.teleop.following import sought
from trunkline.ar.teleop.messages import Obstacle, Request, Target, Targets, World
from trunkline.ar.teleop.plan import Plan
from trunkline.ar.teleop.plan_checks import LINK_RADIUS, check_plan
from trunkline.ar.teleop.planner import Planner
from trunkline.ar.teleop.rigid_ik import RigidIK
from trunkline.ar.teleop.shaping import Shaper
from trunkline.ar.teleop.tendons import Network
from trunkline.ar.teleop.trajectory import limits_of
from trunkline.ar.teleop.vectors import DOWN, add, rotate
from trunkline.errors import InputError
from trunkline.frames import gravity_in_base
from trunkline.kinematics.panda.collision import clearance
from trunkline.kinematics.panda.kinematics import Q_MAX, Q_MIN, joint_frames, mount_pose
from trunkline.model.statics.chain import read_chain
from trunkline.model.statics.equilibria import actuated
from trunkline.model.statics.placement import joint_positions
from trunkline.pipeline.config import PROJECT, compose_settings, validated

OFFSET, STEP, ROWS, CURL = 0.05, 0.01, 200, 100
CHAIN = read_chain(hardening_stump())
STRAIGHT = CHAIN.straight_lengths + 0.01
PULL = np.array([0.06, -0.02, -0.02])
READY = np.array(READY_JOINTS)


def curling(*names: str) -> Plan:
    """A plan at the ready pose, whose arm curls from row CURL on."""
    share = np.clip((np.arange(ROWS) - CURL) / (ROWS - CURL), 0, 1)
    phases = tuple((name, row) for name, row in zip(names, (0, CURL, ROWS - 1), strict=False))
    return Plan(STEP, np.tile(READY, (ROWS, 1)), STRAIGHT - share[:, None] * PULL, phases, "", "")


def places(commands: np.ndarray) -> np.ndarray:
    """Joints and tip at the ready pose, base frame, m, (P, 3): the mount there points straight down."""
    rest = actuated(CHAIN, commands[None], gravity_in_base(0.0))
    (mount,), (flange,) = mount_pose(READY[None], OFFSET)
    return mount + joint_positions(CHAIN, rest.qpos)[0] @ (flange * [1, -1, -1]).T


def about(place: np.ndarray, half: float = 0.005) -> World:
    return World("world", (Obstacle("the table", tuple(map(float, place - half)), tuple(map(float, place + half))),))


def test_the_hanging_arm_in_a_solid_is_refused_at_once():
    with pytest.raises(InputError, match=r"world: the arm would come into the table after 0\.00 s"):
        check_plan(curling("approach", "curl"), about(places(STRAIGHT)[-1]), OFFSET, CHAIN)


def test_a_solid_where_the_arm_curls_to_is_named_with_when():
    there = about(places(STRAIGHT - PULL)[-1])
    check_plan(curling("approach", "curl"), there, OFFSET)  # of an arm that nobody knows, nothing is said
    with pytest.raises(InputError, match=r"world: the arm would come into the table after 1\.[89]\d? s"):
        check_plan(curling("approach", "curl"), there, OFFSET, CHAIN)


def test_from_where_it_closes_about_an_object_the_preview_shows_the_way():
    there = about(places(STRAIGHT - PULL)[-1])
    check_plan(curling("approach", "curl", "lift"), there, OFFSET, CHAIN)
    check_plan(curling("transfer", "release"), about(places(STRAIGHT)[-1]), OFFSET, CHAIN)
    with pytest.raises(InputError, match="the arm would come into"):
        check_plan(curling("approach", "curl", "lift"), about(places(STRAIGHT)[-1]), OFFSET, CHAIN)


def test_what_is_beside_the_arms_way_is_not_in_it():
    check_plan(curling("approach", "curl"), about(places(STRAIGHT)[-1] + [0, 0, -0.05]), OFFSET, CHAIN)


# --- each criterion by itself, from both sides of its border


NEAR = 1e-6


def one_row(joints: np.ndarray) -> Plan:
    return Plan(STEP, np.array(joints)[None], STRAIGHT[None], (), "", "")


@pytest.mark.parametrize("joint", range(7))
@pytest.mark.parametrize("side", ["low", "high"])
def test_no_joint_leaves_its_range_on_either_side(joint, side):
    border, outwards = ((Q_MIN, -1) if side == "low" else (Q_MAX, 1))[0][joint], -1 if side == "low" else 1
    plan = curling("approach", "curl")
    plan.joints[50, joint] = border + outwards * NEAR
    with pytest.raises(InputError, match=f"limit: joint {joint + 1} of the rigid robot would leave its range"):
        check_plan(plan, World("world"), OFFSET)
    plan.joints[50, joint] = border
    assert not _reason(plan, World("world")).startswith("limit")  # there, the robot may touch itself


def _reason(plan: Plan, world: World, chain=None) -> str:
    """Why the way is not free, "" where it is."""
    try:
        check_plan(plan, world, OFFSET, chain)
    except InputError as error:
        return str(error)
    return ""


def test_what_is_told_first():
    """A joint beyond its range, before the robot touching itself, before a solid in its way."""
    plan = curling("approach", "curl")
    (mount,), _ = mount_pose(READY[None], OFFSET)
    assert _reason(plan, about(mount)).startswith("world: ")
    plan.joints[:, 3] = Q_MIN[3] + NEAR
    plan.joints[:, 5] = 0.0
    assert clearance(plan.joints[:1], OFFSET)[0] < 0
    assert _reason(plan, about(mount)).startswith("self-collision: the robot would touch itself after 0.00 s")
    plan.joints[-1, 0] = Q_MAX[0] + NEAR
    assert _reason(plan, about(mount)).startswith("limit: joint 1 ")


AXES = [(0, -1), (0, 1), (1, -1), (1, 1), (2, -1)]  # above the mount is joint 7


@pytest.mark.parametrize(("axis", "side"), AXES)
def test_a_solid_beside_the_mount_is_in_its_way_within_a_links_radius(axis, side):
    """On each of its sides: the box ends a radius away, or a little less."""
    (mount,), _ = mount_pose(READY[None], OFFSET)
    for off, free in ((LINK_RADIUS + 1e-4, True), (LINK_RADIUS - 1e-4, False)):
        low, high = mount - 0.005, mount + 0.005
        (low if side > 0 else high)[axis] = mount[axis] + side * off
        (high if side > 0 else low)[axis] = mount[axis] + side * (off + 0.01)
        world = World("world", (Obstacle("the post", tuple(map(float, low)), tuple(map(float, high))),))
        assert (_reason(one_row(READY), world) == "") == free


@pytest.mark.parametrize("frame", range(2, 7))
def test_every_moving_link_is_looked_at(frame):
    place = joint_frames(READY[None])[frame].p[:, 0]
    world = World("world", (Obstacle("the post", tuple(map(float, place)), tuple(map(float, place))),))
    assert _reason(one_row(READY), world).startswith("world: joint ")


@pytest.mark.parametrize("first", [True, False])
def test_every_solid_of_the_world_is_looked_at(first):
    (mount,), _ = mount_pose(READY[None], OFFSET)
    free = Obstacle("the shelf", (5.0, 5.0, 5.0), (6.0, 6.0, 6.0))
    (bad,) = about(mount).obstacles
    assert "the table" in _reason(one_row(READY), World("world", (bad, free) if first else (free, bad)))


def test_an_arm_that_finds_no_rest_is_not_seen_and_the_robot_still_is(monkeypatch):
    rest = actuated(CHAIN, STRAIGHT[None], gravity_in_base(0.0))
    lost = replace(rest, converged=np.array([False]))
    monkeypatch.setattr(plan_checks, "actuated", lambda chain, commands, pull: lost)
    monkeypatch.setattr(plan_checks, "joint_positions", lambda chain, qpos: np.zeros((1, 3, 3)))
    (mount,), _ = mount_pose(READY[None], OFFSET)
    assert _reason(one_row(READY), about(places(STRAIGHT)[-1]), CHAIN) == ""
    assert _reason(one_row(READY), about(mount), CHAIN).startswith("world: ")


def test_the_arms_last_pose_before_it_closes_is_looked_at_too():
    """However rarely its poses are: the row before the curl that closes about an object, and a plan's last one."""
    rows, plan = np.arange(ROWS)[:, None], curling("approach", "curl", "lift")
    bent = replace(plan, commands=np.where(rows == CURL - 1, STRAIGHT - PULL, STRAIGHT))
    assert _reason(bent, about(places(STRAIGHT - PULL)[-1]), CHAIN).startswith("world: the arm would come into")
    late = replace(curling("approach"), commands=np.where(rows == ROWS - 1, STRAIGHT - PULL, STRAIGHT))
    assert _reason(late, about(places(STRAIGHT - PULL)[-1]), CHAIN).startswith("world: the arm would come into")


# --- whoever makes plans or follows holds them against it


def bending(pull: np.ndarray) -> Network:
    """A network that knows one bend of that arm, whatever it is asked for, and where its tip then rests."""
    rest = actuated(CHAIN, (STRAIGHT - pull)[None], gravity_in_base(0.0))

    def ask(poses):
        rows = len(poses)
        outputs = {"commands": STRAIGHT - pull, "lengths": rest.lengths[0], "tip": rest.position[0]}
        return {name: np.tile(values, (rows, 1)) for name, values in outputs.items()}

    return Network(ask, 8)


def aim(pull: np.ndarray) -> tuple[Planner, Targets]:
    """A planner of that arm, and targets that its bend reaches with the mount near where it is."""
    network = bending(pull)
    made = Planner(RigidIK(OFFSET), network, STRAIGHT, limits_of(config().motors), OFFSET, step=STEP, chain=CHAIN)
    (mount,), (flange,) = mount_pose(READY[None], OFFSET)
    turn = base_quaternion(DOWN, 0.0)
    tip = add(tuple(map(float, mount)), rotate(turn, tuple(map(float, network.ask(np.zeros((1, 8)))["tip"][0]))))
    asked = Targets(Target(tuple(map(float, mount))), Target(tip), DOWN, 0.0, 0, 0.0)
    return made, asked


@pytest.fixture(scope="module")
def aimed():
    return aim(PULL)


def test_a_planner_that_knows_the_arm_refuses_a_plan_that_leads_it_into_a_solid(aimed):
    planner, asked = aimed
    request = Request(1, asked, "world", "package")
    free = planner.plan(request, World("world"), READY, STRAIGHT)
    (mount,), (flange,) = mount_pose(free.joints[-1:], OFFSET)
    rest = actuated(CHAIN, free.commands[-1:], gravity_in_base(0.0))
    there = mount + joint_positions(CHAIN, rest.qpos)[0][-1] @ (flange * [1, -1, -1]).T
    with pytest.raises(InputError, match="world: the arm would come into the table after"):
        planner.plan(request, about(there), READY, STRAIGHT)
    with pytest.raises(InputError, match=r"world: the arm would come into the table after 0\.00 s"):
        planner.plan(request, about(places(STRAIGHT)[-1]), READY, STRAIGHT)


def test_what_is_followed_is_held_against_it_too(aimed):
    planner, asked = aimed
    axes, refused = sought(planner, asked, READY, World("world"))
    assert refused == ""
    (mount,), (flange,) = mount_pose(axes[None, :7], OFFSET)
    rest = actuated(CHAIN, axes[None, 7:], gravity_in_base(0.0))
    there = mount + joint_positions(CHAIN, rest.qpos)[0][-1] @ (flange * [1, -1, -1]).T
    assert sought(planner, asked, READY, about(there)) == (None, "world: the arm would come into the table")
    assert sought(planner, None, READY, about(there)) == (None, "")


# --- a reach ends along the tip's axis, from as far back as the way is free


class Short(RigidIK):
    """Of a robot that comes no further back than `short` m from `there`, joints as they are in any case."""

    def __init__(self, there: np.ndarray, short: float):
        super().__init__(OFFSET)
        self.there, self.short = there, short

    def solve(self, joints, mount, pointing, heading):
        if np.linalg.norm(np.array(mount) - self.there) > self.short:
            raise InputError("out of reach: the rigid robot comes no nearer")
        return super().solve(joints, mount, pointing, heading)


def advancing(planner: Planner, asked: Targets) -> Plan:
    return replace(planner, advance=0.06).plan(Request(1, asked, "world", "package"), World("world"), READY, STRAIGHT)


@pytest.mark.parametrize("pull", [PULL, PULL / 2, PULL[[1, 0, 2]] / 3])
def test_a_reach_ends_along_the_axis_of_the_tip(pull):
    aimed = aim(pull)
    plan = advancing(*aimed)
    assert [name for name, _ in plan.phases] == ["approach", "curl", "advance"]
    begin = dict(plan.phases)["advance"]
    np.testing.assert_allclose(plan.commands[begin:], np.tile(plan.commands[-1], (len(plan.commands) - begin, 1)))
    mounts, flanges = mount_pose(plan.joints[[begin, -1]], OFFSET)
    rest = actuated(CHAIN, plan.commands[-1:], gravity_in_base(0.0))
    *_, last, tip = joint_positions(CHAIN, rest.qpos)[0] @ (flanges[-1] * [1, -1, -1]).T
    np.testing.assert_allclose(mounts[1] - mounts[0], 0.06 * (tip - last) / np.linalg.norm(tip - last), atol=1e-3)
    plain = aimed[0].plan(Request(1, aimed[1], "world", "package"), World("world"), READY, STRAIGHT)
    np.testing.assert_allclose(mounts[1], mount_pose(plain.joints[-1:], OFFSET)[0][0], atol=1e-3)
    np.testing.assert_allclose(plan.commands[-1], plain.commands[-1])
    assert [name for name, _ in plain.phases] == ["approach", "curl"]


def test_of_an_arm_without_statics_the_tips_axis_is_not_known(aimed):
    planner, asked = aimed
    assert [name for name, _ in advancing(replace(planner, chain=None), asked).phases] == ["approach", "curl"]


@pytest.mark.parametrize(("short", "back"), [(0.05, 0.03), (0.02, 0.0)])
def test_where_the_robot_comes_less_far_back_so_does_the_reach(aimed, short, back):
    planner, asked = aimed
    there = mount_pose(advancing(planner, asked).joints[-1:], OFFSET)[0][0]
    plan = advancing(replace(planner, rigid=Short(there, short)), asked)
    assert ("advance" in dict(plan.phases)) == (back > 0)
    begin = dict(plan.phases).get("advance", len(plan.joints) - 1)
    mounts, _ = mount_pose(plan.joints[[begin, -1]], OFFSET)
    assert np.linalg.norm(mounts[1] - mounts[0]) == pytest.approx(back, abs=1e-3)


def stand_off_tip(planner: Planner, asked: Targets) -> np.ndarray:
    """Where the curled arm's tip is as the advance begins, base frame, m."""
    plan = advancing(planner, asked)
    begin = dict(plan.phases)["advance"]
    (mount,), (flange,) = mount_pose(plan.joints[begin : begin + 1], OFFSET)
    rest = actuated(CHAIN, plan.commands[-1:], gravity_in_base(0.0))
    return mount + joint_positions(CHAIN, rest.qpos)[0][-1] @ (flange * [1, -1, -1]).T


class Counted(RigidIK):
    """`solved`: how often it was."""

    solved = 0

    def solve(self, joints, mount, pointing, heading):
        self.solved += 1
        return super().solve(joints, mount, pointing, heading)


@pytest.mark.parametrize(("refused", "solved", "phases"), [
    (0, 2, ["approach", "curl", "advance"]), (1, 4, ["approach", "curl", "advance"]), (2, 5, ["approach", "curl"]),
    (3, 5, None),
])  # fmt: skip
def test_a_way_that_a_solid_forbids_gives_place_to_the_next_which_is_solved_then(
    aimed, monkeypatch, refused, solved, phases
):
    """The whole advance to half of it, and that to none, whose reason is the plan's. Each end of an advance is solved
    for, and each leg shaped for, once its way is tried."""
    planner, asked = aimed
    rigid, shaped_for, tried = Counted(OFFSET), [], []

    def shaper(*leg):
        shaped_for.append(leg)
        return Shaper(np.zeros(1), np.ones(1))

    counting = replace(planner, rigid=rigid, shaper=shaper)

    def checked(plan, *_):
        tried.append(len(plan.joints) - dict(plan.phases).get("advance", len(plan.joints)))
        if len(tried) <= refused:
            raise InputError(f"world: way {len(tried)}")

    monkeypatch.setattr("trunkline.ar.teleop.planner.check_plan", checked)
    if phases is None:
        with pytest.raises(InputError, match="world: way 3"):
            advancing(counting, asked)
        assert tried[0] > tried[1] > tried[2] == 0
    else:
        assert [name for name, _ in advancing(counting, asked).phases] == phases
    assert (rigid.solved, len(shaped_for)) == (solved, min(3 * (refused + 1), 8))


def test_a_solid_beside_the_stand_off_is_gone_round(aimed):
    """Its tip would be in it; the way without an advance is free."""
    planner, asked = aimed
    solid = about(stand_off_tip(planner, asked), 0.002)
    plan = replace(planner, advance=0.06).plan(Request(1, asked, "world", "package"), solid, READY, STRAIGHT)
    check_plan(plan, solid, OFFSET, CHAIN)


@pytest.mark.parametrize("shaper", [None, lambda *leg: Shaper(np.array([0.0, 0.3]), np.array([0.6, 0.4]))])
@pytest.mark.parametrize(("speed", "pull"), [(0.1, PULL), (0.03, PULL), (0.03, PULL[[1, 0, 2]] / 3)])
def test_the_mount_advances_no_faster_than_it_may(speed, pull, shaper):
    """As fast without shaping, and slower with it."""
    planner, asked = aim(pull)
    plan = advancing(replace(planner, advance_speed=speed, shaper=shaper), asked)
    mounts, _ = mount_pose(plan.joints[dict(plan.phases)["advance"] :], OFFSET)
    fastest = np.linalg.norm(np.diff(mounts, axis=0), axis=1).max() / plan.step
    assert (0.95 if shaper is None else 0.5) * speed < fastest <= speed * (1 + 1e-6)


def test_the_speed_of_the_advance_is_that_of_the_settings():
    """And no more than 0.25 m/s."""
    folder, arm = PROJECT / "conf/teleop", hardening_stump()
    values = compose_settings(folder, {}, str(folder))
    made = validated(TeleoperationConfig, values | {"advance_speed": 0.25}, folder)
    package = Package("", None, bending(PULL), arm, CHAIN, None, STRAIGHT, 0.0, None, {})
    assert (config().advance_speed, package.planner(made).advance_speed) == (0.1, 0.25)
    with pytest.raises(InputError, match=r"advance_speed.*found 0\.251, expected"):
        validated(TeleoperationConfig, values | {"advance_speed": 0.251}, folder)


def test_the_mount_advances_nearly_straight_and_hardly_turns(aimed):
    """All joints move evenly: in between the mount is some mm beside the straight line."""
    plan = advancing(*aimed)
    mounts, flanges = mount_pose(plan.joints[dict(plan.phases)["advance"] :], OFFSET)
    way = (mounts[-1] - mounts[0]) / np.linalg.norm(mounts[-1] - mounts[0])
    beside = (mounts - mounts[0]) - ((mounts - mounts[0]) @ way)[:, None] * way
    assert np.linalg.norm(beside, axis=1).max() < 10e-3
    assert np.abs(flanges - flanges[0]).max() < 0.02
