"""A whole identification stage on a plant that is the model: files, keys, recovery, threads."""

import json
from dataclasses import replace

import mujoco
import numpy as np
import pytest

from tests.support.folders import TABLE_OF_NOTHING
from tests.support.matched_plant import begin_project, curl, release, tilt
from tests.support.noisy_trials import with_values
from trunkline.errors import InputError
from trunkline.identification.fit.fit import CoarseSearch, Refinement
from trunkline.identification.fit.optimizers import DifferentialEvolution, LeastSquares
from trunkline.identification.fit.problem import Bounds
from trunkline.identification.fit.settings import IdentificationSettings
from trunkline.identification.parameters.parameters import PARAMETERS
from trunkline.identification.parameters.tolerances import Tolerances
from trunkline.identification.simulate.loss import Loss
from trunkline.pipeline.identify import CAD_MODEL, read_reported, run
from trunkline.recordings.trials.splits import DECIDING
from trunkline.recordings.trials.trial import write_trials

LOSS = Loss(
    kind="positions", delta_position=0.2, delta_velocity=2.0, epsilon=0.02, epsilon_velocity=0.002,
    weight_position=1.0, weight_velocity=0.03,
)  # fmt: skip


def settings(experiments, reported, parameters, per_joint=(), iterations=8, **changed) -> IdentificationSettings:
    return IdentificationSettings(**{
        "seed": 1, "frames": 437, "rest_shape": "unchanged", "markers": "unchanged", "command_delay": 0.0,
        "experiments": experiments, "reported": reported, "loss": LOSS,
        "parameters": {name: Bounds(low=low, high=high) for name, (low, high) in parameters.items()},
        "optimizer": LeastSquares(starts=4, descents=1, iterations=4, tolerance=1e-3),
        "rough": CoarseSearch(step_factor=1.0, frames=437, trials=99),
        "polish": Refinement(iterations=iterations, tolerance=1e-8),
        "per_joint": list(per_joint), "per_joint_range": 0.1, "per_joint_deviation": 1.0,
        "fine": LeastSquares(starts=0, descents=1, iterations=3, tolerance=1e-2),
        "cross_validation_folds": 0,
    } | changed)  # fmt: skip


def truth_of(model: mujoco.MjModel, **scales: float) -> mujoco.MjModel:
    return with_values(model, {name: scale * PARAMETERS[name].read(model) for name, scale in scales.items()})


@pytest.fixture
def project(tmp_path, monkeypatch):
    """A folder with a model and none of the trials yet; returns the model and a function that writes trials."""
    monkeypatch.chdir(tmp_path)
    model = begin_project(tmp_path, 6)
    return tmp_path, model, lambda trials: write_trials(tmp_path / "data/processed/filter", trials)


def metrics_of(root, stage):
    return json.loads((root / "artifacts" / stage / "metrics.json").read_text())


def test_stiffness_stage_on_one_thread_and_on_two(project, monkeypatch):
    root, model, write = project
    truth = truth_of(model, stiffness=0.7)
    write([tilt(truth, angle, noise=1e-4) for angle in (30, 60, 90)] + [tilt(truth, 75, "validate")])
    middle = PARAMETERS["stiffness"].read(model)
    config = settings(
        ["static_tilt"], ["static_tilt"], {"stiffness": (0.5 * middle, 2 * middle)}, ["stiffness"]
    )
    files = {}
    for threads in ("1", "2"):
        monkeypatch.setenv("TRUNKLINE_THREADS", threads)
        run("identify_stiffness", config, CAD_MODEL)
        folder = root / "artifacts/identify_stiffness"
        files[threads] = {p.name: p.read_bytes() for p in folder.iterdir()}
    assert files["1"] == files["2"]
    assert {"arm.xml", "parameters.json", "metrics.json", "shapes.png", "convergence.csv"} <= set(files["1"])
    metrics = metrics_of(root, "identify_stiffness")
    for model_name in ("initial", "coarse", "identified"):
        for split in ("identify", "validate"):
            keys = {"loss", "e_internal_mm", "e_internal_pct", "e_position_mm"}
            assert keys <= set(metrics[model_name][split])
    assert metrics["identified"]["validate"]["e_position_mm"] < 0.1 * metrics["initial"]["validate"]["e_position_mm"]
    assert metrics["evaluations"] > 20
    assert metrics["diverged"] == metrics["start_fit"]["unconverged"] == 0
    written = mujoco.MjModel.from_xml_path(str(root / "artifacts/identify_stiffness/arm.xml"))
    np.testing.assert_allclose(written.jnt_stiffness[:4] / truth.jnt_stiffness[:4], 1, atol=0.03)


