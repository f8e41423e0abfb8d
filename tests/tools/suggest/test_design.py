"""`trunkline suggest`: what to record next, and what it is expected to tell."""

from dataclasses import replace
from pathlib import Path

import mujoco
import numpy as np
import pytest
import yaml

from tests.identification.test_stage import settings
from tests.support.folders import ROOT
from tests.support.matched_plant import release, small_model, static_pull, tilt
from tests.support.small_arm import small_spec
from tests.support.workbench import workbench
from trunkline.identification.diagnostics.identifiability import expected_identifiability, to_identify_from
from trunkline.identification.fit.identify import with_parameters
from trunkline.identification.parameters.parameters import PARAMETERS
from trunkline.identification.parameters.per_session import make_room
from trunkline.model.arm.joints import Joints, add_elements
from trunkline.pipeline.config import load_folder
from trunkline.recordings.session.session import read_session
from trunkline.report.certificate.arms import arm_of
from trunkline.tools.suggest.__main__ import DESCRIBED, main, twin, with_room
from trunkline.tools.suggest.candidates import candidates
from trunkline.tools.suggest.goals import GOALS, tip_moves, weights_for, workspace
from trunkline.tools.suggest.information import StageInformation, information, shares_of, stage_information
from trunkline.tools.suggest.ranking import after_each, expected_loss, suggest
from trunkline.tools.suggest.settings import Recordable
from trunkline.tools.suggest.words import entry_lines, why_words

SHARE, FRAMES = 0.005, 60
ELASTIC = {"stiffness": (0.1, 20.0), "rest_bend_y": (-0.1, 0.1)}


@pytest.fixture(scope="module")
def model() -> mujoco.MjModel:
    return small_model(4)


@pytest.fixture(scope="module")
def grid() -> Recordable:
    return load_folder(Recordable, ROOT / "conf/suggest")


@pytest.fixture(scope="module")
def project(tmp_path_factory) -> Path:
    return workbench(tmp_path_factory.mktemp("project"))


def stage_of(model, grid, kinds, ranges, trials, share=SHARE, **changed) -> tuple[StageInformation, list]:
    every = candidates(grid, model, tuple(kinds), FRAMES)
    config = settings(kinds, kinds, ranges, **changed)
    return stage_information("stage", config, model, trials, every, grid, share), every


def best(stage, every, model, grid, goal="intervals", count=1):
    suggestions = suggest([stage], weights_for(goal, [stage], model, grid), every, count)
    return [suggestion.candidate for suggestion in suggestions]


def paper_loss():
    """Distances from the base, which turn with the mount unless gravity acts on the arm otherwise."""
    return replace(settings(["static_tilt"], ["static_tilt"], {"stiffness": (0.1, 20.0)}).loss, kind="distances")


def test_a_side_to_which_nothing_tilted_the_arm_comes_first(model, grid):
    """By distances, tilts about one axis do not tell by how much the mount leans about the other."""
    ranges = {"stiffness": (0.1, 20.0), "mount_tilt_x": (-0.3, 0.3), "mount_tilt_y": (-0.3, 0.3)}
    trials = [tilt(model, angle) for angle in (20, 50, 80)]  # about y: gravity towards +x
    stage, every = stage_of(model, grid, ["static_tilt"], ranges, trials, 2e-4, loss=paper_loss())
    before = {estimate.name: estimate.share for estimate in stage.identifiability([])}
    assert before["mount_tilt_x"] > 1 > 2 * before["mount_tilt_y"], "undetermined, and determined"
    (first,) = best(stage, every, model, grid)
    assert abs(first.gravity[1]) > abs(first.gravity[0]), first.name
    after = {estimate.name: estimate.share for estimate in stage.identifiability([first.name])}
    assert after["mount_tilt_x"] < 0.5
    weights = weights_for("intervals", [stage], model, grid)
    why = why_words([stage], weights, suggest([stage], weights, every, 1)[0])
    assert why.startswith("mount_tilt_x undetermined now, then ± ")


