"""The start of a trial and its simulation, against plain MuJoCo."""

from types import SimpleNamespace

import mujoco
import numpy as np
import pytest

from tests.support.matched_plant import curl, markers_of, mjcf_of, motion, release, small_model, tilt
from tests.support.noisy_trials import with_values
from tests.support.small_arm import small_spec
from trunkline.errors import InputError
from trunkline.identification.evaluation.evaluation import replay
from trunkline.identification.parameters.parameters import candidate_fields
from trunkline.identification.simulate.experiment import prepare
from trunkline.identification.simulate.in_motion import InMotion
from trunkline.identification.simulate.loss import position_error
from trunkline.identification.simulate.population import Population
from trunkline.identification.simulate.pose_fit import fit_pose
from trunkline.model.arm.joints import JenkinsElement, Joints, MaxwellElement, add_elements
from trunkline.model.arm_model import ArmModel


def seen_at(model, qpos, markers):
    data = mujoco.MjData(model)
    data.qpos[:] = qpos
    mujoco.mj_kinematics(model, data)
    sites = [model.site(f"{s}_center").id for s in markers]
    return data.site_xpos[sites], [data.site_xmat[s].reshape(3, 3) for s in sites]


@pytest.mark.parametrize("with_orientations", [True, False])
def test_pose_fit_finds_a_coil_of_more_than_a_turn(with_orientations):
    model = small_model(units=16)
    markers = tuple(f"unit_{i:02d}" for i in (*range(1, 9), 10, 12, 14, 16))
    bend = np.linspace(0.2, 0.6, 16)
    qpos = np.stack([0.4 * bend, bend], axis=1).ravel()  # 6.9 rad in all
    positions, matrices = seen_at(model, qpos, markers)
    quaternions = np.empty((len(markers), 4))
    for quaternion, matrix in zip(quaternions, matrices, strict=True):
        mujoco.mju_mat2Quat(quaternion, matrix.ravel())
    fit = fit_pose(model, markers, positions, quaternions if with_orientations else None)
    assert fit.converged
    assert fit.residuals.max() < 1e-3
    assert np.abs(seen_at(model, fit.qpos, ["unit_16"])[0] - seen_at(model, qpos, ["unit_16"])[0]).max() < 1e-3


def test_a_pose_is_fitted_where_a_body_was_not_visible():
    """It has no attitude either: NaN, as in trials whose every frame is a pose of its own."""
    model = small_model(units=4)
    markers = ("unit_01", "unit_02", "unit_04")
    positions, matrices = seen_at(model, np.full(8, 0.2), markers)
    quaternions = np.empty((3, 4))
    for quaternion, matrix in zip(quaternions, matrices, strict=True):
        mujoco.mju_mat2Quat(quaternion, matrix.ravel())
    positions[1], quaternions[1] = np.nan, np.nan
    fit = fit_pose(model, markers, positions, quaternions)
    assert fit.residuals[[0, 2]].max() < 1e-3


@pytest.mark.parametrize("in_motion", [True, False])
def test_an_arm_that_moves_already_starts_with_its_velocity(in_motion):
    model = small_model()
    trial = release(model, 0.25, frames=90)
    trial.start, trial.in_motion = float(trial.time[20]), in_motion
    experiment = prepare(trial, model, 437)
    itself = {"jnt_stiffness": model.jnt_stiffness[None]}
    simulated = Population(model, [experiment], markers_of(model)).simulate(itself)
    error = position_error(simulated.positions[0][0], experiment.positions, experiment.measured)
    assert len(experiment.positions) == 69
    assert (error < 1e-3) if in_motion else (error > 4e-3)


def test_an_arm_of_another_mass_moves_as_one_that_was_compiled_with_it():
    """Also where cables rub: friction is softened by what MuJoCo makes of masses as it compiles."""
    model, masses = small_model(4), np.array([0.4, 1.5])
    fields = candidate_fields(model, {"mass": masses})
    compiled = mujoco.MjModel.from_xml_string(mjcf_of(with_values(model, {"mass": masses[1]})))
    markers = markers_of(model)
    experiments = [prepare(trial, model, 40) for trial in (tilt(model, 60), release(model, 0.25), curl(model, 40))]
    ours = Population(model, experiments, markers).simulate(fields).positions
    theirs = Population(compiled, experiments, markers).simulate({"jnt_stiffness": compiled.jnt_stiffness[None]})
    for our, their in zip(ours, theirs.positions, strict=True):
        np.testing.assert_allclose(our[1], their[0], atol=2e-6)  # an MJCF keeps six digits
        assert np.abs(our[1] - our[0]).max() > 1e-3


