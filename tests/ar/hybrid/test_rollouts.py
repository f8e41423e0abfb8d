"""Futures of a plan: what each has, and what comes of it, on a short arm of few units."""

import copy
from dataclasses import replace

import mujoco
import numpy as np
import pytest

from tests.ar.hybrid.conftest import hybrid_settings, rubbing_arm
from tests.support.twins import posterior_about
from trunkline.ar.hybrid.compose import Placed, compose
from trunkline.ar.hybrid.friction import TPU_ON
from trunkline.ar.hybrid.objects import GraspObject
from trunkline.ar.hybrid.outcomes import Holding
from trunkline.ar.hybrid.rates import wilson
from trunkline.ar.hybrid.rollout_batch import joined, nominal, preview
from trunkline.ar.hybrid.rollouts import CommandTrajectory, ComposedTwin, eased, rollouts, rows_of
from trunkline.ar.hybrid.uncertainty import (
    Contact,
    GraspUncertainty,
    PosteriorSamples,
    nominal_sample,
    sample,
)
from trunkline.ar.hybrid.worlds import SupportSurface, WorldGeometry
from trunkline.errors import InputError
from trunkline.frames import STANDARD_GRAVITY
from trunkline.identification.parameters.parameters import candidate_fields, parameter_named, parameters_of
from trunkline.kinematics.panda.mounts import FixedMount, PandaRobot
from trunkline.model.arm.spiral import spiral_chain
from trunkline.model.arm_model import ArmModel

SIZE = {"length": 0.2, "base_width": 0.05, "tip_width": 0.02, "units": 6}
SECONDS, PULL = 0.6, 0.02  # s, m


@pytest.fixture(scope="module")
def small() -> mujoco.MjSpec:
    return rubbing_arm(spiral_chain(**SIZE), 3)


def way_of(arm: mujoco.MjModel, joints=None, seconds=SECONDS, let_go=None) -> CommandTrajectory:
    step = 0.01
    time = step * np.arange(round(seconds / step) + 1)
    straight = arm.tendon_length0[arm.actuator_trnid[:, 0]]
    drawn = np.clip(time / 0.3, 0, 1)[:, None] * np.array([-PULL, PULL, PULL])
    return CommandTrajectory(
        step, np.tile(np.zeros(0) if joints is None else joints, (len(time), 1)), straight + drawn, let_go
    )


@pytest.fixture(scope="module")
def free(small) -> ComposedTwin:
    return ComposedTwin(compose(small, FixedMount("fixed")).compile(), small.compile())


def doubts(arm, deviation=0.2) -> GraspUncertainty:
    return GraspUncertainty(Contact(0.0, (0.0, 0.0, 0.0)), posterior_about(arm, {"kp": deviation}))


def run(twin, way, draws):
    return joined(list(rollouts(twin, way, draws)))


def test_no_doubt_no_spread(free):
    result = preview(free, way_of(free.arm), doubts(free.arm, 0.0), count=2)
    assert np.ptp(result.nominal.tip[0], axis=0).max() > 0.01
    assert result.spread.max() < 1e-9
    np.testing.assert_allclose(result.median, result.nominal.tip[0], atol=1e-6)
    assert result.success is None
    assert result.probability is None


def test_the_same_seed_the_same_futures(free):
    first, same, other = (preview(free, way_of(free.arm), doubts(free.arm), count=3, seed=seed) for seed in (1, 1, 2))
    np.testing.assert_array_equal(first.motion.qpos, same.motion.qpos)
    assert np.abs(first.motion.tip - other.motion.tip).max() > 1e-5


def test_a_future_is_an_arm_with_its_parameters(small, free):
    """The same as an arm that had them before it was put into the model."""
    values = {"stiffness": 1.3, "damping": 0.5, "relaxation": 1.5, "kp": 0.7, "capstan_friction": 2.0, "dead_time": 0.5}
    arm = free.arm
    values = {name: factor * parameter_named(name).read(arm) for name, factor in values.items()}
    columns = {k: np.array([v]) for k, v in values.items()}
    sampled = run(free, way_of(arm), PosteriorSamples(columns, np.ones(1), np.zeros((1, 3)), np.zeros(1)))
    changed, model = copy.copy(arm), copy.copy(free.model)
    for name, field in candidate_fields(arm, {k: np.array([v]) for k, v in values.items()}).items():
        getattr(changed, name)[:] = field[0]
        getattr(model, name)[rows_of(name, model, arm)] = field[0][rows_of(name, arm, arm)]
    other = run(ComposedTwin(model, changed), way_of(arm), nominal_sample())
    np.testing.assert_allclose(sampled.tip, other.tip, atol=1e-9)
    plain = run(free, way_of(arm), nominal_sample())
    assert np.abs(sampled.tip - plain.tip).max() > 1e-3


