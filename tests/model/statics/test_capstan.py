"""Capstan friction at rest: the belt's closed form, Newton's derivatives, the way back, and slow motors in MuJoCo."""

import mujoco
import numpy as np
import pytest

from tests.support.bent_chain import hardening_stump, rubbing, stump, stump_spec
from trunkline.frames import gravity_in_base
from trunkline.model.arm.guide_holes import GuideHoles, add_holes
from trunkline.model.arm_model import SLIP
from trunkline.model.simulation.drive import drive
from trunkline.model.statics.capstan import eliminate, solve_eliminated
from trunkline.model.statics.chain import read_chain
from trunkline.model.statics.energy import Pull, evaluate, find_hessian
from trunkline.model.statics.equilibria import actuated, equilibrium
from trunkline.model.statics.hysteresis import friction_band
from trunkline.model.statics.newton import find_equilibrium, new_work

FRICTION, GRAVITY = 0.3, gravity_in_base(0.6)


@pytest.fixture(scope="module")
def chain():
    """Its slip length is the share of a unit's length that conf/build_mjcf/holes/rubbing.yaml names."""
    return rubbing(read_chain(stump()), FRICTION)


@pytest.mark.parametrize("side", [1, -1])
def test_tension_falls_as_the_capstan_equation_says(chain, side):
    """Joints so stiff that the pull does not turn them, bent by their springs' rest: what each spring bears is the
    tension there, T exp(-μ Σθ) with half of the bend at the joint itself. The tendon comes to be shorter by far than
    where the arm hangs, if that is straight; drawn in, it slides to the motor."""
    tension, bend = 10.0, 0.2
    bent = np.zeros((chain.units, 2))
    bent[:, 1] = -bend if _shortens(chain) else bend
    free, stiffness = np.tile([-np.inf, np.inf], (chain.units, 2, 1)), 1e6 * (np.arange(3) == 0)
    stiff = chain._replace(
        stiffness=np.tile(stiffness, (chain.units, 2, 1)), rest=bent, limit=free, capstan=side * FRICTION
    )
    work, pull = new_work(chain.units, 3), _pull(chain, [tension, 0, 0], side * FRICTION)
    q = bent.ravel().copy()
    assert find_equilibrium(stiff, q, np.zeros(3), pull, False, work)[3]
    np.testing.assert_allclose(q.reshape(-1, 2), bent, atol=1e-5)
    borne = 1e6 * (bent - q.reshape(-1, 2))[:, 1] / work.state.jacobian[0, 1::2]
    turned = bend * (np.arange(chain.units) + 0.5)
    np.testing.assert_allclose(borne / tension, np.exp(-side * FRICTION * turned), rtol=1e-4)


def _pull(chain, tensions, friction, slope=0.0):
    free, loose = np.zeros(3), np.linalg.norm(chain.hole_out - chain.hole_in, axis=2)
    slope, length = np.full(3, slope), chain.straight_lengths - [0.004, 0.002, 0.3]
    return Pull(np.array(tensions, float), slope, length, free + 9, np.zeros((chain.units, 2)), friction, loose)


def _shortens(chain):
    """Whether a negative turn of each unit's second hinge shortens the first tendon."""
    work = new_work(chain.units, 3)
    evaluate(chain, np.zeros(2 * chain.units), np.zeros(3), _pull(chain, [0, 0, 0], 0.0), work.state)
    return work.state.jacobian[0, 1] > 0


