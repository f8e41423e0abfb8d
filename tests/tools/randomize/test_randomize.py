"""Domain randomisation: draws are as the file says, every drawn arm moves, and the centre is the calibrated arm."""

import json
import re
import subprocess
import sys
from pathlib import Path

import mujoco
import numpy as np
import pytest

from tests.support.small_arm import small_mjcf
from trunkline.errors import InputError
from trunkline.identification.parameters.parameters import PARAMETERS
from trunkline.model.simulation.motion import batch_of, hold, move
from trunkline.tools.randomize.__main__ import main
from trunkline.tools.randomize.fields import drawn_fields
from trunkline.tools.randomize.file import read_randomization
from trunkline.tools.randomize.randomization import Randomization, of_arm, of_population
from trunkline.twin.posterior import Posterior

ROOT = Path(__file__).parents[3]
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
    return {"parameters": rows, "correlation": correlations, "fitted_to": TRIALS}


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


def test_draws_have_the_covariance_that_the_file_states(written):
    drawn, _ = read_randomization(written)
    stated = json.loads(written.read_text())
    values = drawn.values(drawn.draw(40_000, np.random.default_rng(1)))
    for group in stated["groups"].values():
        normal = [stated["parameters"][name]["distribution"] == "normal" for name in group["parameters"]]
        x = [
            values[n] if as_it_is else np.log(values[n])
            for n, as_it_is in zip(group["parameters"], normal, strict=True)
        ]
        covariance = np.array(group["covariance"])
        scale = np.sqrt(np.outer(np.diag(covariance), np.diag(covariance)))
        np.testing.assert_allclose(np.cov(x) / scale, covariance / scale, atol=0.03)
        assert covariance[0, 1] / scale[0, 1] == pytest.approx(0.6)
    between = np.corrcoef(np.log(values["stiffness"]), np.log(values["kp"]))[0, 1]
    assert abs(between) < 0.03
    for name, row in stated["parameters"].items():
        quantiles = np.quantile(values[name], [0.025, 0.5, 0.975])
        np.testing.assert_allclose(quantiles[[0, 2]], row["interval_95"], rtol=0.03, atol=1e-3)
        assert quantiles[1] == pytest.approx(row["centre"], rel=0.01, abs=1e-3)
        assert PARAMETERS[name].unit == row["unit"]


def test_its_intervals_are_narrower_than_student_s_by_the_degrees_of_freedom(written):
    """2.262 standard uncertainties for 10 trials, 1.960 for a normal distribution."""
    row = json.loads(written.read_text())["parameters"]["stiffness"]
    assert np.log(row["interval_95"][1] / row["centre"]) == pytest.approx(np.log(1.2) * 1.960 / 2.262, rel=1e-3)


def test_the_centre_is_the_calibrated_arm_to_the_last_bit(written, model):
    drawn, _ = read_randomization(written)
    fields = drawn_fields(model, drawn.values(np.zeros((2, len(drawn.names)))))
    assert {"jnt_stiffness", "body_quat", "actuator_gainprm", "dof_damping"} <= set(fields)
    for name, values in fields.items():
        np.testing.assert_array_equal(values, np.stack([getattr(model, name)] * 2))


def test_what_is_written_is_read_again(written, model):
    """So the difference that is added to the model is the parameter's whole effect."""
    drawn, _ = read_randomization(written)
    values = drawn.values(drawn.draw(3, np.random.default_rng(4)))
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
    fields = drawn_fields(model, drawn.values(drawn.draw(16, np.random.default_rng(2))))
    batch = batch_of(model, 16)
    for name, values in fields.items():
        batch.expand(name)[:] = values
    straight = np.tile(model.tendon_length0[model.actuator_trnid[:, 0]], (16, 1))
    hold(batch, model, straight)
    controls = np.repeat((straight - 0.01 * np.eye(1, model.nu))[:, None], 500, axis=1)
    tips = move(batch, controls, ("site_xpos",))["site_xpos"][:, -1, model.site("tip").id]
    assert np.isfinite(tips).all()
    assert 1e-4 < np.std(tips, axis=0).max() < 0.1


def test_packed_draws_are_those_fields(written, model):
    drawn, _ = read_randomization(written)
    expected = drawn_fields(model, drawn.values(drawn.draw(5, np.random.default_rng(0))))
    with np.load(written.with_suffix(".npz")) as packed:
        assert set(packed) == set(expected)
        for name, values in expected.items():
            np.testing.assert_allclose(packed[name], values, rtol=1e-12)


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


# --- populations


def arm(centre: float, deviation: float) -> Randomization:
    """Of one parameter whose logarithm is `centre`."""
    low, high = np.array([1e-9]), np.array([1e9])
    return Randomization(["stiffness"], ["a"], np.exp([centre]), np.array([[deviation**2]]), low, high)


def test_arms_that_differ_by_no_more_than_they_are_uncertain_are_one_kind_of_arm():
    population = of_population([arm(1.0, 0.5), arm(1.1, 0.5), arm(0.9, 0.5)])
    assert population.centre[0] == pytest.approx(np.e)
    assert population.deviation[0] == pytest.approx(0.5 * np.sqrt(4 / 3))


def test_arms_that_differ_spread_as_far_as_they_do():
    rng = np.random.default_rng(3)
    truths = 1.0 + 0.3 * rng.standard_normal(400)
    population = of_population([arm(truth + 0.2 * rng.standard_normal(), 0.2) for truth in truths])
    assert population.deviation[0] == pytest.approx(np.hypot(0.3, 0.2), rel=0.1)
    assert population.arms == 400


def test_two_folders_are_a_population_about_their_mean(tmp_path, written):
    folders = [artifacts(tmp_path / name, stiffer) for name, stiffer in (("soft", 1.0), ("stiff", 2.0))]
    out = tmp_path / "both.json"
    assert main([*map(str, folders), "--out", str(out)]) == 0
    both, single = json.loads(out.read_text()), json.loads(written.read_text())
    assert both["arms"] == 2
    assert both["parameters"]["stiffness"]["centre"] == pytest.approx(
        np.sqrt(2) * single["parameters"]["stiffness"]["centre"]
    )
    assert both["parameters"]["stiffness"]["sd"] > 3 * single["parameters"]["stiffness"]["sd"]


# --- the command


def test_of_the_committed_stages_it_takes_what_the_last_one_found():
    tables = {s: json.loads((ROOT / f"artifacts/identify_{s}/parameters.json").read_text())
              for s in ("stiffness", "damping", "control")}  # fmt: skip
    drawn = of_arm(Posterior.from_tables(tables))
    values = drawn.values(drawn.draw(500, np.random.default_rng(0)))
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
    assert wide["sd"] == pytest.approx(3 * narrow["sd"])
    assert wide["centre"] == pytest.approx(narrow["centre"])


@pytest.mark.parametrize("spoil", ["nothing", "model", "json", "parameter"])
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
        (folder / "identify_control/parameters.json").write_text('{"parameters": {"kp": {}}}')
        expected = "expected what a stage of identification writes"
    if spoil == "parameter":
        path = folder / "identify_control/parameters.json"
        path.write_text(path.read_text().replace("force_range", "kp_ratio"))
        expected = "'kp_ratio'"
    assert main([str(folder), "--out", str(out)]) == 1
    (line,) = capsys.readouterr().err.splitlines()
    assert expected in line
    assert not out.exists()


def test_another_file_is_refused_by_name(tmp_path):
    for text in ("{}", "no json", '{"format": "other"}'):
        (tmp_path / "x.json").write_text(text)
        with pytest.raises(InputError, match="x.json"):
            read_randomization(tmp_path / "x.json")
