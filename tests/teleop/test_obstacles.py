"""What stands in a plan's way is named, with when: of the rigid robot, and of the arm wherever its statics have it."""

import numpy as np
import pytest

from tests.support.bent_chain import hardening_stump
from tests.support.operator import READY_JOINTS
from trunkline.errors import InputError
from trunkline.frames import gravity_in_base
from trunkline.panda.kinematics import mount_pose
from trunkline.statics.chain import read_chain
from trunkline.statics.equilibria import actuated
from trunkline.statics.placement import joint_places
from trunkline.teleop.messages import Box, World
from trunkline.teleop.obstacles import refuse
from trunkline.teleop.plan import Plan

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
    return mount + joint_places(CHAIN, rest.qpos)[0] @ (flange * [1, -1, -1]).T


def about(place: np.ndarray, half: float = 0.005) -> World:
    return World("world", (Box("the table", tuple(map(float, place - half)), tuple(map(float, place + half))),))


def test_the_hanging_arm_in_a_solid_is_refused_at_once():
    with pytest.raises(InputError, match=r"world: the arm would come into the table after 0\.00 s"):
        refuse(curling("approach", "curl"), about(places(STRAIGHT)[-1]), OFFSET, CHAIN)


def test_a_solid_where_the_arm_curls_to_is_named_with_when():
    there = about(places(STRAIGHT - PULL)[-1])
    refuse(curling("approach", "curl"), there, OFFSET)  # of an arm that nobody knows, nothing is said
    with pytest.raises(InputError, match=r"world: the arm would come into the table after 1\.[89]\d? s"):
        refuse(curling("approach", "curl"), there, OFFSET, CHAIN)


def test_from_where_it_closes_about_a_thing_the_preview_shows_the_way():
    there = about(places(STRAIGHT - PULL)[-1])
    refuse(curling("approach", "curl", "lift"), there, OFFSET, CHAIN)
    refuse(curling("transfer", "release"), about(places(STRAIGHT)[-1]), OFFSET, CHAIN)
    with pytest.raises(InputError, match="the arm would come into"):
        refuse(curling("approach", "curl", "lift"), about(places(STRAIGHT)[-1]), OFFSET, CHAIN)


def test_what_is_beside_the_arms_way_is_not_in_it():
    refuse(curling("approach", "curl"), about(places(STRAIGHT)[-1] + [0, 0, -0.05]), OFFSET, CHAIN)


def test_a_solid_in_a_links_way_is_named_first_of_its_kind():
    (mount,), _ = mount_pose(READY[None], OFFSET)
    with pytest.raises(InputError, match=r"world: (joint \d|mount) of the rigid robot would come into the table after"):
        refuse(curling("approach", "curl"), about(mount), OFFSET, CHAIN)
