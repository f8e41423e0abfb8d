"""The core: the same inputs give the same intents, rays and presses do what they say, and nothing is clamped
silently."""

import math
import subprocess
import sys
from dataclasses import replace

import numpy as np
import pytest
from scipy.spatial.transform import Rotation

from tests.support.operator import DT, FORWARD, Everywhere, Operator, config
from trunkline.ar.teleop.messages import Input, Intent, from_json, to_json
from trunkline.ar.teleop.tracked_controller import ray_length
from trunkline.errors import InputError
from trunkline.frames import wxyz_from_rotation

REPLAY = """
import sys
from tests.support.operator import Operator, DT
from trunkline.ar.teleop.messages import Input, from_json, to_json
operator = Operator()
state = operator.core.start()
for line in sys.stdin.buffer:
    state, intent = operator.core.step(state, from_json(Input, line), DT)
    sys.stdout.buffer.write(to_json(intent) + b"\\n")
"""


def trembling() -> Operator:
    """All modes once, by a hand that trembles, with faults among it."""
    operator, rng = Operator(), np.random.default_rng(0)
    operator.to("execute")
    for i in range(200):
        noise = lambda: tuple(map(float, rng.normal(scale=0.01, size=3)))  # noqa: E731
        stick = (0.0, float(rng.uniform(-1, 1)))
        operator.step(
            left={"position": noise() if i % 50 else (float("nan"), 0.0, 0.0), "stick": stick, "grip": i % 70 > 30},
            right={"position": noise(), "grip": i % 70 > 30, "trigger": i % 20 == 0},
        )
    return operator


def test_the_same_inputs_give_the_same_intents_byte_for_byte_also_elsewhere():
    operator = trembling()
    recorded = b"".join(to_json(message) + b"\n" for message in operator.inputs)
    replayed = subprocess.run([sys.executable, "-c", REPLAY], input=recorded, capture_output=True, check=True).stdout
    assert replayed == b"".join(to_json(intent) + b"\n" for intent in operator.intents)
    assert len({intent.mode for intent in operator.intents}) >= 6


def test_step_changes_neither_its_state_nor_anything_else():
    operator = Operator()
    operator.to("aim")
    state, message = operator.state, operator.message
    message = replace(message, stamp=message.stamp + DT)
    first, again = operator.core.step(state, message, DT), operator.core.step(state, message, DT)
    assert first == again
    assert state is operator.state


def test_messages_come_back_from_json_exactly():
    operator = trembling()
    for message, intent in zip(operator.inputs, operator.intents, strict=True):
        assert to_json(from_json(Input, to_json(message))) == to_json(message)
        assert from_json(Intent, to_json(intent)) == intent
    missing = next(message for message in operator.inputs if math.isnan(message.left.position[0]))
    assert math.isnan(from_json(Input, to_json(missing)).left.position[0])


@pytest.mark.parametrize(("text", "line"), [("{}", "Input: stamp: Field required"), ("[", "Input: the whole: Invalid")])
def test_what_is_no_message_is_one_line(text, line):
    with pytest.raises(InputError, match=line):
        from_json(Input, text)


def test_targets_are_at_the_ends_of_the_rays_in_the_base_frame():
    operator = Operator()
    operator.wait(0.5)
    turn = Rotation.from_euler("y", 30, degrees=True)
    pose = {"quaternion": tuple(map(float, wxyz_from_rotation(turn)))}
    intent = operator.wait(3.0, left={"grip": True, **pose}, right={"grip": True})
    alignment = operator.message.alignment
    end = np.array(operator.message.left.position) + turn.apply([0, 0, -0.6])
    expected = alignment.position + Rotation.from_quat(alignment.quaternion, scalar_first=True).apply(end)
    np.testing.assert_allclose(intent.targets.rigid.position, expected, atol=1e-6)
    np.testing.assert_allclose(intent.rays[0], expected, atol=1e-6)


def test_stick_makes_the_ray_longer_at_its_rate_and_to_its_limits():
    rays = config().core.rays
    assert ray_length(1.0, 1.0, 0.5, rays) == pytest.approx(1.0 + 0.5 * rays.rate)
    assert ray_length(1.0, -1.0, 0.5, rays) == pytest.approx(1.0 - 0.5 * rays.rate)
    assert ray_length(1.0, rays.dead_zone, 0.5, rays) == 1.0
    half = (1 + rays.dead_zone) / 2
    assert ray_length(1.0, half, 0.5, rays) == pytest.approx(1.0 + 0.25 * rays.rate)
    assert ray_length(1.0, 1.0, 100.0, rays) == rays.longest
    assert ray_length(1.0, -1.0, 100.0, rays) == rays.shortest


def test_clutch_a_target_stays_while_its_grip_is_let_go():
    operator = Operator()
    operator.wait(0.5)
    before = operator.wait(0.3, left={"grip": True}, right={"grip": True}).targets
    operator.wait(0.1, left={"grip": False})
    intent = operator.wait(0.5, left={"position": (0.5, 0.5, 0.5)})
    assert intent.targets.rigid.position == before.rigid.position
    assert intent.rays[0] != intent.targets.rigid.position
    intent = operator.wait(0.5, left={"grip": True})
    np.testing.assert_allclose(intent.rays[0], intent.targets.rigid.position)


def test_tilting_the_controller_aligns_the_end_effector_with_it():
    operator = Operator()
    operator.wait(0.5)
    operator.wait(0.3, left={"grip": True}, right={"grip": True})
    before = operator.intents[-1].targets
    tilt = Rotation.from_euler("z", 30, degrees=True)  # about the ray: its end stays where it is
    pose = {"quaternion": tuple(map(float, wxyz_from_rotation(tilt)))}
    operator.step(left={"primary": True})
    intent = operator.wait(3.0, left=pose)
    turn = Rotation.from_quat(operator.message.alignment.quaternion, scalar_first=True) * tilt
    np.testing.assert_allclose(intent.targets.pointing, turn.apply([0, -1, 0]), atol=1e-6)
    np.testing.assert_allclose(intent.targets.rigid.position, before.rigid.position, atol=1e-6)
    assert not intent.targets.tilt_limited
    assert np.arccos(-intent.targets.pointing[2]) == pytest.approx(np.radians(30), abs=1e-6)


def test_outside_the_nearest_point_is_offered_and_taken_only_when_asked():
    operator = Operator(reach=Everywhere(1.0))
    operator.wait(0.5)
    intent = operator.wait(0.3, left={"grip": True}, right={"grip": True})
    target = intent.targets.rigid
    assert target.reach == "outside"
    assert target.outside_by == pytest.approx(np.linalg.norm(target.position) - 1.0)
    np.testing.assert_allclose(target.position, intent.rays[0])  # where the user put it
    intent = operator.step(left={"trigger": True})
    assert intent.mode == "aim"
    assert intent.notice == "rigid target is 281 mm out of reach; primary button takes the nearest point that is within"
    offer = intent.targets.rigid.offer
    operator.step(left={"trigger": False, "grip": False})
    operator.step(left={"primary": True})
    intent = operator.wait(0.2, left={"primary": False})
    assert intent.targets.rigid.position == offer
    assert operator.step(right={"trigger": True}).mode == "plan"


def test_hands_are_chosen_by_the_settings():
    left_handed, other = Operator(), Operator(rigid_hand="right")
    for operator in (left_handed, other):
        operator.wait(0.5)
        operator.wait(0.3, left={"grip": True}, right={"grip": True})
    assert left_handed.intents[-1].targets.rigid.position == other.intents[-1].targets.tip.position
    assert left_handed.message.left.quaternion == FORWARD