def test_torques_balance_in_mujoco(chain):
    """Torques of springs and weight by MuJoCo, and of each chord by its own change of length with the joint."""
    model = stump()
    model.tendon_frictionloss[:] = 0
    data, step, tensions = mujoco.MjData(model), 1e-6, [12.0, 5.0, 0.0]
    model.opt.gravity[:] = GRAVITY
    rest = equilibrium(chain, np.array([tensions]), GRAVITY)
    hanging = equilibrium(chain, np.zeros((1, 3)), GRAVITY)
    loose, chords = _chords(model, data, hanging.qpos[0]), _chords(model, data, rest.qpos[0])
    slid = np.cumsum((loose - chords)[:, ::-1], axis=1)[:, ::-1]
    assert np.abs(slid).max() > 5 * chain.slip
    turns = np.linalg.norm(rest.qpos[0].reshape(-1, 2), axis=1) * np.clip(slid / chain.slip, -1, 1)  # (K, n)
    shares = np.exp(-FRICTION * (np.cumsum(turns, axis=1) - turns / 2))
    torques = np.zeros(model.nv)
    for joint in range(model.nv):
        ends = []
        for side in (1, -1):
            q = rest.qpos[0].copy()
            q[joint] += side * step
            ends.append(_chords(model, data, q))
        torques[joint] = -np.sum(np.array(tensions)[:, None] * shares * (ends[0] - ends[1])) / (2 * step)
    data.qpos[:] = rest.qpos[0]
    mujoco.mj_forward(model, data)
    np.testing.assert_allclose(data.qfrc_passive - data.qfrc_bias + data.qfrc_constraint + torques, 0, atol=1e-5)


def _chords(model, data, q):
    """Distances from hole to hole as MuJoCo wraps the tendons, m. Shape (K, n)."""
    data.qpos[:] = q
    mujoco.mj_forward(model, data)
    points = data.wrap_xpos.reshape(-1, 3)
    paths = [points[a : a + n] for a, n in zip(data.ten_wrapadr, data.ten_wrapnum, strict=True)]
    return np.array([np.linalg.norm(np.diff(path, axis=0), axis=1) for path in paths])


@pytest.mark.parametrize("slope", [0.0, 500.0], ids=["tensions", "springs"])
@pytest.mark.parametrize(("reach", "slip"), [(0.3, 5e-4), (0.3, 2e-3), (0.02, 2e-4)])
def test_derivatives_are_those_of_the_torques(slope, reach, slip):
    """Of a chain with everything, all tendons pulling; and the factors solve as a dense solver does."""
    chain = read_chain(hardening_stump())._replace(slip=slip)
    q = np.random.default_rng(2).uniform(-reach, reach, 2 * chain.units)
    work, pull, step = new_work(chain.units, 3), _pull(chain, [4.0, 2.0, 7.0], FRICTION, slope), 1e-7
    state = work.state
    evaluate(chain, q, GRAVITY, pull, state)
    unsaturated = (state.rub.side[:, :, 1] > 0).mean()
    assert unsaturated > 0, "some holes have slid by less than the slip length"
    assert unsaturated < 1 or reach < 0.1, "and some by more"
    hessian, size = find_hessian(GRAVITY, pull, state), 2 * chain.units
    matrix = np.triu(hessian.left.T @ hessian.right) + np.tril(state.rub.left.T @ state.rub.right, -1)
    for i, (aa, ab, bb, ba) in enumerate(hessian.block):
        matrix[2 * i : 2 * i + 2, 2 * i : 2 * i + 2] = [[aa, ab], [ba, bb]]
    x = np.random.default_rng(3).normal(size=size)
    solved = x.copy()
    assert eliminate(hessian, state.rub, work.factor)
    solve_eliminated(hessian, state.rub, work.factor, solved)
    np.testing.assert_allclose(matrix @ solved, x, rtol=1e-9, atol=1e-10)
    for j in range(size):
        ends = []
        for way in (step, -step):
            moved = q.copy()
            moved[j] += way
            evaluate(chain, moved, GRAVITY, pull, state)
            ends.append(state.gradient.copy())
        np.testing.assert_allclose(matrix[:, j], (ends[0] - ends[1]) / (2 * step), rtol=1e-5, atol=1e-5)
    assert np.abs(matrix - matrix.T).max() > 1e-3, "without friction it were symmetric"


def test_an_arm_drawn_in_bends_less_and_one_let_go_more(chain):
    """The ends of the band lie on both sides of where the same commands hold the arm without friction."""
    tensions = np.array([[9.0, 3.0, 0.0], [0.0, 6.0, 6.0]])
    gravity = np.tile(GRAVITY, (2, 1))
    here = equilibrium(chain.smooth, tensions, gravity)
    band = friction_band(chain, tensions, gravity, np.zeros(3), np.zeros((chain.units, 2)), capstan=chain.capstan)
    np.testing.assert_allclose(band.loaded, actuated(chain, here.commands, gravity).position, atol=1e-7)
    middle = here.position
    for before, after in zip(middle - band.loaded, band.unloaded - middle, strict=True):
        assert np.linalg.norm(before) > 5e-4
        assert before @ after > 0.9 * np.linalg.norm(before) * np.linalg.norm(after)


