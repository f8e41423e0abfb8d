"""Objects: the tip target marks them, the plan grasps them or brings them elsewhere, and what forbids it has a name."""

import json
from dataclasses import replace

import numpy as np
import pytest

from tests.ar.teleop.test_plan import LENGTH, LIMITS, MOUNT, NETWORK, OFFSET, START, STRAIGHT
from tests.support.operator import DT, PACKAGE, Operator, config
from trunkline.ar.hybrid.grasp_poses import SideGrip
from trunkline.ar.teleop.grasping import Grasping, _require_ground
from trunkline.ar.teleop.messages import (
    Input,
    Intent,
    Obstacle,
    Offer,
    PlanReport,
    Request,
    Target,
    Targets,
    World,
    WorldObject,
    from_json,
    to_json,
)
from trunkline.ar.teleop.object_shapes import below_grip, grip_of
from trunkline.ar.teleop.planner import Planner
from trunkline.ar.teleop.rigid_ik import RigidIK
from trunkline.ar.teleop.tendons import Network, bend
from trunkline.ar.teleop.trajectory import gentle
from trunkline.ar.teleop.vectors import DOWN, subtract
from trunkline.errors import InputError
from trunkline.kinematics.panda.kinematics import mount_pose
from trunkline.model.arm.spiral import spiral_chain

GEOMETRY = spiral_chain(length=LENGTH, base_width=0.080, tip_width=0.012, units=24)
GRIP, BY_THE_BAR = SideGrip(config().hanging, GEOMETRY), SideGrip(config().basket, GEOMETRY)
HANDLING = config().handling
BALL = WorldObject("the ball", "cylinder", 0.05, 0.05, 0.1, (0.55, 0.1, 0.15))


@pytest.fixture(scope="module")
def planner():
    rigid = RigidIK(OFFSET)
    grasping = Grasping(rigid, OFFSET, STRAIGHT, {"hanging": GRIP, "basket": BY_THE_BAR}, HANDLING)
    return Planner(rigid, NETWORK, STRAIGHT, LIMITS, OFFSET, step=0.01, grasping=grasping)


def world(object: WorldObject, *boxes: Obstacle) -> World:
    return World("world", boxes, (object,))


def request(object: WorldObject, rigid, tip=None, heading=0.0) -> Request:
    targets = Targets(Target(rigid), Target(tip or object.position), DOWN, heading, 0, 0.0, object=object.name)
    return Request(1, targets, "world", PACKAGE)


def test_a_grasp_comes_from_the_side_closes_and_lifts(planner):
    plan = planner.plan(request(BALL, MOUNT), world(BALL), START, STRAIGHT)
    assert [name for name, _ in plan.phases] == ["approach", "curl", "lift"]
    starts = dict(plan.phases)
    mounts = mount_pose(plan.joints, OFFSET)[0]
    at = mounts[starts["curl"]]
    np.testing.assert_allclose(at, MOUNT, atol=1e-3)
    np.testing.assert_allclose(mounts[starts["lift"]] - at, [0, 0, -config().hanging.sink], atol=1e-3)
    np.testing.assert_allclose(mounts[-1] - at, [0, 0, HANDLING.lift], atol=1e-3)
    last = mounts[: starts["curl"]][-100:]  # heading 0: the object is at +x
    assert (last[:, 0] < MOUNT[0] + 1e-3).all()
    near = np.linalg.norm(mounts[: starts["curl"]] - np.array(MOUNT) + [config().hanging.aside, 0, 0], axis=1)
    assert near.min() < 1e-3
    opened, closed = STRAIGHT - plan.commands[starts["curl"]], STRAIGHT - plan.commands[-1]
    np.testing.assert_allclose(opened, [0, -config().hanging.loose, -config().hanging.loose], atol=1e-9)
    np.testing.assert_allclose(closed, [config().hanging.pull, *opened[1:]], atol=1e-9)


class Low(RigidIK):
    """A rigid robot that reaches up to `ceiling` m."""

    ceiling = 0.0

    def solve(self, start, mount, *turned):
        if mount[2] > self.ceiling + 1e-9:
            raise InputError(f"out of reach: {mount[2]:.3f} m")
        return super().solve(start, mount, *turned)


