"""Domain randomisation: draws are as the file says, every drawn arm moves, and the centre is the calibrated arm."""

import json
import re
import subprocess
import sys
from pathlib import Path

import mujoco
import numpy as np
import pytest

from tests.support.folders import ROOT, TABLE_OF_NOTHING
from tests.support.small_arm import small_mjcf
from trunkline.ar.hybrid.uncertainty import GraspUncertainty, sample
from trunkline.errors import InputError
from trunkline.frames import STANDARD_GRAVITY
from trunkline.identification.parameters.parameters import PARAMETERS
from trunkline.identification.simulate.experiment import SLACK
from trunkline.model.simulation.motion import batch_of, hold, move
from trunkline.report.certificate.arms import StaticArm, arm_of, arms_with
from trunkline.report.certificate.budget import parameter_shifts
from trunkline.report.certificate.poses import StaticPoses
from trunkline.tools.randomize.__main__ import main
from trunkline.tools.randomize.fields import drawn_fields
from trunkline.tools.randomize.file import read_randomization
from trunkline.tools.randomize.population import of_population
from trunkline.twin.posterior import Posterior
from trunkline.twin.twin import Twin

TOLD = {"identify_stiffness": ("stiffness", "mount_tilt_x"), "identify_control": ("kp", "damping", "force_range")}
TRIALS = {f"trial_{number}": "" for number in range(10)}


def table(model: mujoco.MjModel, names: tuple[str, ...], correlation: float, relative: float) -> dict:
    """parameters.json of a stage that found what the model has."""
    rows = {}
    for name in names:
        value = PARAMETERS[name].read(model)
        low, high = (value - 0.02, value + 0.02) if PARAMETERS[name].signed else (value / relative, value * relative)
        wide = [-0.3, 0.3] if PARAMETERS[name].signed else [value / 100, value * 100]
        rows[name] = {"value": value, "interval_95_given_model": [low, high], "range": wide}
    correlations = {a: {b: 1.0 if a == b else correlation for b in names} for a in names}
    return TABLE_OF_NOTHING | {"parameters": rows, "correlation": correlations, "fitted_to": TRIALS}


def artifacts(folder: Path, stiffer: float = 1.0, relative: float = 1.2) -> Path:
    spec = mujoco.MjSpec.from_string(small_mjcf(4))
    for joint in spec.joints:
        joint.stiffness = np.multiply(joint.stiffness, stiffer)
    model = spec.compile()
    for stage, names in TOLD.items():
        (folder / stage).mkdir(parents=True)
        (folder / stage / "parameters.json").write_text(json.dumps(table(model, names, 0.6, relative)))
        (folder / stage / "arm.xml").write_text(spec.to_xml())
    return folder


@pytest.fixture(scope="module")
def written(tmp_path_factory) -> Path:
    folder = tmp_path_factory.mktemp("one")
    artifacts(folder / "artifacts")
    out = folder / "randomisation.json"
    assert main([str(folder / "artifacts"), "--out", str(out), "--draws", "5"]) == 0
    return out


@pytest.fixture(scope="module")
def model(written) -> mujoco.MjModel:
    return mujoco.MjModel.from_xml_path(str(written.parent / "artifacts/identify_control/arm.xml"))


def test_draws_have_the_distribution_that_the_file_states(written):
    posterior, _ = read_randomization(written)
    stated = json.loads(written.read_text())
    values = posterior.sample(40_000, 1)
    for group in stated["groups"].values():
        rows = {name: stated["parameters"][name] for name in group["parameters"]}
        z = [values[n] - r["centre"] if r["distribution"] == "t" else np.log(values[n] / r["centre"])
             for n, r in rows.items()]  # fmt: skip
        matrix, degrees = np.array(group["scale_matrix"]), group["degrees_of_freedom"]
        assert degrees == len(TRIALS) - 1
        scale = np.sqrt(np.outer(np.diag(matrix), np.diag(matrix)))
        assert np.sqrt(np.diag(matrix)).tolist() == pytest.approx([row["scale"] for row in rows.values()])
        np.testing.assert_allclose(np.cov(z) / scale, matrix / scale * degrees / (degrees - 2), atol=0.05)
        assert matrix[0, 1] / scale[0, 1] == pytest.approx(0.6)
    between = np.corrcoef(np.log(values["stiffness"]), np.log(values["kp"]))[0, 1]
    assert abs(between) < 0.03
    for name, row in stated["parameters"].items():
        quantiles = np.quantile(values[name], [0.025, 0.5, 0.975])
        np.testing.assert_allclose(quantiles[[0, 2]], row["interval_95"], rtol=0.03, atol=1e-3)
        assert quantiles[1] == pytest.approx(row["centre"], rel=0.01, abs=1e-3)
        assert PARAMETERS[name].unit == row["unit"]


def test_its_intervals_are_those_of_the_stages(written):
    row = json.loads(written.read_text())["parameters"]["stiffness"]
    assert row["interval_95"] == pytest.approx([row["centre"] / 1.2, row["centre"] * 1.2], rel=1e-4)