@pytest.mark.parametrize("robot", ["fixed", "panda"])
def test_every_parameter_has_its_place_in_the_composed_model(small, robot):
    """What the arm has in the fields of its parameters, the composed model has where they are carried over to."""
    model, arm = compose(small, hybrid_settings(robot=robot).robot).compile(), small.compile()
    of_the_mount = {"body_quat"}  # which the robot holds, and so has none of its own
    for field in {field for p in parameters_of(arm).values() for field in p.fields} - of_the_mount:
        composed, alone = (
            getattr(model, field)[rows_of(field, model, arm)],
            getattr(arm, field)[rows_of(field, arm, arm)],
        )
        assert len(alone) > 0
        np.testing.assert_allclose(composed, alone, rtol=1e-12, err_msg=field)


def test_cables_motors_are_not_the_pandas(small):
    model = compose(small, hybrid_settings(robot="panda").robot).compile()
    assert [model.actuator(number).name for number in ArmModel(model).actuators] == [
        f"tendon_{number}_position" for number in (1, 2, 3)
    ]


def test_the_panda_stands_where_the_plan_says_and_follows_it(small):
    robot = hybrid_settings(robot="panda").robot
    assert isinstance(robot, PandaRobot)
    model, arm = compose(small, robot).compile(), small.compile()
    way = way_of(arm, np.array(robot.ready), 1.5)
    share = np.clip(np.arange(len(way.commands)) * way.step / 1.0, 0, 1)
    way.joints[:, 1] += 0.3 * share**3 * (10 - 15 * share + 6 * share**2)
    motion = run(ComposedTwin(model, arm), way, nominal_sample())
    planned = way.at(motion.time + model.opt.timestep)[:, :7]  # a frame's pose is the one after its step
    assert np.abs(motion.qpos[0, :, :7] - planned).max() < 1.5e-3
    assert np.abs(motion.qpos[0, -1, :7] - planned[-1]).max() < 1e-3


@pytest.fixture(scope="module")
def grasping(small) -> tuple[ComposedTwin, CommandTrajectory]:
    """A cylinder that hangs beside the arm until it is let go."""
    object = GraspObject("cylinder", 0.03, 0.1, 0.02, "plastic")
    at, level = np.array([0.035, 0.0, -0.15]), (np.sqrt(0.5), np.sqrt(0.5), 0.0, 0.0)
    world = WorldGeometry(None, {}, [0.035, 0.0, 0.0])
    spec = compose(small, FixedMount("fixed"), world, Placed(object, at, level, True))
    return ComposedTwin(spec.compile(), small.compile()), way_of(small.compile(), let_go=0.25)


def test_what_is_let_go_of_falls(grasping):
    twin, way = grasping
    motion = run(
        twin,
        CommandTrajectory(way.step, way.joints, np.tile(way.commands[0], (len(way.commands), 1)), 0.25),
        nominal_sample(),
    )
    fallen = motion.object[0, :, 2] - motion.object[0, 0, 2]
    rest = motion.time[-1] - 0.25
    assert np.abs(fallen[motion.time < 0.25]).max() < 1e-3
    assert fallen[-1] == pytest.approx(-9.80665 * rest**2 / 2, rel=0.1)
    assert not Holding(0.25).holds(motion)[0]


def test_the_objects_place_and_friction_are_each_futures_own(grasping):
    twin, way = grasping
    contact = Contact(0.5, (0.01, 0.01, 0.0), 0.2)
    result = preview(twin, way, GraspUncertainty(contact=contact), Holding(0.25), count=4)
    starts = result.motion.object[:, 0, :3]
    np.testing.assert_allclose(starts - result.nominal.object[0, 0, :3], result.samples.offsets, atol=1e-3)
    assert np.ptp(starts[:, 0]) > 5e-3
    assert np.ptp(result.samples.friction) > 0.2
    assert result.interval is not None
    assert result.probability is not None
    low, high = result.interval
    assert 0 <= low <= result.probability <= high <= 1


@pytest.fixture(scope="module")
def incline(small) -> tuple[ComposedTwin, CommandTrajectory]:
    """A box on a table, far from the arm, in a gravity so tilted that it slides if μ is less than believed."""
    object, top = GraspObject("box", 0.05, 0.03, 0.1, "plastic"), [0.0, 0.0, -0.5]
    world = WorldGeometry(None, {"table": SupportSurface(top, [2.0, 2.0, 0.03], "wood")}, None)
    spec = compose(small, FixedMount("fixed"), world, Placed(object, np.array(top) + [0, 0, 0.015]))
    model, angle = spec.compile(), np.arctan(TPU_ON["plastic"])
    model.opt.gravity[:] = STANDARD_GRAVITY * np.array([np.sin(angle), 0, -np.cos(angle)])
    return ComposedTwin(model, small.compile()), way_of(small.compile())


def test_a_future_slides_where_coulomb_says(incline):
    twin, way = incline
    holding = Holding(0.0, sag=0.005, slip=1.0)
    result = preview(twin, way, GraspUncertainty(contact=Contact(0.2, (0.0, 0.0, 0.0))), holding, count=16, seed=3)
    assert result.success is not None
    assert result.probability is not None
    clear = np.abs(np.log(result.samples.friction)) > 0.05
    assert clear.sum() > 8
    np.testing.assert_array_equal(result.success[clear], result.samples.friction[clear] > 1)
    assert 0 < result.probability < 1
    assert result.interval == pytest.approx(wilson(int(result.success.sum()), 16))