@pytest.mark.parametrize(("room", "lift"), [(0.2, 0.1), (0.1, 0.1), (0.099, 0.09), (0.07, 0.07), (0.06, 0.06)])
def test_a_grasp_lifts_as_high_as_the_rigid_robot_reaches(planner, room, lift):
    rigid = Low(OFFSET)
    rigid.ceiling = MOUNT[2] + room
    low = replace(planner, grasping=replace(planner.grasping, rigid=rigid))
    plan = low.plan(request(BALL, MOUNT), world(BALL), START, STRAIGHT)
    mounts = mount_pose(plan.joints, OFFSET)[0]
    np.testing.assert_allclose(mounts[-1] - MOUNT, [0, 0, lift], atol=1e-3)
    whole = planner.plan(request(BALL, MOUNT), world(BALL), START, STRAIGHT)
    assert plan.duration <= whole.duration, "no slower for less"


def test_what_it_could_lift_no_higher_than_the_least_is_refused(planner):
    rigid = Low(OFFSET)
    rigid.ceiling = MOUNT[2] + HANDLING.least_lift - 0.001
    low = replace(planner, grasping=replace(planner.grasping, rigid=rigid))
    with pytest.raises(InputError, match=f"out of reach: {MOUNT[2] + HANDLING.least_lift:.3f} m"):
        low.plan(request(BALL, MOUNT), world(BALL), START, STRAIGHT)


def test_a_least_lift_above_the_highest_is_refused():
    with pytest.raises(ValueError, match="least_lift: found 0.2 m, expected at most lift, 0.1 m"):
        replace(HANDLING, least_lift=0.2)


def test_a_tip_that_is_seen_beside_the_bending_plane_is_made_up_for(planner):
    plan = planner.plan(request(BALL, MOUNT), world(BALL), START, STRAIGHT, beside=0.01)
    at = mount_pose(plan.joints[[dict(plan.phases)["curl"]]], OFFSET)[0][0]
    np.testing.assert_allclose(at, np.array(MOUNT) - [0.0, 0.01, 0.0], atol=1e-3)


def test_what_is_carried_is_moved_gently():
    start, end = np.zeros(10), np.append(np.full(7, 0.4), np.zeros(3))
    step = 1e-3
    way = gentle(start, end, LIMITS, step, 3.0)
    np.testing.assert_allclose(way[[0, -1]], [start, end], atol=1e-12)
    assert len(way) == pytest.approx(3.0 / step, abs=2)
    speed = np.diff(way[:, 0]) / step
    assert speed.max() == pytest.approx(15 / 8 * 0.4 / 3.0, rel=1e-3)
    assert np.abs(np.diff(speed) / step).max() == pytest.approx(10 / np.sqrt(3) * 0.4 / 9.0, rel=1e-2)
    hasty = gentle(start, end, LIMITS, step)  # no longer than the limits ask for
    assert (np.abs(np.diff(hasty, axis=0)).max(axis=0) / step <= LIMITS.velocity * (1 + 1e-6)).all()
    assert (np.abs(np.diff(hasty, 2, axis=0)).max(axis=0) / step**2 <= LIMITS.acceleration * (1 + 1e-6)).all()
    assert len(hasty) < len(way)


def test_an_arm_before_the_object_pulls_the_other_cables(planner):
    behind = replace(BALL, position=(0.45, 0.1, 0.15))
    plan = planner.plan(request(behind, MOUNT), world(behind), START, STRAIGHT)
    pull, loose = config().hanging.pull, -config().hanging.loose
    np.testing.assert_allclose(STRAIGHT - plan.commands[-1], [loose, pull, pull], atol=1e-9)


BASKET = WorldObject("the basket", "basket", 0.03, 0.06, 0.2, (0.55, 0.1, -0.03), support="standing")


