"""`trunkline check`: what a session can identify, before any fit."""

import re
from dataclasses import replace
from types import SimpleNamespace
from typing import cast

import numpy as np
import pytest
import yaml
from scipy.spatial.transform import Rotation

from tests.identification.test_stage import settings
from tests.support.matched_plant import curl, motion, release, small_model, static_pull, tilt
from tests.support.small_arm import small_spec
from tests.support.workbench import ROOT, workbench
from trunkline.frames import STANDARD_GRAVITY, wxyz_from_rotation
from trunkline.identification.diagnostics.identifiability import (
    described_lines,
    expected_identifiability,
    to_identify_from,
    unidentifiable,
)
from trunkline.identification.fit.identify import with_parameters
from trunkline.identification.fit.search import search
from trunkline.identification.fit.setup import set_up, unidentifiable_mass
from trunkline.identification.parameters.parameters import parameter_named
from trunkline.recordings.trials.inventory import missing_lines, recorded_lines
from trunkline.recordings.trials.raw_trial import RawTrial
from trunkline.recordings.trials.trial import Trial, write_trials
from trunkline.tools.check.__main__ import main
from trunkline.tools.check.up_axis import other_ups, up_lines


@pytest.fixture(scope="module")
def model():
    return small_model(4)


def turned(trial: Trial, degrees: float) -> Trial:
    """The trial, the arm turned about its axis."""
    cosine, sine = np.cos(np.radians(degrees)), np.sin(np.radians(degrees))
    turn = np.array([[cosine, -sine, 0], [sine, cosine, 0], [0, 0, 1]])
    return replace(trial, gravity=turn @ trial.gravity, positions=trial.positions @ turn.T)


def test_what_was_recorded_is_counted_by_kind_and_split(model):
    trials = [tilt(model, 30), tilt(model, 60, "validate"), replace(release(model, 0.2), load=0.05),
              curl(model, 40), tilt(model, 90, "test")]  # fmt: skip
    assert recorded_lines(trials) == [
        "static tilts: 1 identify, 1 validate, 1 test; tilted by 30 to 60°",
        "releases: 1 identify, 0 validate, 0 test; loads of 50 g",
        "curls: 1 identify, 0 validate, 0 test; pulls of up to 40 mm",
    ]
    assert recorded_lines([tilt(model, 85), tilt(model, 85.2)])[0].endswith("; tilted by 85°")


def test_sides_that_no_trial_shows_are_named(model):
    tilted = tilt(model, 30)
    (alone,) = missing_lines([tilted, tilt(model, 60), turned(tilt(model, 40, "validate"), 120)])
    assert alone.startswith("tilts: gravity pulls the arm towards ")
    assert alone.endswith("° alone (base +x is 0°)"), "a trial of another split does not help the fit"
    assert missing_lines([tilted, turned(tilted, 120), turned(tilted, 240)]) == []
    (plane,) = missing_lines([tilted, turned(tilted, 180)])
    assert plane.endswith("all in one plane")
    (half,) = missing_lines([release(model, 0.2), turned(release(model, 0.3), 60)])
    assert half.startswith("releases: the arm is held to no side within 150° of ")


def test_tendons_that_never_pull_are_named(model):
    assert missing_lines([curl(model, 40)]) == [
        "never pulled: tendon_2, tendon_3",
        "only one tendon is pulled at a time: how several share the load is not seen",
    ]
    assert missing_lines([static_pull(model, (30, 30, 0)), static_pull(model, (0, 0, 20))]) == []
    slack, small = (replace(curl(model, 40), commands=np.full((150, 3), pull)) for pull in (-0.3, 5e-5))
    assert missing_lines([slack]) == ["no tendon is pulled; if some were, their sign in session.yaml is wrong"]
    assert missing_lines([small]) == [
        "no tendon is pulled by more than 0.05 mm: is the unit in session.yaml right?"
    ]