def test_a_tendon_that_was_never_pulled_comes_first(model, grid):
    ranges = {"kp": (10.0, 1e4), "kp_ratio_2": (0.5, 2.0)}
    pulls = [static_pull(model, (level, 0, 0)) for level in (10, 20, 30)]
    stage, every = stage_of(model, grid, ["static_pull"], ranges, pulls)
    (first,) = best(stage, every, model, grid)
    assert "tendon_2" in first.how


def test_what_a_straight_arm_does_not_tell_is_told_by_a_tilt_for_every_goal(model, grid):
    stage, every = stage_of(model, grid, ["static_tilt"], {"stiffness": (0.1, 20.0)}, [tilt(model, 0)])
    for goal in GOALS:
        (first,) = best(stage, every, model, grid, goal)
        assert first.level == 90


def test_information_adds_and_never_takes_away(model, grid):
    trials = [tilt(model, 30), tilt(model, 70), static_pull(model, (20, 0, 0)), release(model, 0.2)]
    kinds = ["static_tilt", "static_pull", "release"]
    config = settings(kinds, kinds, ELASTIC | {"damping": (1e-4, 1.0), "kp": (10.0, 1e4)})
    model, experiments, fit = to_identify_from(config, model, trials)
    together = information(fit, model, experiments, SHARE)
    apart = np.concatenate([information(fit, model, [e], SHARE) for e in experiments])
    np.testing.assert_allclose(together, apart, rtol=1e-4, atol=1e-6 * np.abs(together).max())
    for matrix in together:
        np.testing.assert_allclose(matrix, matrix.T)
        assert np.linalg.eigvalsh(matrix).min() >= -1e-9 * np.abs(matrix).max()
    loose = [i for i, e in enumerate(experiments) if e.kind != "static_pull"]
    np.testing.assert_allclose(information(fit, model, experiments, 2 * SHARE)[loose], together[loose] / 4)


@pytest.mark.parametrize(("kind", "name", "made"), [
    ("static_tilt", "tilt_090_side_000", lambda model: tilt(model, 90)),
    ("static_pull", "pull_1_061", lambda model: static_pull(model, (61, -300, -300))),
])  # fmt: skip
def test_the_expected_interval_is_that_with_the_trial_really_added(grid, kind, name, made):
    """By `expected_identifiability`, the arithmetic of `check`, on a trial that plain steps of MuJoCo simulate; within
    3 %. The arm's tendons have no friction, which `check` leaves out."""
    model = small_model(4, kp=100)
    model.tendon_frictionloss[:] = 0
    kinds = ["static_tilt", "static_pull"]
    ranges = ELASTIC | {"kp": (1.0, 1e4)}
    trials = [tilt(model, 40), tilt(model, 70), static_pull(model, (30, -300, -300)),
              static_pull(model, (-300, 45, -300))]  # fmt: skip
    stage, every = stage_of(model, grid, kinds, ranges, trials, 0.002)
    assert name in {candidate.name for candidate in every if candidate.kind == kind}
    now, expected = stage.identifiability([]), stage.identifiability([name])
    prepared = to_identify_from(settings(kinds, kinds, ranges), model, [*trials, made(model)])
    really, _ = expected_identifiability(*prepared, 0.002)
    for before, estimate, other in zip(now, expected, really, strict=True):
        assert estimate.half_width == pytest.approx(other.half_width, rel=0.03), estimate.name
        assert estimate.half_width < before.half_width


def test_a_pull_that_friction_may_hold_elsewhere_tells_less(model):
    trials = [tilt(model, 40), static_pull(model, (10, -300, -300)), static_pull(model, (60, -300, -300))]
    kinds = ["static_tilt", "static_pull"]
    _, experiments, _ = to_identify_from(settings(kinds, kinds, ELASTIC), model, trials)
    hanging, little, much = shares_of(model, experiments, SHARE)
    assert hanging == SHARE
    assert little > SHARE
    assert much > SHARE
    smooth = model.__copy__()
    smooth.tendon_frictionloss[:] = smooth.dof_frictionloss[:] = 0
    np.testing.assert_array_equal(shares_of(smooth, experiments, SHARE), SHARE)