def test_a_basket_is_gripped_by_its_bar_wherever_it_is(planner):
    grip = grip_of(BASKET)
    assert grip[:2] == BASKET.position[:2]
    mount = (0.49, 0.1, grip[2] + 0.36)
    for object in (BASKET, replace(BASKET, support="hanging")):
        plan = planner.plan(request(object, mount, grip), world(object), START, STRAIGHT)
        at = mount_pose(plan.joints[[dict(plan.phases)["curl"]]], OFFSET)[0][0]
        np.testing.assert_allclose(at, mount, atol=1e-3)
        pull, loose = config().basket.pull, -config().basket.loose
        np.testing.assert_allclose(STRAIGHT - plan.commands[-1], [pull, loose, loose], atol=1e-9)


def test_a_basket_that_is_let_go_must_be_near_the_board_with_its_box(planner):
    basket = replace(BASKET, support="held", position=(0.35, 0.05, 0.1))
    below = below_grip(basket)
    rooms = world(basket, TABLE)
    near, far = ((0.5, -0.2, 0.1 + below + gap) for gap in (0.03, 0.09))
    assert planner.plan(request(basket, MOUNT, near), rooms, START, STRAIGHT).phases[-1][0] == "release"
    with pytest.raises(InputError, match="release: found 90 mm between the basket and"):
        planner.plan(request(basket, MOUNT, far), rooms, START, STRAIGHT)


TABLE = Obstacle("the table", (0.3, -0.4, -0.4), (0.7, 0.0, 0.1))


def test_what_is_held_is_brought_down_and_let_go(planner):
    ball, commands = replace(BALL, support="held"), STRAIGHT - [0.18, -0.2, -0.2]
    goal, place = (0.45, -0.2, 0.4), (0.5, -0.2, 0.1 + BALL.diameter / 2 + 0.03)
    plan = planner.plan(request(ball, goal, place), world(ball, TABLE), START, commands)
    assert [name for name, _ in plan.phases] == ["transfer", "release"]
    release = dict(plan.phases)["release"]
    mounts = mount_pose(plan.joints, OFFSET)[0]
    np.testing.assert_allclose(mounts[release], goal, atol=1e-3)
    np.testing.assert_allclose(plan.commands[:release], np.tile(commands, (release, 1)), atol=1e-9)
    speed = np.linalg.norm(np.diff(mounts[:release], axis=0), axis=1).max() / plan.step
    assert speed < 3 * HANDLING.carry
    assert (STRAIGHT - plan.commands[-1]).max() <= 1e-9
    np.testing.assert_allclose(mounts[-1] - goal, [0, 0, config().hanging.rise], atol=1e-3)


REFUSED = {
    "payload: the ball weighs 5 kg, expected at most": (replace(BALL, mass=5.0), MOUNT, None),
    "payload: the ball weighs 0.1 kg, expected at most 0 kg": (replace(BALL, diameter=0.3), MOUNT, None),
    "grasp: the ball is standing, expected hanging": (replace(BALL, support="standing"), MOUNT, None),
    "release: found nothing between the ball and": (replace(BALL, support="held"), MOUNT, (0.5, 0.5, 0.2)),
    "release: found 1.. mm between the ball and": (replace(BALL, support="held"), MOUNT, (0.5, -0.2, 0.3)),
}


@pytest.mark.parametrize("reason", REFUSED)
def test_what_forbids_it_has_a_name(planner, reason):
    object, mount, tip = REFUSED[reason]
    with pytest.raises(InputError, match=reason):
        planner.plan(request(object, mount, tip), world(object, TABLE), START, STRAIGHT)


def test_a_planner_without_a_grip_says_so(planner):
    with pytest.raises(InputError, match="grasp: found no way"):
        replace(planner, grasping=None).plan(request(BALL, MOUNT), world(BALL), START, STRAIGHT)


def aiming(object: WorldObject | None = None) -> Operator:
    """Both targets set; the tip target is 4 cm beside the object, if there is one."""
    operator = Operator()
    operator.wait(0.5)
    intent = operator.wait(0.3, left={"grip": True}, right={"grip": True})
    if object is not None:
        x, y, z = intent.targets.tip.position
        operator.wait(0.2, world=World("objects", (), (replace(object, position=(x + 0.04, y, z)),)))
    return operator