def test_what_rests_in_a_preview_creeps_far_less_than_counts_as_a_slip(incline):
    twin, way = incline
    long = CommandTrajectory(way.step, np.zeros((301, 0)), np.tile(way.commands[0], (301, 1)))
    motion = run(twin, long, PosteriorSamples({}, np.array([1.3]), np.zeros((1, 3)), np.zeros(1)))
    early, last = motion.object[0, [15, -1], 0]
    assert motion.time[-1] > 2.9
    assert abs(last - early) < 0.1 * Holding(0.0).slip


def contacts(model: mujoco.MjModel, geom: str, other: str) -> int:
    data = mujoco.MjData(model)
    mujoco.mj_forward(model, data)
    wanted = {model.geom(geom).id, model.geom(other).id}
    return sum({*data.contact[number].geom.tolist()} == wanted for number in range(data.ncon))


def test_a_unit_touches_what_hangs_in_one_point_and_a_table_bears_in_several(small):
    object = GraspObject("cylinder", 0.05, 0.03, 0.1, "plastic")
    world = WorldGeometry(None, {"table": SupportSurface([0.0, 0.0, -0.5], [2.0, 2.0, 0.03], "wood")}, None)
    model = compose(small, FixedMount("fixed"), world, Placed(object, np.array([0, 0, -0.4851]))).compile()
    hung, stands = eased(model, True), eased(model, False)
    assert contacts(hung, "object_geom", "table") == 1 < 3 <= contacts(stands, "object_geom", "table")
    assert stands.opt.impratio == hung.opt.impratio < model.opt.impratio


def test_what_stands_is_elsewhere_with_its_board(incline):
    twin, way = incline
    model = copy.copy(twin.model)
    model.opt.gravity[:] = [0, 0, -STANDARD_GRAVITY]
    contact = Contact(0.0, (0.02, 0.0, 0.02))
    result = preview(
        ComposedTwin(model, twin.arm), way, GraspUncertainty(contact=contact), Holding(0.0, sag=0.01, slip=1.0), count=4
    )
    begun = result.motion.object[:, :1, :3]
    np.testing.assert_allclose(begun[:, 0] - result.nominal.object[0, 0, :3], result.samples.offsets, atol=1e-4)
    assert np.ptp(result.samples.offsets[:, 2]) > 0.01
    assert np.abs(result.motion.object[:, :, :3] - begun).max() < 1e-3
    assert result.probability == 1.0


def test_wilsons_interval_solves_its_equation():
    """Its ends are the shares p from which what was found is 1.96 standard errors, of p, away."""
    for successes, count in ((0, 32), (7, 32), (32, 32)):
        for end in wilson(successes, count):
            assert (successes / count - end) ** 2 == pytest.approx(1.959964**2 * end * (1 - end) / count, abs=1e-9)


def test_pieces_come_one_by_one_and_are_the_whole(free):
    pieces = list(nominal(free, way_of(free.arm)))
    assert len(pieces) == 3
    times = np.concatenate([piece.time for piece in pieces])
    np.testing.assert_allclose(np.diff(times), times[1] - times[0])
    shown = []
    result = preview(free, way_of(free.arm), doubts(free.arm), count=1, show=shown.append)
    np.testing.assert_array_equal(joined(shown).qpos, result.nominal.qpos)


def test_draws_have_the_doubts_spread(small):
    arm = small.compile()
    posterior = posterior_about(arm, {"kp": 0.3, "damping": 0.1, "mount_tilt_x": 0.1}, -0.4)
    drawn = sample(GraspUncertainty(Contact(0.2, (0.01, 0.0, 0.0)), posterior), arm, 20_000, 0)
    assert list(drawn.values) == ["kp", "damping"], "the marker's tilt turns nothing here"
    logs = np.log([column / parameter_named(name).read(arm) for name, column in drawn.values.items()])
    np.testing.assert_allclose(logs.std(axis=1), [0.3, 0.1], rtol=0.03)
    assert np.corrcoef(logs)[0, 1] == pytest.approx(-0.4, abs=0.02)
    assert np.log(drawn.friction).std() == pytest.approx(0.2, rel=0.03)
    np.testing.assert_allclose(drawn.offsets.std(axis=0), [0.01, 0, 0], rtol=0.03)


def test_what_does_not_fit_is_refused(small, free):
    foreign = replace(posterior_about(free.arm, {"kp": 0.1}), names=["hysteresis"])
    with pytest.raises(InputError, match="hysteresis"):
        sample(GraspUncertainty(posterior=foreign), free.arm, 2, 0)
    way = way_of(free.arm)
    with pytest.raises(InputError, match="expected 0 and 3"):
        next(iter(nominal(free, CommandTrajectory(way.step, np.zeros((len(way.commands), 7)), way.commands))))
