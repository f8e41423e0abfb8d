"""The stand-in lab: its plant is not the model, its experiments are those promised, its settings are checked."""

import shutil
from dataclasses import replace
from pathlib import Path
from tempfile import TemporaryDirectory

import mujoco
import numpy as np
import pytest
import yaml
from scipy.spatial.transform import Rotation

from demo.experiments import (
    PLANS,
    ForTest,
    Loaded,
    MotionPlan,
    PullPlan,
    curl_trials,
    loaded_trials,
    motion_trials,
    pull_trials,
    release_trials,
    tilt_trials,
)
from demo.laboratory import Laboratory, record
from demo.plants.bench import SAMPLE_RATE
from demo.plants.cousin import Cousin, CousinSettings
from demo.record import Config
from tests.support.small_arm import small_spec
from trunkline.errors import InputError
from trunkline.model.arm.spiral import spiral_chain
from trunkline.pipeline.config import load_config

DEMO = Path(__file__).parents[2] / "demo"
UNITS = 6


def chosen(root: Path, plant: str, experiments: str) -> Config:
    """The lab's settings with another plant and other experiments. root: an empty folder."""
    (root / "conf").symlink_to(DEMO / "conf")
    (root / "params.yaml").write_text(f"record: {{seed: 7, plant: {plant}, experiments: {experiments}}}\n")
    return load_config(Config, "record", root)


with TemporaryDirectory() as folder:
    CONFIG = chosen(Path(folder), "cousin", "table")
with TemporaryDirectory() as folder:
    ALL = chosen(Path(folder), "stranger", "all")
assert isinstance(CONFIG.plant, CousinSettings)
PLANT = CONFIG.plant
SHORT = replace(
    CONFIG.experiments, tilts=[0.0, 90.0], tilt_repeats=1, settle=0.05, rest_duration=0.05,
    release_directions=[0.0, 90.0], bend_duration=0.05, bend_settle=0.02, hold_duration=0.033, release_duration=0.1,
    curl_levels=[20.0], curl_tendons=[[1]], curl_rest=0.0515, curl_ramp=0.1, curl_hold=0.05,
    test=ForTest(tilts=[45.0], release_directions=[60.0], curl_levels=[30.0], curl_tendons=[[3]]),
)  # fmt: skip


def arm(units, seed):
    a = CONFIG.arm
    chain = spiral_chain(a.length, a.base_width, a.tip_width, units)
    return Cousin(chain, PLANT, a.tendons, np.random.default_rng(seed))


def session(seed, plan=SHORT):
    return record(arm(UNITS, seed), plan, [1, 3, 5], *np.random.default_rng(seed).spawn(2))


def test_a_seed_is_one_session_and_another_seed_is_another():
    first, again, other = session(1), session(1), session(2)
    names = ["tilt_000_a", "tilt_090_a", "release_000", "release_090", "curl_1_020"]
    assert [truth.name for truth in first] == [*names, "tilt_045_a", "release_060", "curl_3_030"]
    assert [truth.split == "test" for truth in first] == [False] * 5 + [True] * 3
    for a, b, c in zip(first, again, other, strict=True):
        np.testing.assert_array_equal(a.positions, b.positions)
        np.testing.assert_array_equal(a.base_quaternion, b.base_quaternion)
        np.testing.assert_array_equal(a.tendon_positions, b.tendon_positions)
        assert np.abs(a.positions[-1] - c.positions[-1]).max() > 1e-6, a.name
    assert np.abs(first[0].base_quaternion - other[0].base_quaternion).max() > 1e-4


def test_the_test_split_changes_no_other_trial():
    more = replace(SHORT.test, tilts=[20.0, 45.0], release_directions=[60.0, 200.0])
    for trial, other in zip(session(1)[:5], session(1, replace(SHORT, test=more)), strict=False):
        for key, value in vars(trial).items():
            np.testing.assert_array_equal(value, getattr(other, key), err_msg=key)