def test_a_tip_target_near_an_object_marks_it():
    operator = aiming(BALL)
    targets = operator.intents[-1].targets
    assert targets.object == BALL.name
    assert targets.tip.position == operator.message.world.objects[0].position
    far = replace(operator.message.world.objects[0], position=(9.0, 9.0, 9.0))
    targets = operator.step(world=World("elsewhere", (), (far,))).targets
    assert targets.object == ""
    assert aiming().intents[-1].targets.object == ""


def test_a_tip_target_near_a_bar_marks_the_basket_and_goes_to_the_bar():
    operator = aiming()
    x, y, z = operator.intents[-1].targets.tip.position
    dx, dy, dz = subtract(grip_of(BASKET), BASKET.position)
    near, beside = ((x + gap - dx, y - dy, z - dz) for gap in (0.04, 0.4))
    targets = operator.step(world=World("bar", (), (replace(BASKET, position=near),))).targets
    assert targets.object == BASKET.name
    np.testing.assert_allclose(targets.tip.position, (x + 0.04, y, z), atol=1e-9)
    assert operator.step(world=World("far", (), (replace(BASKET, position=beside),))).targets.object == ""


def ready(operator: Operator) -> None:
    intent = operator.step(right={"trigger": True})
    assert intent.request is not None
    operator.step(right={"trigger": False})
    operator.step(plan=PlanReport(intent.request.serial, "d" * 64, "", PACKAGE, operator.message.world.digest))
    assert operator.step(shown="d" * 64).mode == "ready"


def test_an_offer_is_shown_and_taken_only_if_the_user_does():
    operator = aiming(BALL)
    ready(operator)
    chosen = operator.intents[-1].targets.rigid.position
    offer = Offer(BALL.name, (0.5, 0.1, 0.5), (0.0, 0.0, -1.0), 0.9)
    intent = operator.step(offer=offer)
    assert intent.targets.better == offer
    assert intent.targets.rigid.position == chosen  # the user's own stays the default
    operator.wait(0.2, left={"grip": False})
    assert operator.intents[-1].mode == "ready"
    intent = operator.step(left={"primary": True})
    assert intent.mode == "aim"
    assert intent.notice == "the offer was taken; the plan is void"
    operator.step(left={"primary": False})
    assert operator.wait(0.2).targets.rigid.position == offer.rigid
    intent = operator.step(right={"trigger": True})
    assert intent.request.targets.rigid.position == offer.rigid
    assert intent.request.targets.better is None


def test_with_an_object_in_the_arm_the_tip_target_is_where_it_will_be():
    operator = Operator()
    operator.wait(0.5)
    ball = replace(BALL, support="held", position=(0.35, 0.05, 0.1))
    operator.wait(0.3, left={"grip": True}, world=World("held", (), (ball,)))
    targets = operator.intents[-1].targets
    assert targets.object == BALL.name
    assert targets.turned == 0.0
    mount = mount_pose(np.array([operator.message.joints]), OFFSET)[0][0]
    along = np.linalg.norm(np.array(ball.position) - mount)
    assert np.linalg.norm(np.array(targets.tip.position) - targets.rigid.position) == pytest.approx(along, abs=1e-6)
    assert targets.tip.position[2] - targets.rigid.position[2] == pytest.approx(ball.position[2] - mount[2], abs=1e-6)


def test_messages_with_objects_are_read_back_and_replayed():
    operator = aiming(BALL)
    ready(operator)
    operator.step(offer=Offer(BALL.name, (0.5, 0.1, 0.5), (0.0, 0.0, -1.0), 0.9))
    state = operator.core.start()
    for message, intent in zip(operator.inputs, operator.intents, strict=True):
        assert from_json(Input, to_json(message)) == message
        assert from_json(Intent, to_json(intent)) == intent
        state, again = operator.core.step(state, from_json(Input, to_json(message)), DT)
        assert to_json(again) == to_json(intent)