def test_previews_and_the_certificate_draw_the_same_numbers_from_the_same_seed(written, model):
    twin = Twin.load(written.parent / "artifacts")
    drawn = twin.posterior.sample(5, 0)  # as the certificate does
    previewed = sample(GraspUncertainty(posterior=twin.posterior), model, 5, 0).values
    assert set(drawn) - set(previewed) == {"mount_tilt_x"}, "of the marker, which previews have none of"
    for name, column in previewed.items():
        np.testing.assert_array_equal(column, drawn[name])
    expected = drawn_fields(model, drawn)
    by_the_file = drawn_fields(model, read_randomization(written)[0].sample(5, 0))
    with np.load(written.with_suffix(".npz")) as packed:
        assert set(packed) == set(expected)
        for name, values in expected.items():
            np.testing.assert_array_equal(packed[name], values)
            np.testing.assert_allclose(packed[name], by_the_file[name], rtol=1e-12)
    certified = parameter_shifts(twin.arm.model, twin.posterior, *poses_of(model), 5, np.random.default_rng(0))
    stated = [arm.tips(poses_of(model)[1]) for arm in arms_with(model, drawn)]
    np.testing.assert_allclose(certified + arm_of(model).tips(poses_of(model)[1]), stated, atol=1e-9)


def test_the_centre_is_the_calibrated_arm_to_the_last_bit(written, model):
    posterior, _ = read_randomization(written)
    fields = drawn_fields(model, {name: np.full(2, PARAMETERS[name].read(model)) for name in posterior.names})
    assert {"jnt_stiffness", "body_quat", "actuator_gainprm", "dof_damping"} <= set(fields)
    for name, values in fields.items():
        np.testing.assert_array_equal(values, np.stack([getattr(model, name)] * 2))


def test_what_is_written_is_read_again(written, model):
    """So the difference that is added to the model is the parameter's whole effect."""
    drawn, _ = read_randomization(written)
    values = drawn.sample(3, 4)
    fields = drawn_fields(model, values)
    for number in range(3):
        other = model.__copy__()
        for name, drawn_values in fields.items():
            getattr(other, name)[:] = drawn_values[number]
        for name in drawn.names:
            assert PARAMETERS[name].read(other) == pytest.approx(values[name][number], rel=1e-9, abs=1e-12), name


def test_the_file_names_the_fields_that_a_parameter_writes_and_no_others(written, model):
    for name, row in json.loads(written.read_text())["parameters"].items():
        value = np.array([PARAMETERS[name].read(model)])
        fields = drawn_fields(model, {name: value + 0.01 if PARAMETERS[name].signed else value * 1.1})
        changed = {f: int(np.sum(v[0] != getattr(model, f))) for f, v in fields.items()}
        assert row["fields"] == {f: count for f, count in changed.items() if count}
        assert row["read_by"] == "mujoco"


def test_every_drawn_arm_compiles_steps_and_is_another(written, model):
    drawn, _ = read_randomization(written)
    fields = drawn_fields(model, drawn.sample(16, 2))
    batch = batch_of(model, 16)
    for name, values in fields.items():
        batch.expand(name)[:] = values
    straight = np.tile(model.tendon_length0[model.actuator_trnid[:, 0]], (16, 1))
    hold(batch, model, straight)
    controls = np.repeat((straight - 0.01 * np.eye(1, model.nu))[:, None], 500, axis=1)
    tips = move(batch, controls, ("site_xpos",))["site_xpos"][:, -1, model.site("tip").id]
    assert np.isfinite(tips).all()
    assert 1e-4 < np.std(tips, axis=0).max() < 0.1


def test_the_example_s_first_arm_is_the_calibrated_one_and_the_others_spread_about_it(written, model):
    command = [sys.executable, str(ROOT / "examples/randomise/batch.py"),
               str(written.parent / "artifacts/identify_control/arm.xml"), str(written), "8", "0.5"]  # fmt: skip
    lines = subprocess.run(command, cwd=written.parent, capture_output=True, text=True, check=True).stdout.splitlines()
    assert lines[0].startswith("8 arms, ")
    assert lines[0].endswith(": 8 moved")
    batch = batch_of(model, 1)
    straight = model.tendon_length0[model.actuator_trnid[:, 0]][None]
    hold(batch, model, straight)
    controls = np.repeat((straight - 0.03 * np.eye(1, model.nu))[:, None], 500, axis=1)
    tip = move(batch, controls, ("site_xpos",))["site_xpos"][0, -1, model.site("tip").id]
    assert lines[1].partition("): ")[2] == ", ".join(f"{t:.6f}" for t in tip)
    assert float(re.search(r"median ([\d.]+),", lines[2])[1]) > 0.1


def poses_of(model: mujoco.MjModel) -> tuple[StaticArm, StaticPoses]:
    arm = arm_of(model)
    return arm, StaticPoses(np.array([[0.0, 0.0, -STANDARD_GRAVITY]]), arm.chain.straight_lengths[None] + SLACK)


