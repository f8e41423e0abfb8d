"""Commands for a tip target: the network asked in its own form, and its answer corrected by the arm's statics."""

import numpy as np
import pytest
from scipy.spatial.transform import Rotation

from tests.support.bent_chain import hardening_stump, stump
from tests.support.residual import everywhere
from trunkline.ar.teleop.correction import ROUNDS, Bent, corrected
from trunkline.ar.teleop.tendons import Network, _at_tilt, bend
from trunkline.ar.teleop.tilt_reach import SYMMETRY
from trunkline.errors import InputError
from trunkline.frames import STANDARD_GRAVITY, downwards
from trunkline.kinematics.ik.inputs import DIRECTION, TILT
from trunkline.kinematics.residual.residual_map import RestingPoses
from trunkline.model.simulation.rest import settle
from trunkline.model.statics.chain import read_chain
from trunkline.model.statics.equilibria import actuated, equilibrium


@pytest.fixture(scope="module")
def chain():
    return read_chain(hardening_stump())


def poor(chain, gravity, asked=None):
    """A network of directions that answers half of the pull that it takes, and foresees what was asked for."""
    tensions = np.zeros((1, chain.tendons))
    tensions[0, 0] = 0.5 * chain.max_tension[0]
    rest = equilibrium(chain, 0.5 * tensions, STANDARD_GRAVITY * gravity)

    def ask(poses):
        if asked is not None:
            asked.append(poses)
        rows = len(poses)
        return {
            "commands": np.tile(rest.commands, (rows, 1)),
            "lengths": np.tile(rest.lengths, (rows, 1)),
            "tip": poses[:, -7:-4],
        }

    target = equilibrium(chain, tensions, STANDARD_GRAVITY * gravity).position[0]
    return Network(ask, len(DIRECTION)), tuple(map(float, target)), rest.position[0]


@pytest.mark.parametrize("azimuth", [0.0, 1.0, 4.0])
def test_statics_bring_the_tip_where_a_poor_network_leaves_it_short(chain, azimuth):
    down = downwards(0.6, azimuth)
    network, target, short = poor(chain, down)
    assert np.linalg.norm(short - target) > 0.02 * chain.length
    bent = bend(network, target, tuple(map(float, down)), 0.02, chain)
    np.testing.assert_allclose(bent.tip, target, atol=1e-4)
    rest = settle(hardening_stump(), bent.commands[None], STANDARD_GRAVITY * down)
    np.testing.assert_allclose(rest.position[0], bent.tip, atol=5e-4)


@pytest.mark.parametrize("shift", [[0.0, 0.0, 0.004], [0.003, -0.002, 0.0]])
def test_with_a_residual_map_the_arm_s_tip_comes_to_the_target_and_the_twin_s_beside_it(chain, shift):
    down = downwards(0.6, 1.0)
    network, on_twin, _ = poor(chain, down)
    target = tuple(np.array(on_twin) + shift)
    bent = bend(network, target, tuple(map(float, down)), 0.02, chain, everywhere(shift, chain.tendons))
    np.testing.assert_allclose(bent.tip, target, atol=1e-4)
    rest = actuated(chain, bent.commands[None], STANDARD_GRAVITY * down)
    np.testing.assert_allclose(rest.position[0], on_twin, atol=1e-4)


class Lopsided:
    """A residual map of an arm that is not the same in all planes: of pulls, m, and gravity, m/s²."""

    def __init__(self):
        self.asked = []

    def mean(self, poses):
        self.asked.append((poses.pulls[0], poses.gravity[0]))
        return np.array([[0.004, 0.0, 0.0]]) + 5e-4 * poses.gravity + 0.1 * poses.pulls[:, :3]