def test_clients_in_other_languages_read_the_keys_that_they_know():
    operator = aiming(BALL)
    ready(operator)
    intent = operator.step(offer=Offer(BALL.name, (0.5, 0.1, 0.5), (0.0, 0.0, -1.0), 0.9))
    sent, answer = (json.loads(to_json(message)) for message in (operator.inputs[-1], intent))
    assert set(sent["world"]) == {"digest", "boxes", "things"}
    assert (sent["offer"]["thing"], answer["targets"]["thing"]) == (BALL.name, BALL.name)
    assert answer["targets"]["tip"]["solid"] == ""


# --- borders


NEAR = 1e-6


def refused(call) -> str:
    try:
        call()
    except InputError as error:
        return str(error)
    return ""


@pytest.mark.parametrize("row", [("cylinder", 0.03, 0.4), ("cylinder", 0.05, 0.25), ("box", 0.05, 0.2)])
@pytest.mark.parametrize("beyond", [-NEAR, NEAR])
def test_what_is_heavier_than_the_chart_has_is_not_grasped(planner, row, beyond):
    """Between its rows, too, for each shape."""
    shape, diameter, most = row
    assert HANDLING.heaviest(shape, diameter) == pytest.approx(most)
    object = replace(BALL, shape=shape, diameter=diameter, mass=HANDLING.heaviest(shape, diameter) + beyond)
    asked = Targets(Target(MOUNT), Target(object.position), DOWN, 0.0, 0, 0.0, object="the ball")
    message = refused(lambda: planner.grasping.grasp(asked, object, START))
    assert message.startswith("payload: the ball weighs ") == (beyond > 0)


@pytest.mark.parametrize(("shape", "diameter"), [("cylinder", 0.08 + NEAR), ("sphere", 0.05), ("box", 0.5)])
def test_of_what_the_chart_does_not_have_nothing_is_grasped(shape, diameter):
    assert HANDLING.heaviest(shape, diameter) == 0.0
    assert HANDLING.heaviest("cylinder", 0.08) == 0.15
    assert HANDLING.heaviest("cylinder", 0.001) == 0.5


@pytest.mark.parametrize(("gap", "start"), [(0.0, ""), (-NEAR, ""), (NEAR, "release: found 60 mm between the ball")])
def test_a_thing_is_let_go_no_higher_than_it_may_fall(gap, start):
    place = (0.5, 0.1, 0.3)
    top = place[2] - below_grip(BALL) - (HANDLING.beneath + gap if gap else 0.0)
    floor = Obstacle("the floor", (-3.0, -3.0, -1.0), (3.0, 3.0, top))
    message = refused(lambda: _require_ground(BALL, place, World("world", (floor,)), HANDLING.beneath))
    assert message.startswith(start)
    assert bool(message) == bool(start)


def test_a_thing_is_not_let_go_over_nothing_or_within_a_solid():
    place = (0.5, 0.1, 0.3)
    for boxes in ((), (Obstacle("the floor", (-3.0, -3.0, -1.0), (3.0, 3.0, place[2] - below_grip(BALL) + NEAR)),)):
        message = refused(lambda boxes=boxes: _require_ground(BALL, place, World("world", boxes), HANDLING.beneath))
        assert message.startswith("release: found nothing between the ball and what is beneath it")


@pytest.mark.parametrize("beyond", [-NEAR, NEAR])
def test_a_tip_may_be_foreseen_as_far_from_its_target_as_the_tolerance(beyond):
    """A network that has one bend, whatever it is asked for."""
    tip = np.array([0.1, 0.0, -0.4])

    def ask(poses):
        return {"commands": np.tile(STRAIGHT, (len(poses), 1)), "lengths": np.tile(STRAIGHT, (len(poses), 1)),
                "tip": np.tile(tip, (len(poses), 1))}  # fmt: skip

    wanted = tuple(map(float, tip + [0.0, 0.0, 0.02 + beyond]))
    message = refused(lambda: bend(Network(ask, 8), wanted, (0.0, 0.0, -1.0), 0.02))
    assert message == (
        "out of reach: the soft arm's tip comes no nearer to its target than 20 mm" if beyond > 0 else ""
    )
