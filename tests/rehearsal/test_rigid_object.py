"""A free body, and one on a surface: against closed forms."""

import numpy as np
import pytest
from scipy.optimize import brentq
from scipy.spatial.transform import Rotation

from rehearsal.robot.rigid_object import Motion, RigidObject, move_object, pull_string, rotation, spin_of
from rehearsal.robot.scene import LabScene, SceneObject, String, make_rigid_object
from rehearsal.robot.shapes import distance
from rehearsal.robot.touching import Contacts, ContactWorld, lie

G = 9.80665
H = 1 / 6000
DOWN = np.array([0.0, 0.0, -G])
NONE = (0.0, 0.0, 0.0)


def body(shape="box", diameter=0.05, height=0.12, mass=0.1, z=0.06, **more) -> tuple[RigidObject, Motion]:
    object = SceneObject(shape, diameter, height, mass, [0.0, 0.0, z], **more)
    return make_rigid_object(object, [0.0, 0.0, 0.5], String())


def floor(object: RigidObject, friction=0.35, loss=3.0) -> tuple[ContactWorld, Contacts]:
    kind, half, edge, place = LabScene(0.0, SceneObject("sphere", 0.1, 0.1, 1.0, [0.0, 0.0, 1.0])).shapes()
    damping = 2 * 0.1 * np.sqrt(2e4 * object.mass)
    world = ContactWorld(kind, half, edge, place, 1e6, 2e4, damping, loss, np.array([friction]))
    bristles, near = np.zeros((1, len(object.kind), 3)), np.zeros((1, len(object.kind) + 1, 3))
    some = [bristles, np.zeros((1, 1, 3)), np.zeros((len(object.points), 1, 3)), near]
    return world, Contacts(*some, np.zeros((1, 3)), np.zeros((1, 1, 3)), np.zeros((1, 3)))


def fall(object, motion, world, contacts, gravity, duration, h=H):
    for _ in range(round(duration / h)):
        turn = rotation(motion.quaternion)
        spin = spin_of(object, motion, turn)
        place, speed = tuple(motion.place), tuple(motion.speed)
        contacts.object_world[:] = 0
        force, torque = lie(h, world, object, contacts, turn, place, speed, spin)
        move_object(object, motion, force, torque, gravity, h)


@pytest.mark.parametrize("speed", [0.2, 1.0])
def test_a_ball_rebounds_as_hunt_and_crossley_s_law_says(speed):
    """m v dv/dδ = -k δ^1.5 (1 + c v): v/c - ln(1 + c v)/c² is alike before and after, whatever k and m are."""
    object, motion = body("sphere", z=0.0251)
    loss = 0.8
    world, contacts = floor(object, loss=loss)
    motion.speed[2] = -speed
    fall(object, motion, world, contacts, np.zeros(3), 0.03)

    def invariant(v):
        return v / loss - np.log(1 + loss * v) / loss**2

    rebound = brentq(lambda v: invariant(-v) - invariant(speed), 1e-6, speed)
    assert motion.speed[2] == pytest.approx(rebound, rel=0.01)


@pytest.mark.parametrize("angle_deg", [10.0, 15.0])
def test_a_block_on_an_incline_sticks_below_friction(angle_deg):
    """tan 15° = 0.27 < 0.35: it settles, then does not creep. The incline is a level floor under leaning gravity."""
    object, motion = body(height=0.05, z=0.025)
    world, contacts = floor(object)
    gravity = G * np.array([np.sin(np.radians(angle_deg)), 0, -np.cos(np.radians(angle_deg))])
    fall(object, motion, world, contacts, gravity, 1.0)
    before = motion.place.copy()
    fall(object, motion, world, contacts, gravity, 2.0)
    assert np.abs(motion.place - before)[:2].max() < 1e-6
    assert np.abs(motion.place - before).max() < 1e-5  # it still sinks in, as its contacts lose little at low speed
    np.testing.assert_allclose(contacts.object_world[0], -object.mass * gravity, atol=1e-4)


def test_a_block_on_an_incline_slides_above_friction():
    """a = g (sin θ - μ cos θ)."""
    object, motion = body(height=0.02, z=0.01)
    friction, angle = 0.35, np.radians(30)
    world, contacts = floor(object, friction)
    fall(object, motion, world, contacts, G * np.array([np.sin(angle), 0, -np.cos(angle)]), 0.5)
    before = motion.speed[0]
    fall(object, motion, world, contacts, G * np.array([np.sin(angle), 0, -np.cos(angle)]), 0.4)
    assert (motion.speed[0] - before) / 0.4 == pytest.approx(G * (np.sin(angle) - friction * np.cos(angle)), rel=0.01)


def test_momenta_and_energy_are_kept_in_free_flight():
    """Momenta to rounding; energy of rotation to the second order of the step."""
    object, motion = body(diameter=0.04, height=0.1)
    motion.speed[:] = [0.3, -0.2, 1.0]
    motion.momentum[:] = object.inertia * [20.0, 5.0, 30.0]
    momentum = motion.momentum.copy()

    def energy():
        turn = rotation(motion.quaternion)
        return 0.5 * np.dot(spin_of(object, motion, turn), motion.momentum)

    first = energy()
    for _ in range(6000):
        move_object(object, motion, NONE, NONE, DOWN, H)
    np.testing.assert_array_equal(motion.momentum, momentum)
    np.testing.assert_allclose(motion.speed, [0.3, -0.2, 1.0 - G], rtol=1e-9)
    assert energy() == pytest.approx(first, rel=1e-4)


