"""`python -m trunkline.check`: what a session will tell, before any fit."""

from dataclasses import replace
from types import SimpleNamespace

import numpy as np
import pytest
import yaml

from tests.identification.test_stage import settings
from tests.support.matched_plant import curl, motion, release, small_model, static_pull, tilt
from tests.support.small_arm import small_spec
from tests.support.workbench import ROOT, workbench
from trunkline.check.__main__ import main
from trunkline.check.recorded import missing_lines, recorded_lines
from trunkline.check.told import described_lines, to_identify_from, told_by, untold
from trunkline.identification.search import search
from trunkline.identification.setup import set_up
from trunkline.trials.trial import Trial, write_trials


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


def test_sides_that_no_trial_shows_are_named(model):
    one = tilt(model, 30)
    (alone,) = missing_lines([one, tilt(model, 60), turned(tilt(model, 40, "validate"), 120)])
    assert alone.startswith("tilts: gravity pulls the arm towards ")
    assert alone.endswith("° alone (base +x is 0°)"), "a trial of another split does not help the fit"
    assert missing_lines([one, turned(one, 120), turned(one, 240)]) == []
    (plane,) = missing_lines([one, turned(one, 180)])
    assert plane.endswith("all in one plane")
    (half,) = missing_lines([release(model, 0.2), turned(release(model, 0.3), 60)])
    assert half.startswith("releases: the arm is held to no side within 149° of ")


def test_tendons_that_never_pull_are_named(model):
    assert missing_lines([curl(model, 40)]) == [
        "never pulled: tendon_2, tendon_3",
        "only one tendon is pulled at a time: how several share the load is not seen",
    ]
    assert missing_lines([static_pull(model, (30, 30, 0)), static_pull(model, (0, 0, 20))]) == []
    assert missing_lines([replace(curl(model, 40), commands=np.full((150, 3), -0.3))]) == ["no tendon is pulled"]


def test_what_shows_in_no_trial_and_what_shows_as_one_is_told(model):
    ranges = {"stiffness": (0.1, 10.0), "kp": (10.0, 1e4), "force_range": (5.0, 1e4)}
    pulls = [static_pull(model, (level, 0, 0)) for level in (10, 20)]
    prepared = to_identify_from(settings(["static_pull"], ["static_pull"], ranges), model, pulls)
    told, pairs = told_by(*prepared, 0.005)
    by_name = {one.name: one for one in told}
    assert by_name["force_range"].words() == "force_range shows in no trial"
    assert np.isfinite(by_name["kp"].half_width)
    sure, _ = told_by(*prepared, 0.0025)
    np.testing.assert_allclose(2 * sure[0].half_width, told[0].half_width)
    moving = settings(["motion"], ["motion"], {"dead_time": (1e-3, 0.1), "time_constant": (1e-3, 0.1)})
    slow = small_model(4, dead_time=0.02)
    _, pairs = told_by(*to_identify_from(moving, slow, [motion(slow, reach_mm=10)]), 0.005)
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
    assert doubt.startswith("no nearer than a straight arm: look at `up`")


def test_the_expected_width_is_that_of_fits_to_trials_that_are_off_so(model):
    """Forty arms whose shapes are off at random by a share of each point's distance, each fitted: their scatter."""
    share, rng = 0.01, np.random.default_rng(0)
    config = settings(["static_tilt"], ["static_tilt"], {"stiffness": (0.3 * model.jnt_stiffness[0], 30.0)})
    clean = [tilt(model, angle) for angle in (20, 40, 60, 80)]
    (told,), _ = told_by(*to_identify_from(config, model, clean), share)
    found = []
    for _ in range(40):
        off = [rng.normal(size=3) * share / np.sqrt(3) for _ in clean]
        trials = [
            replace(t, positions=t.positions + np.linalg.norm(t.positions, axis=2, keepdims=True) * e)
            for t, e in zip(clean, off, strict=True)
        ]
        found.append(fitted(config, model, trials))
    assert 0.4 < 1.96 * np.std(np.log(found)) / told.half_width < 2.5


def fitted(config, model, trials) -> float:
    model, experiments, fit = set_up(config, trials, model)
    problem = fit.problem(model, experiments)
    return float(np.exp(search(problem, config.optimizer, 1, lambda best: None).vector[0]))


def test_a_stage_without_its_trials_says_what_to_set(model):
    config = settings(["static_tilt", "static_pull"], ["static_tilt", "static_pull"], {"stiffness": (0.1, 10.0)})
    (line,) = untold(config, [tilt(model, 30)])
    assert line.startswith("no static_pull of the split identify: `source: tilts` under identify_stiffness")


def test_the_command_reads_logs_and_writes_nothing(tmp_path, monkeypatch, capsys):
    workbench(tmp_path)
    monkeypatch.chdir(tmp_path)
    assert main(["data/raw/demo"]) == 0
    told = capsys.readouterr().out
    assert "static tilts: 1 identify" in told
    assert "identify_stiffness, from 1 trials:\n  no static_pull of the split identify" in told
    assert "identify_damping, from" in told
    assert sorted(path.name for path in tmp_path.iterdir()) == ["conf", "data", "params.yaml"]
    assert main(["data/raw/nowhere"]) == 1
    assert "no such folder" in capsys.readouterr().err


def test_of_several_sessions_each_is_told_and_what_it_has_for_itself(model, tmp_path, monkeypatch, capsys):
    params = yaml.safe_load((ROOT / "params.yaml").read_text())
    wanted = ("build_mjcf", "identify_stiffness")
    (tmp_path / "params.yaml").write_text(yaml.safe_dump({stage: params[stage] for stage in wanted}))
    monkeypatch.chdir(tmp_path)
    rested = [tilt(model, 30), tilt(model, 60), *(static_pull(model, (pull, 0, 0)) for pull in (10, 20))]
    days = [replace(trial, session=session, name=f"{session}/{trial.name}")
            for session in ("monday", "friday") for trial in rested]  # fmt: skip
    write_trials(tmp_path, days)
    monkeypatch.setattr("trunkline.check.__main__.described_arm", lambda *_: SimpleNamespace(spec=small_spec(4)))
    assert main(["."]) == 0
    told = capsys.readouterr().out
    for session in ("monday", "friday"):
        assert f"  {session}: static tilts: 2 identify, 0 validate, 0 test; tilted by 30 to 60°\n" in told
        assert f"  {session}: static pulls: 2 identify" in told
    assert "  mount_tilt_x to ± " in told
    assert "  mount_tilt_x@friday to ± " in told
    swing = replace(release(model, 0.2), session="friday", name="friday/release")
    write_trials(tmp_path, [*(trial for trial in days if trial.session == "monday"), swing])
    assert main(["."]) == 0
    said = "  per_session: mount_tilt_x: found no static_tilt or static_pull of the session friday with split identify"
    assert said in capsys.readouterr().out