def test_what_shows_in_no_trial_and_what_shows_as_one_is_told(model):
    ranges = {"stiffness": (0.1, 10.0), "kp": (10.0, 1e4), "force_range": (5.0, 1e4)}
    pulls = [static_pull(model, (level, 0, 0)) for level in (10, 20)]
    prepared = to_identify_from(settings(["static_pull"], ["static_pull"], ranges), model, pulls)
    parameters, pairs = expected_identifiability(*prepared, 0.005)
    by_name = {parameter.name: parameter for parameter in parameters}
    assert by_name["force_range"].words() == "force_range shows in no trial"
    assert np.isfinite(by_name["kp"].half_width)
    sure, _ = expected_identifiability(*prepared, 0.0025)
    np.testing.assert_allclose(2 * sure[0].half_width, parameters[0].half_width)
    moving = settings(["motion"], ["motion"], {"dead_time": (1e-3, 0.1), "time_constant": (1e-3, 0.1)})
    slow = small_model(4, dead_time=0.02)
    _, pairs = expected_identifiability(*to_identify_from(moving, slow, [motion(slow, reach_mm=10)]), 0.005)
    assert pairs == ["dead_time and time_constant trade off"]


def test_a_session_that_says_down_for_up_is_seen(model):
    config = settings(["static_tilt"], ["static_tilt"], {"stiffness": (0.1, 10.0)})
    trials = [tilt(model, angle) for angle in (20, 60)]
    (line,) = described_lines(*to_identify_from(config, model, trials))
    assert line.startswith("as described, it is ")
    off, still = (float(part.split(" mm")[0].split(" ")[-1]) for part in line.split(", a straight arm"))
    assert off < 0.01 * still, "the arm that made them"
    wrong = [replace(trial, gravity=-trial.gravity) for trial in trials]
    line, doubt = described_lines(*to_identify_from(config, model, wrong))
    assert doubt == "no nearer than a straight arm: look at `up` and the masses"


def test_only_what_can_be_wrong_of_arm_and_trials_is_named(model):
    def suspects(trials, kind):
        lines = described_lines(*to_identify_from(settings([kind], [kind], {"stiffness": (0.1, 10.0)}), model, trials))
        return [line.removeprefix("no nearer than a straight arm: look at ") for line in lines[1:]]

    pulled = static_pull(model, (20, 0, 0))
    away = replace(pulled, commands=pulled.commands[:, [1, 2, 0]])
    assert suspects([pulled], "static_pull") == []
    assert suspects([away], "static_pull") == ["`up`, the masses and which motor pulls which tendon"]
    assert suspects([replace(away, gravity=np.zeros(3))], "static_pull") == ["which motor pulls which tendon"]
    swung = release(model, 0.2)
    wrong = replace(swung, gravity=-swung.gravity)
    off, still = (float(part.split(" mm")[0].split(" ")[-1]) for part in first(model, wrong).split(", a straight arm"))
    assert off > still, "or the next line shows nothing"
    assert suspects([wrong], "release") == [], "a straight arm is where a swing ends, however the arm is described"


def first(model, trial: Trial) -> str:
    config = settings([trial.experiment], [trial.experiment], {"stiffness": (0.1, 10.0)})
    return described_lines(*to_identify_from(config, model, [trial]))[0]


def test_another_up_that_fits_better_is_named(model):
    """Where a body marks the mount, a wrong `up` turns gravity alone."""
    config = settings(["static_tilt"], ["static_tilt"], {"stiffness": (0.1, 10.0)})
    base = Rotation.from_matrix([[0.0, 0, 1], [1, 0, 0], [0, 1, 0]])
    trial = tilt(model, 90)

    def lines_with(of: list[Trial], up: tuple[float, ...]) -> list[str]:
        raw_trials = [mounted(trial, base, up, 1e-6) for trial in of]
        arm, experiments, fit = to_identify_from(config, model, of)
        return up_lines(arm, experiments, fit.markers, other_ups(raw_trials))

    right = tuple(np.round(base.apply(-trial.gravity / STANDARD_GRAVITY)) + 0.0)
    assert lines_with([trial], right) == []
    for wrong in (np.eye(3)[k] * sign for k in range(3) for sign in (1, -1)):
        if wrong @ right > 0.5:
            continue
        turned = replace(trial, gravity=base.inv().apply(-STANDARD_GRAVITY * wrong))
        (line,) = lines_with([turned], tuple(wrong))
        assert line.startswith(f"`frame.up` in session.yaml: [{', '.join(f'{value:g}' for value in right)}] would fit")