def test_a_free_cylinder_precesses_at_the_rate_of_its_momentum():
    """A symmetric top: its axis turns about the angular momentum at L / I_1."""
    object, motion = body("cylinder")
    motion.momentum[:] = [0.0, 3e-4, 4e-4]
    axis = np.array([0.0, 0.0, 1.0])
    duration = 0.5
    for _ in range(round(duration / H)):
        move_object(object, motion, NONE, NONE, np.zeros(3), H)
    size = np.linalg.norm(motion.momentum)
    turn = Rotation.from_rotvec(size / object.inertia[0] * duration * motion.momentum / size)
    turned = np.array(rotation(motion.quaternion)) @ axis
    np.testing.assert_allclose(turned, turn.apply(axis), atol=1e-3)


def test_a_string_holds_its_weight_and_leaves_the_hook_when_it_is_slack():
    object, motion = body(hanging=True, z=0.3)
    for _ in range(round(4 / H)):
        turn = rotation(motion.quaternion)
        force, torque = pull_string(object, motion, turn, spin_of(object, motion, turn))
        move_object(object, motion, force, torque, DOWN, H)
    assert motion.hanging[0] == 1
    assert motion.place[2] == pytest.approx(0.3 - object.mass * G / object.tautness, abs=2e-5)
    motion.place[2] += 0.02
    pull_string(object, motion, rotation(motion.quaternion), NONE)
    assert motion.hanging[0] == 0


def basket(**more) -> tuple[RigidObject, Motion]:
    return body("basket", diameter=0.03, height=0.06, mass=0.2, **more)


def mechanical(object: RigidObject, motion: Motion) -> float:
    """Energy of an object that falls, J."""
    spin = spin_of(object, motion, rotation(motion.quaternion))
    kinetic = 0.5 * (object.mass * motion.speed @ motion.speed + np.dot(spin, motion.momentum))
    return float(kinetic + object.mass * G * motion.place[2])


def test_a_basket_lies_on_points_of_its_own_surface_and_its_bar_is_along_y():
    object, _ = basket()
    grip = SceneObject("basket", 0.03, 0.06, 0.2, [0.0, 0.0, 0.0]).grip

    def away(point):
        inside = [(point - shift) @ turn for shift, turn in zip(object.shift, object.turn, strict=True)]
        shapes = zip(object.kind, object.half, object.edge, inside, strict=True)
        return min(distance(kind, half, edge, tuple(at))[0] for kind, half, edge, at in shapes)

    np.testing.assert_allclose([away(point) for point in object.points], 0, atol=1e-12)
    np.testing.assert_allclose(object.eye, grip + [0, 0, 0.015], atol=1e-9)
    assert away(grip + [0, 0.079, 0.014]) < 0 < away(grip + [0.079, 0, 0.014])


def test_a_basket_stands_still_on_a_table():
    object, motion = basket(z=SceneObject("basket", 0.03, 0.06, 0.2, [0.0, 0.0, 0.0]).half_height)
    world, contacts = floor(object)
    fall(object, motion, world, contacts, DOWN, 1.0)
    before = motion.place.copy(), motion.quaternion.copy()
    fall(object, motion, world, contacts, DOWN, 2.0)
    np.testing.assert_allclose(motion.place, before[0], atol=1e-5)
    np.testing.assert_allclose(motion.quaternion, before[1], atol=1e-6)
    np.testing.assert_allclose(contacts.object_world[0], [0, 0, object.mass * G], atol=1e-4)


def test_a_basket_dropped_askew_gains_no_energy():
    askew = list(Rotation.from_euler("xy", [50, 20], degrees=True).as_quat(scalar_first=True))
    object, motion = basket(z=0.3, quaternion=askew)
    world, contacts = floor(object)
    energies = [mechanical(object, motion)]
    for _ in range(300):
        fall(object, motion, world, contacts, DOWN, 0.005)
        energies.append(mechanical(object, motion))
    lost = energies[0] - energies[-1]
    assert lost > 0.1
    assert (np.array(energies) - np.minimum.accumulate(energies)).max() < 0.01 * lost
    assert motion.place[2] > 0.01


def test_a_basket_hangs_upright_by_its_bar():
    """Tilted by 3°, its string over the hook, it swings about upright, and the string bears its weight in the mean."""
    askew = list(Rotation.from_euler("x", 3, degrees=True).as_quat(scalar_first=True))
    object, motion = basket(z=0.1, hanging=True, quaternion=askew)
    borne, tops = [], []
    for _ in range(round(4 / H)):
        turn = rotation(motion.quaternion)
        force, torque = pull_string(object, motion, turn, spin_of(object, motion, turn))
        move_object(object, motion, force, torque, DOWN, H)
        borne.append(force[2])
        tops.append(np.degrees(np.arccos(min(turn[2][2], 1.0))))
    assert motion.hanging[0] == 1
    assert np.mean(borne) == pytest.approx(object.mass * G, rel=0.01)
    assert 1.0 < max(tops) < 5.0