def test_a_population_of_the_truth_replays_the_truth():
    model = small_model()
    trials = [tilt(model, 60), release(model, 0.25, frames=60), curl(model, 40, frames=90)]
    experiments = [prepare(trial, model, 437) for trial in trials]
    fields = candidate_fields(model, {"stiffness": model.jnt_stiffness[:1] * [1.0, 1.2]})
    simulated = Population(model, experiments, markers_of(model)).simulate(fields)
    for positions, experiment in zip(simulated.positions, experiments, strict=True):
        truth, other = (position_error(p, experiment.positions, experiment.measured) for p in positions)
        assert truth < 0.4e-3  # starts are fitted, and a static shape settles for a finite time
        assert other > 3 * truth


def test_a_start_between_two_frames_is_where_it_was():
    """A release 40 % of a frame late: the simulation leads in by the rest of that frame."""
    model = small_model()
    trial = release(model, 0.25, frames=60)
    fine = release(model, 0.25, frames=60, substep=0.4)  # its frames are 0.4 of a frame after those of `trial`
    still = trial.positions[:1].repeat(6, axis=0)
    fine.positions = np.concatenate([still, fine.positions])
    fine.quaternions = np.concatenate([trial.quaternions[:1].repeat(6, axis=0), fine.quaternions])
    fine.measured = np.ones(fine.positions.shape[:2], bool)
    fine.commands = fine.commands[:1].repeat(66, axis=0)
    fine.time = np.arange(66) / 120
    fine.start = (6 - 0.4) / 120
    experiment = prepare(fine, model, 60)
    assert experiment.lead == pytest.approx(0.4 / 120)
    simulated = Population(model, [experiment], markers_of(model)).simulate(
        candidate_fields(model, {"stiffness": model.jnt_stiffness[:1]})
    )
    assert position_error(simulated.positions[0][0], experiment.positions, experiment.measured) < 0.3e-3


def test_a_static_shape_does_not_depend_on_where_it_starts():
    model = small_model()
    experiment = prepare(tilt(model, 60), model, 1)
    fields = candidate_fields(model, {"stiffness": model.jnt_stiffness[:1] * [0.7, 1.0, 3.0]})
    shapes = []
    for start in (experiment.start, np.zeros(model.nq)):
        experiment.start = start
        shapes.append(Population(model, [experiment], markers_of(model)).simulate(fields).positions[0])
    np.testing.assert_allclose(*shapes, atol=0.1e-3)


def test_a_static_shape_that_leans_on_joint_limits_does_not_depend_on_the_step():
    """Limits of 4 ms: MuJoCo would soften them at the step that does for others."""
    model = small_model()
    model.jnt_range[:] = [-0.05, 0.05]
    model.jnt_solref[:, 0] = 0.004
    experiment = prepare(tilt(model, 60), model, 1)
    fields = candidate_fields(model, {"stiffness": model.jnt_stiffness[:1] * 0.3})
    populations = [Population(model, [experiment], markers_of(model), factor) for factor in (1, 0.25)]
    standard, fine = (population.simulate(fields).positions[0] for population in populations)
    np.testing.assert_allclose(standard, fine, atol=5e-6)


def test_a_start_that_nobody_saw_is_refused_by_name():
    model = small_model()
    trial = release(model, 0.2, frames=20)
    trial.measured[:5] = False
    with pytest.raises(InputError, match="release_0.20_identify: found 0 of 6 markers"):
        prepare(trial, model, 20)


def test_simulation_does_not_depend_on_threads(monkeypatch):
    model = small_model()
    experiments = [prepare(release(model, 0.25, frames=20), model, 20)]
    fields = candidate_fields(model, {"damping": np.array([0.01, 0.02, 0.05])})
    results = []
    for threads in ("1", "2"):
        monkeypatch.setenv("TRUNKLINE_THREADS", threads)
        results.append(Population(model, experiments, markers_of(model)).simulate(fields).positions[0])
    np.testing.assert_array_equal(*results)


def test_a_population_of_another_size_and_a_second_call_are_as_the_first():
    model = small_model()
    experiments = [prepare(release(model, 0.25, frames=20), model, 20), prepare(tilt(model, 30), model, 1)]
    population = Population(model, experiments, markers_of(model))
    values = np.array([0.01, 0.02, 0.05])
    first = population.simulate(candidate_fields(model, {"damping": values})).positions
    single = population.simulate(candidate_fields(model, {"damping": values[1:2]})).positions
    again = population.simulate(candidate_fields(model, {"damping": values})).positions
    for a, b, c in zip(first, single, again, strict=True):
        np.testing.assert_array_equal(a[1], b[0])
        np.testing.assert_array_equal(a, c)