def test_an_up_that_levels_exclude_is_not_advised(model):
    """Tilts that fit the declared vertical leave no other, however badly a described arm follows its motors."""
    tilts = [mounted(tilt(model, angle), Rotation.from_euler("y", angle, degrees=True), (0, 0, 1), 1e-6)
             for angle in (0, 45)]  # fmt: skip
    excluded = np.isnan(other_ups(tilts)[tilts[0].name]).any(axis=1)
    assert excluded.tolist() == [True, True, False, True, True, True]
    (alone,) = other_ups(tilts[:1]).values()
    assert np.isfinite(alone).all(), "one level tells too little"


def test_the_gain_of_motors_is_looked_at_before_the_vertical(model):
    """As a newcomer guesses it: five times too small."""
    config = settings(["static_pull"], ["static_pull"], {"kp": (1.0, 1e5)})
    trials = [static_pull(model, (level, 0, 0)) for level in (10, 20)]
    arm, experiments, fit = to_identify_from(config, model, trials)
    ups = {trial.name: np.array([trial.gravity] * 6) for trial in trials}
    assert up_lines(arm, experiments, fit.markers, ups) == []
    guessed = with_parameters(arm, {"kp": parameter_named("kp").read(arm) / 5})
    (line,) = up_lines(guessed, experiments, fit.markers, ups)
    assert line.startswith("`kp` of 5 times the described ")


def test_no_other_up_is_looked_for_where_none_can_be_right(model):
    tilted = tilt(model, 90)
    weightless = mounted(tilted, Rotation.identity(), (0, 0, 0))
    by_declaration = mounted(tilted, Rotation.identity(), (0, 0, 1))
    assert other_ups([weightless]) == other_ups([by_declaration]) == other_ups([]) == {}
    days = ("monday", "friday")
    monday, friday = (mounted(tilted, Rotation.identity(), (0, 1, 0), 1e-6, day) for day in days)
    assert other_ups([monday]) != {}
    assert other_ups([monday, friday]) == {}


def mounted(trial: Trial, base: Rotation, up: tuple[float, ...], noise: float = 0.0, session: str = "") -> RawTrial:
    """A raw trial with the base of `trial`, turned by `base`, as cameras see it with noise, in a frame of which `up` is
    up."""
    ones = np.ones((4, 1))
    fields = {"name": trial.name, "session": session, "experiment": trial.experiment, "level": trial.level,
              "up": np.array(up, float),
              "base_positions": 0 * ones * np.ones(3),
              "base_quaternions": ones * wxyz_from_rotation(base) + noise * np.eye(4)}  # fmt: skip
    return cast(RawTrial, SimpleNamespace(**fields))


def test_the_expected_width_is_that_of_fits_to_trials_that_are_off_so(model):
    """Forty arms whose shapes are off at random by a share of each point's distance, each fitted: their scatter."""
    share, rng = 0.01, np.random.default_rng(0)
    config = settings(["static_tilt"], ["static_tilt"], {"stiffness": (0.3 * model.jnt_stiffness[0], 30.0)})
    clean = [tilt(model, angle) for angle in (20, 40, 60, 80)]
    (estimate,), _ = expected_identifiability(*to_identify_from(config, model, clean), share)
    values = []
    for _ in range(40):
        off = [rng.normal(size=3) * share / np.sqrt(3) for _ in clean]
        trials = [
            replace(t, positions=t.positions + np.linalg.norm(t.positions, axis=2, keepdims=True) * e)
            for t, e in zip(clean, off, strict=True)
        ]
        values.append(fitted(config, model, trials))
    assert 0.4 < 1.96 * np.std(np.log(values)) / estimate.half_width < 2.5


def fitted(config, model, trials) -> float:
    model, experiments, fit = set_up(config, trials, model)
    problem = fit.problem(model, experiments)
    return float(np.exp(search(problem, config.optimizer, 1, lambda best: None).vector[0]))