def test_slow_motors_in_mujoco_come_to_rest_there():
    """Seven stretches for seven units, drawn in within 6 s from where the arm hangs."""
    spec = stump_spec()
    for cable in spec.tendons:
        cable.frictionloss = 0.0
    add_holes(spec, GuideHoles(FRICTION, 7))
    model = spec.compile()
    model.dof_frictionloss[:] = 0
    chain = read_chain(model)
    assert chain.capstan == FRICTION
    tensions = np.array([[9.0, 0.0, 0.0], [0.0, 6.0, 5.0]])
    rest = equilibrium(chain, tensions, GRAVITY)
    smooth = actuated(chain._replace(capstan=0.0), rest.commands, GRAVITY)
    hanging = equilibrium(chain, np.zeros((1, 3)), GRAVITY).lengths
    commands = hanging + np.linspace(0, 1, 600)[None, :, None] * (rest.commands[:, None] - hanging)
    model.dof_damping *= 5  # so that it does not swing
    end = drive(model, commands, GRAVITY, 10.0).end
    apart = np.linalg.norm(end - rest.position, axis=1)
    assert (apart < 0.1 * np.linalg.norm(smooth.position - rest.position, axis=1)).all()


def test_holes_over_which_nothing_has_slid_hold_nothing(chain):
    work, pull = new_work(chain.units, 3), _pull(chain, [10, 0, 0], FRICTION)
    evaluate(chain, np.full(2 * chain.units, 1e-3), np.zeros(3), pull, work.state)
    slid = np.abs(pull.loose - work.state.chord).sum(axis=0)[0]
    assert 0 < slid < chain.slip
    assert (work.state.share[:, 0] > np.exp(-FRICTION * 2e-3 * chain.units * slid / chain.slip)).all()


@pytest.mark.parametrize("slip", [1e-3, 2e-4])
def test_friction_builds_up_within_the_slip_length(chain, slip):
    """One that has slid by half of it, over a single hole, has half of the friction there."""
    chain = chain._replace(slip=slip)
    work, pull = new_work(chain.units, 3), _pull(chain, [10, 0, 0], FRICTION)
    turned = np.zeros(2 * chain.units)
    for turn in np.linspace(0, -0.5 if _shortens(chain) else 0.5, 2000):
        turned[-1] = turn
        evaluate(chain, turned, np.zeros(3), pull, work.state)
        slid = (pull.loose - work.state.chord)[-1, 0]
        if slid >= slip / 2:
            break
    assert slid == pytest.approx(slip / 2, rel=0.1)
    half = np.exp(-FRICTION * abs(turn) * (slid / slip) / 2)  # of the bend at the joint itself, half counts
    assert work.state.share[-1, 0] == pytest.approx(half, rel=1e-9)


def test_a_model_says_its_slip_length_and_one_that_does_not_has_the_usual():
    spec, without = stump_spec(), stump_spec()
    add_holes(spec, GuideHoles(FRICTION, 7, slip=7e-4))
    assert read_chain(spec.compile()).slip == 7e-4
    again = mujoco.MjSpec.from_string(spec.to_xml())
    assert read_chain(again.compile()).slip == 7e-4
    assert read_chain(without.compile()).slip == SLIP


def test_the_band_hardly_depends_on_the_slip_length(chain):
    """Nothing identifies it: with half and with twice of it, the ends of the band stay where they are."""
    tensions = np.array([[9.0, 3.0, 0.0], [0.0, 6.0, 6.0], [4.0, 0.0, 0.0]])
    gravity, nothing = np.tile(GRAVITY, (3, 1)), (np.zeros(3), np.zeros((chain.units, 2)))
    usual, half, double = (
        friction_band(chain._replace(slip=factor * chain.slip), tensions, gravity, *nothing, capstan=FRICTION)
        for factor in (1, 0.5, 2)
    )
    for other in (half, double):
        for end in ("loaded", "unloaded"):
            moved = np.linalg.norm(getattr(other, end) - getattr(usual, end), axis=1)
            assert (moved < 0.02 * usual.width).all()