def test_control_stage_finds_the_actuators_and_scores_the_cad_model(project):
    root, model, write = project
    truth = truth_of(model, kp=0.1, kv=0.3, force_range=0.02, time_constant=1.2)
    trials = [curl(truth, level, tendon=k, frames=110) for level, k in ((30, 0), (60, 1), (90, 2))]
    write([*trials, curl(truth, 50, "validate", frames=110), release(truth, 0.2, "validate", frames=30)])
    ranges = {name: (0.2 * value, 5 * value) for name, value in
              {n: PARAMETERS[n].read(truth) for n in ("kp", "kv", "force_range", "time_constant")}.items()}  # fmt: skip
    evolution = DifferentialEvolution(
        method="differential_evolution", population=6, population_per_parameter=1, generations=6, tolerance=1e-2
    )
    config = settings(["curl"], ["release", "curl"], ranges, iterations=25, optimizer=evolution)
    (root / "artifacts/identify_damping").mkdir()
    (root / "artifacts/identify_damping/parameters.json").write_text(json.dumps(TABLE_OF_NOTHING))
    run("identify_control", config, root / "artifacts/build_mjcf/arm.xml", whole=("identify_damping",))
    metrics = metrics_of(root, "identify_control")
    assert metrics["cad"]["validate"]["e_internal_mm"] == metrics["initial"]["validate"]["e_internal_mm"]
    assert set(metrics["identified"]["validate"]["by_experiment"]) == {"release", "curl"}
    halved = metrics["halved_step"]
    assert 0 < halved["max_mm"] < 1.0
    assert halved["validate"] * metrics["identified"]["validate"]["e_internal_mm"] < 0.02  # a share of next to nothing
    rows = json.loads((root / "artifacts/identify_control/parameters.json").read_text())["parameters"]
    for name, tolerance in (("kp", 0.05), ("kv", 0.10), ("time_constant", 0.10), ("force_range", 0.10)):
        assert rows[name]["value"] == pytest.approx(PARAMETERS[name].read(truth), rel=tolerance), name
    assert (root / "artifacts/identify_control/errors.png").stat().st_size > 10_000


def exchanged(trial):
    columns = [1, 0, 2]
    return replace(trial, commands=trial.commands[:, columns], tendon_positions=trial.tendon_positions[:, columns])


@pytest.mark.parametrize(
    ("trials_of", "changes", "message"),
    [
        (lambda model: [tilt(model, 30), tilt(model, 60)], {}, "no static_tilt trial with split validate"),
        (
            lambda model: [tilt(model, 30), tilt(model, 60), replace(tilt(model, 75, "validate"), load=0.05)],
            {"parameters": {"stiffness": Bounds(0.3, 12.0), "mass": Bounds(0.05, 5.0)}},
            "^identify_stiffness.parameters.mass: found no static_tilt with split identify that carries a load, "
            "expected one with its `load`",
        ),
        (
            lambda model: [tilt(model, 30), tilt(model, 60), tilt(model, 75, "validate")],
            {"cross_validation_folds": 3},
            "cross_validation_folds: found 3, expected at most 2",
        ),
        (
            lambda model: [tilt(model, 30), tilt(model, 75, "validate"), exchanged(curl(model, 40, frames=60))],
            {"markers": "measured"},
            "session.yaml: tendons: trial curl_40_0_identify: found 'tendon_2' wound",
        ),
        (
            lambda model: [replace(trial, markers=("link_1", *trial.markers[1:]))
                           for trial in (tilt(model, 30), tilt(model, 75, "validate"))],
            {"markers": "measured"},  # it is named before they are looked for
            "session.yaml: markers: trial tilt_30_identify: found 'link_1', .*unit_01",
        ),
    ],
    ids=["no split", "mass without load", "folds", "exchanged tendons", "unknown marker"],
)  # fmt: skip
def test_what_cannot_be_fitted_is_refused_before_any_fit(project, trials_of, changes, message):
    root, model, write = project
    write(trials_of(model))
    config = settings(["static_tilt"], ["static_tilt"], {"stiffness": (0.3, 12.0)})
    with pytest.raises(InputError, match=message):
        run("identify_stiffness", replace(config, **changes), CAD_MODEL)
    assert not (root / "artifacts/identify_stiffness").exists()