def test_a_stage_without_its_trials_says_what_to_set(model):
    config = settings(["static_tilt", "static_pull"], ["static_tilt", "static_pull"], {"stiffness": (0.1, 10.0)})
    (line,) = unidentifiable(config, [tilt(model, 30)])
    assert line.startswith("no static_pull of the split identify: `source: tilts` under identify_stiffness")


def test_a_mass_wants_a_trial_with_a_load(model):
    config = settings(["static_tilt"], ["static_tilt"], {"mass": (0.1, 10.0)})
    (line,) = unidentifiable_mass(config, [tilt(model, 30)])
    assert line.startswith("parameters.mass: found no static_tilt with split identify that carries a load")
    assert not unidentifiable_mass(config, [replace(tilt(model, 30), load=0.1)])


def test_the_command_reads_logs_and_writes_nothing(tmp_path, monkeypatch, capsys):
    workbench(tmp_path)
    monkeypatch.chdir(tmp_path)
    assert main(["data/raw/demo"]) == 0
    output, warned = capsys.readouterr()
    assert "check: 4/4 trials" in output
    assert "check: warning: " in warned
    assert "evaluate" not in output + warned
    assert "static tilts: 1 identify" in output
    assert "identify_stiffness, from 1 trials:\n  no static_pull of the split identify" in output
    assert "identify_damping, from" in output
    assert sorted(path.name for path in tmp_path.iterdir()) == ["conf", "data", "params.yaml"]
    assert "note: " not in output
    monkeypatch.setattr("trunkline.tools.check.__main__.slips", lambda model: [f"{model.nbody} bodies"])
    assert main(["data/raw/demo"]) == 0
    assert re.search(r"^note: \d+ bodies$", capsys.readouterr().out, re.MULTILINE)
    assert main(["data/raw/nowhere"]) == 1
    assert "no such folder" in capsys.readouterr().err
    params = tmp_path / "params.yaml"
    params.write_text(params.read_text().replace("arm: spiral", "arm: spirol"))
    assert main(["data/raw/demo"]) == 1
    output, error = capsys.readouterr()
    assert "build_mjcf.arm: found 'spirol', expected one of" in error
    assert output == "", "no trial is read before the settings are"


def test_of_several_sessions_each_is_told_and_what_it_has_for_itself(model, tmp_path, monkeypatch, capsys):
    params = yaml.safe_load((ROOT / "params.yaml").read_text())
    wanted = ("build_mjcf", "identify_stiffness")
    del params["identify_stiffness"]["parameters"]["capstan_friction"]  # of cables that rub, which this arm's do not
    (tmp_path / "params.yaml").write_text(yaml.safe_dump({stage: params[stage] for stage in wanted}))
    monkeypatch.chdir(tmp_path)
    rested = [tilt(model, 30), tilt(model, 60), *(static_pull(model, (pull, 0, 0)) for pull in (10, 20))]
    days = [replace(trial, session=session, name=f"{session}/{trial.name}")
            for session in ("monday", "friday") for trial in rested]  # fmt: skip
    write_trials(tmp_path, days)
    monkeypatch.setattr(
        "trunkline.tools.check.__main__.described_arm", lambda *_: SimpleNamespace(spec=small_spec(4))
    )
    assert main(["."]) == 0
    output = capsys.readouterr().out
    for session in ("monday", "friday"):
        assert f"  {session}: static tilts: 2 identify, 0 validate, 0 test; tilted by 30 to 60°\n" in output
        assert f"  {session}: static pulls: 2 identify" in output
    assert "  mount_tilt_x to ± " in output
    assert "  mount_tilt_x@friday to ± " in output
    swing = replace(release(model, 0.2), session="friday", name="friday/release")
    write_trials(tmp_path, [*(trial for trial in days if trial.session == "monday"), swing])
    assert main(["."]) == 0
    line = "  per_session: mount_tilt_x: found no static_tilt or static_pull of the session friday with split identify"
    assert line in capsys.readouterr().out