def test_a_simulation_that_made_mujoco_warn_counts_as_diverged(monkeypatch, tmp_path):
    """A command that is not a number: MuJoCo warns, puts 0 in its place, and what follows looks like any motion."""
    monkeypatch.chdir(tmp_path)  # MuJoCo writes its log there
    model = small_model()
    experiments = [prepare(curl(model, 40, frames=10), model, 10), prepare(release(model, 0.2, frames=10), model, 10)]
    experiments[0].controls[5, 0] = np.nan
    data = mujoco.MjData(model)
    data.ctrl[0] = np.nan
    mujoco.mj_step(model, data, 40)
    assert np.isfinite(data.site_xpos).all()
    assert sum(warning.number for warning in data.warning)
    fields = candidate_fields(model, {"damping": np.array([0.02, 0.03])})
    simulated = Population(model, experiments, markers_of(model)).simulate(fields)
    assert simulated.diverged.all()
    assert not np.isfinite(simulated.positions[0]).any()
    assert np.isfinite(simulated.positions[1]).all()


def test_winches_wind_a_trial_s_commands_as_step_by_step():
    """Each candidate with its own, in a curl that is too fast for them and turns round."""
    model = small_model(4, rate_limit=0.15, backlash=3e-3)
    experiments = [prepare(t, model, 437) for t in (curl(model, 40, frames=100), motion(model, 20, frames=60))]
    fields = candidate_fields(model, {"rate_limit": np.array([0.15, 0.3]), "backlash": np.array([3e-3, 1e-3])})
    simulated = Population(model, experiments, markers_of(model)).simulate(fields)
    for positions, experiment in zip(simulated.positions, experiments, strict=True):
        truth, other = (position_error(p, experiment.positions, experiment.measured) for p in positions)
        assert truth < 1e-6
        assert other > 3e-4


@pytest.mark.parametrize("lag", [0, 3])
def test_a_command_delay_shifts_what_drives_a_trial(lag):
    """Commands logged `lag` frames before the motors act on them: with that delay the plant is replayed exactly."""
    model, frame = small_model(), 1 / 120
    trial = curl(model, 40, frames=60)
    trial.commands = np.concatenate([trial.commands[lag:], trial.commands[-1:].repeat(lag, axis=0)])
    errors = {}
    for delay in (0, 3):
        experiment = prepare(trial, model, 60, command_delay=delay * frame)
        positions = replay(model, [experiment], markers_of(model)).positions[0]
        errors[delay] = position_error(positions, experiment.positions, experiment.measured)
    assert errors[lag] < 1e-9
    assert errors[3 - lag] > 1e-3


def test_trials_of_another_arm_are_refused():
    model = small_model()
    trial = release(model, 0.2, frames=5)
    for name in ("unit_99", "tip", "base"):
        trial.markers = (*trial.markers[:-1], name)
        with pytest.raises(InputError, match=f"markers: trial release.*'{name}', expected.*unit_01, .*, unit_06"):
            prepare(trial, model, 5)
    trial = curl(model, 20, frames=5)
    trial.tendons = ("tendon_1", "tendon_2", "cable")
    with pytest.raises(InputError, match="tendons: trial curl.*'cable', expected.*tendon_1, tendon_2, tendon_3"):
        prepare(trial, model, 5)


def test_what_joints_remember_begins_as_the_hand_left_it():
    """A branch has given way entirely; a slider has slipped by what is beyond its yield."""
    spec = small_spec()
    add_elements(spec, Joints([MaxwellElement(0.3, 0.5)], [JenkinsElement(0.2, 0.02)]), 1e-5)
    model = spec.compile()
    start = np.tile([0.1, -0.01], 8)
    experiment = SimpleNamespace(
        lead=0.01, frame_step=0.01,
        kind="release", frames=1, gravity=np.zeros(3), start=start, velocity=0 * start, load=0.0,
        controls=np.zeros((1, 3)),
    )  # fmt: skip
    moving = InMotion(model, {0: experiment}, False, np.zeros(0, int), 1.0)
    batch = moving._batch({"jnt_stiffness": model.jnt_stiffness[None]}, [0])
    branch, slider = ArmModel(model).branches[0], ArmModel(model).sliders[0]
    np.testing.assert_allclose(batch.bind("qpos")[0, branch.branch], start)
    places = model.tendon_plasticadr[slider.tendon]
    np.testing.assert_allclose(batch.bind("plastic")[0, places], np.tile([0.08, 0.0], 8), atol=1e-12)