# --- populations


def arm(centre: float, deviation: float) -> Posterior:
    """Of one parameter whose logarithm is `centre`, from ten trials."""
    far = np.array([np.inf])
    return Posterior(["stiffness"], ["a"], np.array([centre]), np.array([deviation]), np.array([9.0]), np.eye(1),
                     -far, far)  # fmt: skip


def test_arms_that_differ_by_no_more_than_they_are_uncertain_are_one_kind_of_arm():
    population = of_population([arm(1.0, 0.5), arm(1.1, 0.5), arm(0.9, 0.5)])
    assert population.value("stiffness") == pytest.approx(np.e)
    assert population.deviation[0] == pytest.approx(0.5 * np.sqrt(4 / 3))
    assert population.degrees[0] == 27


def test_arms_that_differ_spread_as_far_as_they_do():
    rng = np.random.default_rng(3)
    truths = 1.0 + 0.3 * rng.standard_normal(400)
    population = of_population([arm(truth + 0.2 * rng.standard_normal(), 0.2) for truth in truths])
    assert population.deviation[0] == pytest.approx(np.hypot(0.3, 0.2), rel=0.1)


def test_two_folders_are_a_population_about_their_mean(tmp_path, written):
    folders = [artifacts(tmp_path / name, stiffer) for name, stiffer in (("soft", 1.0), ("stiff", 2.0))]
    out = tmp_path / "both.json"
    assert main([*map(str, folders), "--out", str(out)]) == 0
    both, single = json.loads(out.read_text()), json.loads(written.read_text())
    assert both["arms"] == 2
    assert both["parameters"]["stiffness"]["centre"] == pytest.approx(
        np.sqrt(2) * single["parameters"]["stiffness"]["centre"]
    )
    assert both["parameters"]["stiffness"]["scale"] > 3 * single["parameters"]["stiffness"]["scale"]


# --- the command


def test_of_the_committed_stages_it_takes_what_the_last_one_found():
    tables = {s: json.loads((ROOT / f"artifacts/identify_{s}/parameters.json").read_text())
              for s in ("stiffness", "damping", "control")}  # fmt: skip
    values = Posterior.from_tables({f"identify_{stage}": table for stage, table in tables.items()}).sample(500, 0)
    assert values["kp"].std() > 0
    assert np.median(values["kp"]) == pytest.approx(tables["control"]["parameters"]["kp"]["value"], rel=0.1)
    for name, drawn_values in values.items():
        last = [t["parameters"][name] for t in tables.values() if name in t["parameters"]][-1]
        assert last["range"][0] <= drawn_values.min()
        assert drawn_values.max() <= last["range"][1]


def test_widened_it_spreads_as_much_more(tmp_path, written):
    out = tmp_path / "wide.json"
    assert main([str(written.parent / "artifacts"), "--out", str(out), "--widen", "3"]) == 0
    wide, narrow = (json.loads(path.read_text())["parameters"]["kp"] for path in (out, written))
    assert wide["scale"] == pytest.approx(3 * narrow["scale"])
    assert wide["centre"] == pytest.approx(narrow["centre"])


@pytest.mark.parametrize("spoil", ["nothing", "model", "json", "parameter", "part"])
def test_what_is_no_identified_arm_is_one_line_and_writes_nothing(spoil, tmp_path, capsys):
    folder, out = tmp_path / "artifacts", tmp_path / "out.json"
    expected = "found no identify_stiffness/arm.xml"
    if spoil != "nothing":
        artifacts(folder)
    if spoil == "model":
        (folder / "identify_control/arm.xml").write_text(artifacts(tmp_path / "b", 1.5).joinpath(
            "identify_control/arm.xml").read_text())  # fmt: skip
        expected = "arm.xml: stiffness: found "
    if spoil == "json":
        (folder / "identify_control/parameters.json").write_text(
            json.dumps(TABLE_OF_NOTHING | {"parameters": {"kp": {}}})
        )
        expected = "identify_control/parameters.json: kp: found no 'interval_95_given_model', expected it: make"
    if spoil == "parameter":
        path = folder / "identify_control/parameters.json"
        path.write_text(path.read_text().replace("force_range", "kp_ratio"))
        expected = "'kp_ratio'"
    if spoil == "part":
        path = folder / "identify_control/parameters.json"
        path.write_text(path.read_text().replace("force_range", "tendon_angle_9"))
        expected = "arm.xml: tendon_angle_9: found an arm without its part, expected the model that was identified"
    assert main([str(folder), "--out", str(out)]) == 1
    (line,) = capsys.readouterr().err.splitlines()
    assert expected in line
    assert not out.exists()


def test_another_file_is_refused_by_name(tmp_path):
    for text in ("{}", "no json", '{"format": "other"}'):
        (tmp_path / "x.json").write_text(text)
        with pytest.raises(InputError, match="x.json"):
            read_randomization(tmp_path / "x.json")