def test_nothing_of_the_test_split_is_done_in_another():
    for tests, kinds in ((CONFIG.experiments, ["static_tilt", "release", "curl"]), (ALL.experiments, PLANS)):
        for plan in (tests, tests.tested()):
            assert {trial.experiment for _, trials in PLANS.values() for trial in trials(plan)} == set(kinds)
        for key in ("tilts", "release_directions", "curl_levels", "curl_tendons", "motions"):
            for value in getattr(tests.test, key):
                assert value not in getattr(tests, key), key
    pulled = [pull.levels for pull in ALL.experiments.pulls]
    for pull in ALL.experiments.test.pulls:
        assert pull.levels not in pulled
        levels = {level for other in pulled for level in other if level is not None}
        assert not levels & {level for level in pull.levels if level is not None}
    loaded = [(trial.level, trial.load) for trial in loaded_trials(ALL.experiments)]
    assert not {(trial.level, trial.load) for trial in loaded_trials(ALL.experiments.tested())} & set(loaded)


def test_every_array_of_a_trial_is_on_its_clock():
    """Also where a duration is not a whole number of samples, as the session's are not."""
    for truth in session(1):
        assert len(truth.time) == len(truth.positions) == len(truth.quaternions) == len(truth.tendon_positions)
        assert len(truth.command_time) == len(truth.commands)


def test_motors_lag_behind_their_commands():
    curl = session(1)[4]
    command, wound = curl.commands[:, 0], curl.tendon_positions[:, 0]
    late = round(PLANT.motors.command_delay * SAMPLE_RATE)
    rising = np.flatnonzero(command > 0)[0]
    np.testing.assert_allclose(wound[: rising + late - 1], 0, atol=1e-12)
    assert wound.max() == pytest.approx(0.020, rel=1e-6)
    assert np.diff(wound).max() * SAMPLE_RATE <= PLANT.motors.rate_limit + 1e-9


def test_the_plant_is_not_the_model():
    plant, model = arm(UNITS, 1).model, small_spec(UNITS).compile()
    assert plant.nv == 2 * model.nv
    assert plant.opt.integrator != model.opt.integrator
    assert plant.opt.timestep != model.opt.timestep
    identified = yaml.safe_load((DEMO.parent / "params.yaml").read_text())["build_mjcf"]["solver"]["timestep"]
    assert plant.opt.timestep != identified
    assert (plant.jnt_stiffnesspoly[:, 1] > 0).all(), "joints harden"
    assert (plant.dof_frictionloss > 0).all(), "joints have dry friction"


def test_masses_and_stiffnesses_are_off_by_what_the_settings_say():
    exact = replace(PLANT, mass_factor=1.0, stiffness_scatter=0.0)
    a = CONFIG.arm
    chain = spiral_chain(a.length, a.base_width, a.tip_width, a.units)
    reference = Cousin(chain, exact, a.tendons, np.random.default_rng(0)).model
    plant = arm(a.units, 3).model
    assert mujoco.mj_getTotalmass(plant) == pytest.approx(1.05 * mujoco.mj_getTotalmass(reference))
    ratio = plant.jnt_stiffness / reference.jnt_stiffness - 1
    assert 0.05 < np.abs(ratio).max() <= 0.08
    assert np.std(ratio) == pytest.approx(0.08 / np.sqrt(3), rel=0.4)


def test_every_imperfection_of_the_lab_is_there():
    plant, motors, lab = PLANT, PLANT.motors, CONFIG.instruments
    assert (plant.stiffness_scatter, abs(plant.mass_factor - 1)) == (0.08, pytest.approx(0.05))
    assert min(plant.hardening, plant.dry_friction, motors.rate_limit, motors.command_delay) > 0
    assert (lab.position_noise_mm, lab.orientation_noise_deg) == (0.3, 0.3)
    assert lab.occlusion_ms == (50.0, 300.0)
    assert min(lab.occlusions_per_s, lab.dropped_frames, lab.outliers, lab.stamp_jitter_ms) > 0
    assert min(lab.outlier_mm, lab.outlier_deg, lab.delivery_ms, lab.tendon_noise_mm) > 0
    assert abs(lab.clock_offset_s) > 0
    assert abs(lab.up[2]) < 1, "the cameras' frame is not z-up"