def test_each_suggestion_knows_those_before_it(model, grid):
    kinds = ["static_tilt", "static_pull"]
    trials = [tilt(model, 40), static_pull(model, (30, -300, -300))]
    stage, every = stage_of(model, grid, kinds, ELASTIC | {"kp": (10.0, 1e4)}, trials)
    weights = weights_for("intervals", [stage], model, grid)
    suggestions = suggest([stage], weights, every, 4)
    assert len({suggestion.candidate.name for suggestion in suggestions}) == 4
    for earlier, later in zip(suggestions, suggestions[1:], strict=False):
        assert later.before == earlier.after
        assert later.chosen[:-1] == earlier.chosen
    for suggestion in suggestions:
        left = [other for other in every if other.name not in suggestion.chosen[:-1]]
        assert suggestion.after == pytest.approx(expected_loss([stage], weights, suggestion.chosen))
        assert suggestion.after == pytest.approx(after_each([stage], weights, left, suggestion.chosen[:-1]).min())
    quick = suggest([stage], weights, every, 1, per_minute=True)[0]
    gains = np.sqrt(suggestions[0].before) - np.sqrt(after_each([stage], weights, every, []))
    assert quick.candidate == every[int(np.argmax(gains / [candidate.minutes for candidate in every]))]


def test_what_the_session_holds_is_not_suggested_again(model, grid):
    stage, every = stage_of(model, grid, ["static_tilt"], ELASTIC, [tilt(model, 30), tilt(model, 60)])
    assert {"tilt_030_side_000", "tilt_060_side_000"} <= stage.repeated
    assert not {"tilt_090_side_000", "tilt_060_side_180"} & stage.repeated
    assert len(every) > len(stage.repeated) + 10


def test_a_stage_without_any_of_its_trials_knows_the_ranges_alone(model, grid):
    stage, _ = stage_of(model, grid, ["static_pull"], {"kp": (10.0, 1e4)}, [tilt(model, 30)])
    (estimate,) = stage.identifiability([])
    assert estimate.words() == "kp stays undetermined within its range"
    assert min(stage.identifiability([name])[0].share for name in stage.added) < 1


def test_the_tip_answers_a_parameter_as_another_arm_does(model, grid):
    poses = workspace(model, grid)[:8]
    (moves,) = tip_moves(model, ["stiffness"], poses)
    value, step = PARAMETERS["stiffness"].read(model), 0.01
    ends = [arm_of(with_parameters(model, {"stiffness": value * np.exp(s * step)})).tips(poses) for s in (1, -1)]
    np.testing.assert_allclose(moves, (ends[0] - ends[1]) / (2 * step), atol=2e-3 * np.abs(moves).max())
    assert not tip_moves(model, ["damping"], poses).any(), "nothing at rest answers to damping"


def test_what_another_session_has_for_itself_moves_no_tip_of_the_first(grid):
    spec = small_spec(4)
    spec.option.timestep = small_model(4).opt.timestep
    add_elements(spec, Joints(), 1e-5)
    make_room(spec, {"mount_tilt_x@friday": "mount_tilt_x"})
    twin = spec.compile()
    moves = tip_moves(twin, ["mount_tilt_x", "mount_tilt_x@friday"], workspace(twin, grid)[:8])
    assert moves[0].any()
    assert not moves[1].any()


