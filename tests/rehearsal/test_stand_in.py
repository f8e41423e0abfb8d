"""The stand-in as a client meets it: bad commands, delays, seeds, alignment, steps."""

from dataclasses import replace

import numpy as np
import pytest

from rehearsal.robot.scene import LabScene, SceneObject
from rehearsal.robot.stand_in import TICK, StandInRobot
from tests.rehearsal.arm import settings, stranger
from trunkline.errors import InputError

READY = np.array([0.0, -0.2, 0.0, -1.9, 0.0, 1.7, 0.785])
SCENE = LabScene(None, SceneObject("cylinder", 0.05, 0.12, 0.1, [0.62, 0.05, 0.3], hanging=True), {}, [0.62, 0.05, 0.5])
EXACT = {"joint_noise": 0.0, "wound_noise_mm": 0.0, "position_noise_mm": 0.0, "orientation_noise_deg": 0.0}


def robot(seed=1, substeps=6, **sensors) -> StandInRobot:
    s = settings()
    return StandInRobot(stranger(), SCENE, replace(s, sensors=replace(s.sensors, **sensors)), READY, seed,
                        substeps=substeps)  # fmt: skip


@pytest.fixture(scope="module")
def still() -> StandInRobot:
    return robot()


@pytest.mark.parametrize(("joints", "pulls", "named"), [
    (READY + [0, 0, 0, np.nan, 0, 0, 0], np.zeros(3), "joint_4"),
    (READY + [0, 9, 0, 0, 0, 0, 0], np.zeros(3), "joint_2"),
    (READY[:6], np.zeros(3), "joint_positions"),
    (READY, np.array([0, np.nan, 0]), "tendon_commands"),
    (READY, np.array([0, 200.0, 0]), "tendon_commands"),
    (READY, np.zeros(2), "tendon_commands"),
])  # fmt: skip
def test_a_bad_command_is_refused_by_name_and_changes_nothing(still, joints, pulls, named):
    before = len(still.sent), len(still.pulled)
    with pytest.raises(InputError, match=named) as caught:
        still.send(joints, pulls)
    assert "\n" not in str(caught.value)
    assert (len(still.sent), len(still.pulled)) == before


@pytest.mark.parametrize("dt", [-0.1, np.nan])
def test_time_does_not_go_back(still, dt):
    with pytest.raises(InputError, match="dt"):
        still.advance(dt)


def test_what_touches_at_the_start_is_refused():
    scene = LabScene(0.15, SCENE.object, {}, SCENE.hook)
    with pytest.raises(InputError, match="unit_.*inside floor"):
        StandInRobot(stranger(), scene, settings(), READY, 1)


def test_uneven_steps_add_up_to_the_same_time():
    stand_in = robot()
    for _ in range(30):
        stand_in.advance(1 / 60)
    assert stand_in.time == pytest.approx(0.5, abs=TICK)


def wave(stand_in: StandInRobot) -> tuple[list, list]:
    """Seen and true, in 20 ms steps, while two joints and a tendon move."""
    read, true = [], []
    for n in range(20):
        stand_in.send(READY + 0.01 * n * np.eye(7)[0] - 0.005 * n * np.eye(7)[3], np.array([0.004 * n, -0.1, -0.1]))
        stand_in.advance(0.02)
        read.append(stand_in.readings())
        true.append(stand_in.truth())
    return read, true


def test_the_same_seed_gives_the_same_bytes_and_another_does_not():
    first, second, third = (wave(robot(seed))[0][-1] for seed in (1, 1, 2))
    for name in ("joints", "wound", "tip", "tip_quaternion", "object", "object_quaternion"):
        assert getattr(first, name).tobytes() == getattr(second, name).tobytes()
        assert getattr(first, name).tobytes() != getattr(third, name).tobytes()


def test_what_is_seen_is_the_truth_of_some_time_ago_in_a_frame_that_is_off():
    stand_in = robot(pose_delay=0.04, joint_delay=0.02, alignment_mm=10.0, alignment_deg=2.0, **EXACT)
    read, true = wave(stand_in)
    for n in range(4, 20):
        np.testing.assert_array_equal(read[n].joints, true[n - 1].joints)
        assert read[n].pose_time == pytest.approx(true[n - 2].time)
        back = stand_in.instruments.turn.inv().apply(read[n].tip - stand_in.instruments.shift)
        np.testing.assert_allclose(back, true[n - 2].tip, atol=1e-12)


def test_half_the_step_moves_tip_and_object_by_little():
    """While the arm swings and the object hangs."""
    whole, half = (wave(robot(substeps=substeps))[1] for substeps in (6, 12))
    moved = np.linalg.norm(whole[-1].tip - whole[0].tip)
    assert np.linalg.norm(whole[-1].tip - half[-1].tip) < 0.01 * moved
    assert np.linalg.norm(whole[-1].object - half[-1].object) < 1e-4


def test_robots_that_begin_alike_rest_alike_and_share_nothing():
    """The arm's rest is sought once: what the first robot does to its arm is no matter to the next."""
    first = robot()
    rest = [part.copy() for part in first.state]
    first.send(first.joints[0], [0.02, 0.0, 0.0])
    first.advance(0.5)
    assert any((moved != part).any() for moved, part in zip(first.state, rest, strict=True))
    for part, again in zip(rest, robot().state, strict=True):
        np.testing.assert_array_equal(part, again)