def test_the_experiments_are_those_of_the_table():
    tests = CONFIG.experiments
    assert tests.tilts == [0.0, 30.0, 60.0, 90.0]
    assert len(tests.release_directions) >= 4
    assert tests.curl_levels == [20.0, 40.0, 60.0, 80.0, 100.0]
    assert len(CONFIG.arm.tracked) == 18
    for begin in (tests.hold_duration, tests.curl_rest):
        frames = begin * CONFIG.instruments.frame_rate
        assert 0.2 < frames % 1 < 0.8, "nothing begins on a frame"


def test_a_quarter_of_each_experiment_is_for_validation():
    tests = CONFIG.experiments
    tilts, releases, curls = tilt_trials(tests), release_trials(tests), curl_trials(tests)
    validation = [[trial for trial in trials if trial.split == "validate"] for trials in (tilts, releases, curls)]
    assert [len(trials) for trials in (tilts, releases, curls)] == [16, 12, 15]
    assert [len(trials) for trials in validation] == [4, 3, 4]
    assert {trial.level for trial in validation[0]} == set(tests.tilts)
    levels = {trial.level for trial in validation[2]}
    assert len(levels) == 4
    assert 100.0 in levels
    assert {trial.level for trial in curls if trial.split == "identify"} == set(tests.curl_levels)
    groups = {trial.name.rsplit("_", 1)[0] for trial in validation[2]}
    assert groups == {"curl_1", "curl_2_3", "curl_2"}


def test_the_arm_is_fully_bent_when_it_is_let_go():
    """The whole arm turns by 270° or more; here with the weakest of the pulls."""
    tests = replace(
        CONFIG.experiments, release_directions=[0.0], release_factors=CONFIG.experiments.release_factors[:1],
        release_duration=0.05,
    )  # fmt: skip
    assert CONFIG.experiments.release_factors[0] == min(CONFIG.experiments.release_factors)
    tracked = [number - 1 for number in CONFIG.arm.tracked]
    (truth,) = Laboratory(arm(CONFIG.arm.units, 7), tests.mount_position, tracked).releases(tests)
    bent = np.vstack([truth.base_quaternion, truth.quaternions[round(tests.hold_duration * SAMPLE_RATE) - 1]])
    turns = Rotation.from_quat(bent, scalar_first=True)
    bends = (turns[:-1].inv() * turns[1:]).as_rotvec()  # all about +-y: they add up
    assert np.degrees(np.abs(bends.sum(axis=0)[1])) >= 270


def test_beyond_the_table_there_are_loads_pulls_and_motions():
    tests = ALL.experiments
    for trials, counts in ((pull_trials, (15, 5, 4)), (motion_trials, (4, 2, 2)), (loaded_trials, (3, 0, 3))):
        splits = [trial.split for trial in trials(tests)]
        assert (splits.count("identify"), splits.count("validate"), len(trials(tests.tested()))) == counts
    levels = [np.array([np.nan if level is None else level for level in pull.levels]) for pull in tests.pulls]
    assert {np.isfinite(level).sum() for level in levels} == {1, 2, 3}
    for pulls in (tests.pulls, tests.test.pulls):
        assert {pull.from_beyond for pull in pulls} == {True, False}
    assert max(np.nanmax(level) for level in levels) <= 60
    table = replace(tests, settle=CONFIG.experiments.settle, steady_factor=CONFIG.experiments.steady_factor)
    for trials in (tilt_trials, release_trials, curl_trials):
        assert trials(table) == trials(CONFIG.experiments)
        assert trials(table.tested()) == trials(CONFIG.experiments.tested())