@pytest.mark.parametrize(
    ("experiments", "way_out"),
    [
        (["static_tilt", "static_pull"], "static_pull .* under identify_stiffness, and no `kp` or `capstan_friction`"),
        (["release"], "no release trial with split identify, expected at least one$"),
        (["curl", "motion"], "`experiments: [curl]` under identify_control: data/raw/README.md"),
    ],
)
def test_what_to_set_without_an_experiment_is_said(project, experiments, way_out):
    _, model, write = project
    write([made for split in DECIDING for made in (tilt(model, 30, split), curl(model, 40, split, frames=30))])
    with pytest.raises(InputError, match=way_out.replace("[", r"\[").replace("]", r"\]")):
        read_reported(settings(experiments, experiments, {"stiffness": (0.3, 12.0)}))


def test_a_missing_model_is_named(project):
    root, _, _ = project
    config = settings(["static_tilt"], ["static_tilt"], {"stiffness": (0.3, 12.0)})
    with pytest.raises(InputError, match="nowhere.xml: no such file"):
        run("identify_stiffness", config, root / "nowhere.xml")


def test_a_mass_beside_a_measured_rest_shape_is_refused():
    """What springs bear in it follows from the masses that are described."""
    with pytest.raises(ValueError, match="parameters.mass: found it beside rest_shape: measured, expected one"):
        settings(["release"], ["release"], {"mass": (0.05, 5.0)}, rest_shape="measured")


def test_tendon_parameters_of_an_arm_without_tendons_are_refused(project):
    root, _, _ = project
    spec = mujoco.MjSpec.from_file(str(root / "artifacts/build_mjcf/arm.xml"))
    for element in (*spec.actuators, *spec.tendons):
        spec.delete(element)
    (root / "artifacts/build_mjcf/arm.xml").write_text(spec.to_xml())
    config = settings(["release"], ["release"], {"damping": (0.01, 1.0), "tendon_friction": (0.1, 1.0)})
    with pytest.raises(InputError, match="identify_damping.parameters.tendon_friction: found it for an arm without"):
        run("identify_damping", config, root / "artifacts/build_mjcf/arm.xml")


def test_what_is_considered_widens_intervals_from_stage_to_stage(project):
    root, model, write = project
    middle, damper = (PARAMETERS[name].read(model) for name in ("stiffness", "damping"))
    trials = [tilt(model, angle, noise=1e-4) for angle in (30, 60, 90)] + [tilt(model, 75, "validate")]
    write([*trials, *(release(model, bend, split, frames=60)
                      for bend, split in ((0.3, "identify"), (-0.2, "identify"), (0.25, "validate")))])  # fmt: skip
    sizes = Tolerances(mass=0.03, tendon_friction=0.1)
    ranges = {"stiffness": (0.5 * middle, 2 * middle)}
    run("identify_stiffness", settings(["static_tilt"], ["static_tilt"], ranges, considered=sizes), CAD_MODEL)
    config = settings(["release"], ["release"], {"damping": (0.2 * damper, 5 * damper)}, considered=sizes)
    run("identify_damping", config, root / "artifacts/identify_stiffness/arm.xml")
    files = [root / f"artifacts/identify_{stage}/parameters.json" for stage in ("stiffness", "damping")]
    first, second = (json.loads(file.read_text()) for file in files)
    assert first["considered"]["mass"][""]["stiffness"] == pytest.approx(np.log(1.03), rel=0.02)
    assert first["considered"].keys() == {"mass"}
    assert second["considered"].keys() == {"mass", "earlier"}
    row = first["parameters"]["stiffness"]
    half = np.diff(np.log(row["interval_95_given_model"]))[0] / 2
    wide = np.sqrt(half**2 + (1.96 * np.log(1.03)) ** 2)
    np.testing.assert_allclose(np.log(row["interval_95"]), np.log(row["value"]) + np.array([-wide, wide]), rtol=0.03)
    low, high = second["parameters"]["damping"]["interval_95"]
    narrow = second["parameters"]["damping"]["interval_95_given_model"]
    assert low < narrow[0] < narrow[1] < high