def test_two_sessions_on_an_arm_that_no_stage_identified_have_a_mount_each(project, model):
    monday = [replace(tilt(model, angle), session="monday") for angle in (20, 60)]
    friday = [replace(tilt(model, 40), session="friday")]
    spec, source = twin(None, project)
    assert source == DESCRIBED
    model_with_room = with_room(spec, monday + friday, project)
    names = [model_with_room.numeric(index).name for index in range(model_with_room.nnumeric)]
    assert "mount_tilt_x@friday" in names
    assert not [name for name in names if name.endswith("@monday")]


def test_a_release_is_bent_towards_its_side(model, grid):
    stage, every = stage_of(model, grid, ["release"], {"damping": (1e-4, 1.0)}, [release(model, 0.2)])
    assert {candidate.kind for candidate in every} == {"release"}
    assert set(stage.added) == {candidate.name for candidate in every}
    assert all(matrix[0, 0] > 0 for matrix in stage.added.values())


def test_entries_are_read_back(model, grid, tmp_path):
    kinds = ("static_tilt", "release", "static_pull", "curl", "motion")
    every = candidates(grid, model, kinds, FRAMES)
    assert {candidate.kind for candidate in every} == set(kinds)
    lines = entry_lines(every, {every[0].name})
    text = "\n".join(["frame: {up: [0, 1, 0]}", "base: base", "trials:", *lines])
    (tmp_path / "session.yaml").write_text(text)
    for entry in yaml.safe_load(text)["trials"]:
        (tmp_path / entry["file"]).write_bytes(entry["file"].encode())
    session = read_session(tmp_path)
    assert [t.experiment for t in session.trials] == [candidate.kind for candidate in every]
    assert [t.level for t in session.trials] == [candidate.level for candidate in every]
    assert [t.load for t in session.trials] == [candidate.load for candidate in every]
    assert {t.split for t in session.trials} == {"identify"}
    assert every[0].name not in {t.name for t in session.trials}, "a name that is taken"


def test_the_command_says_all_and_writes_nothing(project, monkeypatch, capsys):
    monkeypatch.chdir(project)
    files = sorted(path for path in project.rglob("*") if path.is_file())
    assert main(["data/raw/demo", "--only", "static_tilt", "--count", "2"]) == 0
    output = capsys.readouterr().out
    assert "twin: as described in params.yaml, as no stage has identified one yet" in output
    assert "suggested, of " in output
    assert "  - {file: tilt_0" in output
    assert "experiment: static_tilt, level: " in output
    assert "trunkline check data/raw/demo" in output
    assert sorted(path for path in project.rglob("*") if path.is_file()) == files


@pytest.mark.parametrize(("arguments", "line"), [
    (["data/raw/demo", "--for", "tips"], "--for: found 'tips', expected one of intervals, tip, grasp, did you mean"),
    (["data/raw/demo", "--only", "tilt"], "--only: found 'tilt', expected some of static_tilt, release"),
    (["data/raw/demo", "--count", "0"], "--count: found 0, expected 1 to 100 trials"),
    (["data/raw/demo", "--error", "nan"], "--error: found nan, expected more than 0"),
    (["data/raw/nowhere"], "no such folder"),
    (["data/raw/demo", "--model", "arm.xml"], "arm.xml: no such file, expected the MJCF of an arm"),
    (["data/raw/demo", "--only", "static_path"], "--only: found static_path, expected one that a stage identifies"),
])  # fmt: skip
def test_a_mistake_is_one_line(project, monkeypatch, capsys, arguments, line):
    monkeypatch.chdir(project)
    assert main(arguments) == 1
    output = capsys.readouterr()
    assert line in output.err.splitlines()[-1]
    assert "Traceback" not in output.err
    assert "suggested" not in output.out


def test_a_cost_that_is_none_is_refused(tmp_path):
    text = (ROOT / "conf/suggest/config.yaml").read_text().replace("static_tilt: 3.0", "static_tilt: 0.0")
    (tmp_path / "config.yaml").write_text(text)
    with pytest.raises(Exception, match=r"minutes.static_tilt: found 0.0, expected"):
        load_folder(Recordable, tmp_path)