def test_more_experiments_change_no_trial_of_the_table():
    """With either of them the cousin does them: pulled, moved, and with a load at its tip."""
    more = replace(
        SHORT, loads=[Loaded(0.05, [90.0], [0.0])], pulls=[PullPlan([20.0, None, -5.0], True)], pull_ramp=0.1,
        pull_turn=0.02, pull_back=0.05, pull_settle=0.1, motions=[MotionPlan([1.0, 2.5], 10.0, -2.0)], motion_rest=0.05,
        motion_fade=0.1, motion_duration=0.3,
    )  # fmt: skip
    extended = session(1, more)
    for trial, other in zip(session(1), extended, strict=False):
        for key, value in vars(trial).items():
            np.testing.assert_array_equal(value, getattr(other, key), err_msg=key)
    loaded_tilt, loaded_release, pull, motion = extended[8:]
    names = ["tilt_090_a_50g", "release_000_50g", "pull_20_x_m5_back", "motion_25_10_m2"]
    assert [truth.name for truth in extended[8:]] == names
    assert loaded_tilt.load == loaded_release.load == 0.05
    assert np.abs(loaded_release.positions[-1] - extended[2].positions[-1]).max() > 1e-4
    resting = pull.commands[pull.command_time >= 0]
    np.testing.assert_allclose(resting, np.tile([0.02, -0.3, -0.005], (len(pull.time), 1)))
    assert pull.commands[:, 0].max() == pytest.approx(0.02 * SHORT.pull_beyond), "the way there is in the log too"
    assert len(pull.time) == round(SHORT.rest_duration * SAMPLE_RATE)
    start = motion.commands[motion.command_time < motion.begin]
    np.testing.assert_array_equal(start, np.full_like(start, -0.002))
    assert np.ptp(motion.commands, axis=0).min() > 0.003


@pytest.mark.parametrize(
    ("key", "value", "message"),
    [
        ("experiments.validate_every", 1, "found 1, expected 2 to 1000"),
        ("experiments.validate_every", 50, "validate_every: found 50, expected trials of .* in the splits "),
        ("experiments.tilt_repeats", 0, "found 0"),
        ("experiments.curl_hold", 0.0, "curl_hold: found 0.0"),
        ("experiments.curl_levels", [20.0, -40.0], "curl_levels.1: found -40.0"),
        ("experiments.curl_levels", [20.0, 20.3], "experiments.curl_levels: found 'curl_1_020' twice"),
        ("experiments.curl_tendons", [[1], [4]], r"experiments.curl_tendons: found \[4\], expected .* from 1 to 3"),
        ("experiments.release_directions", [0.0, 360.0], "release_directions.1: found 360.0"),
        ("plant.kind", "uncle", "cousin.yaml: record.plant: kind: found 'uncle', expected one of"),
        ("plant.modulus", 0.0, "modulus: found 0.0"),
        ("plant.motors", {"rate_limit": -1.0, "command_delay": 0.0}, "rate_limit: found -1.0"),
        ("experiments.pulls", [{"levels": [1.0], "from_beyond": False}], r"pulls: found \[1.0\], expected a level"),
        ("experiments.pulls", [{"levels": [1.0, 1.0, 1.0], "from_beyond": True}], "validate_every: found 4, expected"),
        ("experiments.loads", [{"load": 30.0, "tilts": [], "release_directions": []}], "loads.0.load: found 30.0"),
        ("arm.tracked", [1, 25], r"arm.tracked: found \[1, 25\], expected distinct units from 1 to 24"),
        ("arm.tracked", [1, 1], "arm.tracked: found .* expected distinct"),
        ("instruments.dropped_frames", 1.5, "dropped_frames: found 1.5"),
        ("instruments.occlusion_ms", [300.0, 50.0], "occlusion_ms: found .* expected the shortest first"),
        ("instruments.frame_rat", 120.0, "unknown key, did you mean 'frame_rate'"),
    ],
)
def test_a_mistake_in_the_settings_is_one_line(tmp_path, key, value, message):
    shutil.copytree(DEMO / "conf", tmp_path / "conf")
    (tmp_path / "params.yaml").write_text("record: {seed: 7, plant: cousin, experiments: table}\n")
    group, name = key.split(".")
    files = {"plant": "plant/cousin.yaml", "experiments": "experiments/table.yaml"}
    file = tmp_path / "conf/record" / files.get(group, "config.yaml")
    config = yaml.safe_load(file.read_text())
    (config if group in files else config[group])[name] = value
    file.write_text(yaml.safe_dump(config))
    with pytest.raises(InputError, match=message):
        load_config(Config, "record", tmp_path)