@pytest.mark.parametrize("turns", [0, 1, -1])
def test_a_network_of_tilts_foresees_the_tip_by_the_map_of_the_arm_as_it_is_held(turns):
    plain = read_chain(stump())
    tilt, turn = 0.6, Rotation.from_euler("z", turns * SYMMETRY)
    plane, down = downwards(tilt, 0.0), downwards(tilt, turns * SYMMETRY)
    tensions = np.zeros((1, plain.tendons))
    tensions[0, 0] = 0.1 * plain.max_tension[0]
    rest, learnt = equilibrium(plain, tensions, STANDARD_GRAVITY * plane), Lopsided()

    def shift(commands, gravity):
        return learnt.mean(RestingPoses(plain.straight_lengths - commands[None], STANDARD_GRAVITY * gravity[None]))[0]

    def ask(poses):
        tip = rest.position + shift(rest.commands[0], plane)  # in the network's plane
        answer = {"commands": rest.commands, "lengths": rest.lengths, "tip": tip}
        return {name: np.tile(part, (len(poses), 1)) for name, part in answer.items()}

    commands = np.roll(rest.commands[0], turns)
    expected = turn.apply(rest.position[0]) + shift(commands, down)
    network, gravity = Network(ask, len(TILT)), tuple(map(float, down))
    first = _at_tilt(network, tuple(expected), gravity, plain, learnt)
    np.testing.assert_array_equal(first.commands, commands)
    np.testing.assert_allclose(first.tip, expected, atol=1e-12)
    learnt.asked.clear()
    bent = corrected(plain, first, tuple(expected), gravity, learnt)
    assert len(learnt.asked) == ROUNDS + 1
    np.testing.assert_allclose([pull for _, pull in learnt.asked], [STANDARD_GRAVITY * down] * (ROUNDS + 1))
    at_rest = actuated(plain, bent.commands[None], STANDARD_GRAVITY * down).position[0]
    np.testing.assert_allclose(bent.tip, at_rest + shift(bent.commands, down), atol=1e-5)
    np.testing.assert_allclose(bent.tip, expected, atol=5e-4)
    np.testing.assert_array_equal(bend(network, tuple(expected), gravity, 0.02, plain, learnt).tip, bent.tip)


@pytest.mark.parametrize("beyond", [0.0, 0.01, 0.02])
def test_no_tension_is_in_all_tendons_though_the_target_is_out_of_reach(chain, beyond):
    """An answer whose tendons are all taut, as of a network that has each a little too short: nearer to a target beyond
    the surface by more such tension, which the motors' limits and friction would turn into errors of the tip."""
    down = downwards(0.0, 0.0)
    tensions = np.full((1, chain.tendons), 0.1 * chain.max_tension[0])
    tensions[0, 0] = 0.5 * chain.max_tension[0]
    taut = equilibrium(chain, tensions, STANDARD_GRAVITY * down)
    target = taut.position[0] * (1 - beyond)
    bent = corrected(chain, Bent(taut.commands[0], taut.lengths[0], target), tuple(target), tuple(down))
    rest = actuated(chain, bent.commands[None], STANDARD_GRAVITY * down)
    assert rest.tensions.min() < 0.02 * chain.max_tension[0]
    assert np.linalg.norm(bent.tip - taut.position[0]) < 0.02 * chain.length


def test_a_network_of_directions_is_told_gravity_as_it_is(chain):
    asked = []
    down = downwards(0.6, 1.0)
    network, target, _ = poor(chain, down, asked)
    bend(network, target, tuple(map(float, down)), 0.02)
    (poses,) = asked
    assert poses.shape[1] == len(DIRECTION)
    np.testing.assert_allclose(poses[:, :3], np.tile(down, (len(poses), 1)))
    np.testing.assert_allclose(np.linalg.norm(poses[:, 6:], axis=1), 1)


def test_what_the_statics_cannot_reach_is_refused_though_the_network_foresees_it(chain):
    down = downwards(0.3, 1.0)
    network, _, _ = poor(chain, down)
    with pytest.raises(InputError, match="out of reach: the soft arm's tip comes no nearer to its target than"):
        bend(network, (2 * chain.length, 0.0, 0.0), tuple(map(float, down)), 0.02, chain)


@pytest.mark.parametrize(("degrees", "within"), [(3.0, True), (45.0, False)])
def test_an_arm_that_leans_may_miss_by_as_much_as_that_is_but_not_by_any_length(chain, degrees, within):
    """A target that an upright arm reaches lies off the surface of one that leans aside."""
    down = downwards(0.6, 1.0)
    network, target, _ = poor(chain, down)
    lean = Rotation.from_rotvec(np.radians(degrees) * np.array([0.0, 0.0, 1.0]) + np.radians(degrees) * np.eye(3)[0])
    missed = bend(network, target, tuple(map(float, down)), 1.0, chain, lean=lean).tip - target
    tolerance = 0.001
    if within:
        assert np.linalg.norm(missed) < tolerance + 0.03
        bend(network, target, tuple(map(float, down)), tolerance, chain, lean=lean)
    else:
        with pytest.raises(InputError, match="out of reach"):
            bend(network, target, tuple(map(float, down)), tolerance, chain, lean=lean)
