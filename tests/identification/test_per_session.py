"""Several sessions of one arm, identified together: what they share is told better, what each has is its own."""

import json
from dataclasses import replace
from pathlib import Path

import mujoco
import numpy as np
import pytest

from tests.identification.test_stage import metrics_of, settings
from tests.support.matched_plant import begin_project, tilt
from tests.support.noisy_trials import with_values
from tests.support.small_arm import small_spec
from trunkline.errors import InputError
from trunkline.identification.parameters.parameters import PARAMETERS
from trunkline.identification.parameters.per_session import make_room, model_in, per_session_names
from trunkline.pipeline.identify import CAD_MODEL, run
from trunkline.recordings.trials.trial import write_trials

NOISE = 3e-4  # m
MOUNTS = {"monday": (0.02, -0.03), "friday": (-0.04, 0.03)}  # rad, about x and y: some 3.4 degrees apart about each
STIFFNESS = 0.75  # of the true arm over the CAD model's
NAMES = ("mount_tilt_x", "mount_tilt_y")


def mounted(truth: mujoco.MjModel, mount: tuple[float, float]) -> mujoco.MjModel:
    """The arm on a mount that leans by so much about x and y, rad."""
    return with_values(truth, dict(zip(NAMES, mount, strict=True)))


def session_of(truth: mujoco.MjModel, session: str, seed: int) -> list:
    """Tilts of the arm on the mount of that session, some of them held out."""
    arm = mounted(truth, MOUNTS[session])
    plan = [(25, "identify"), (45, "identify"), (65, "identify"), (85, "identify"), (55, "validate"), (75, "validate")]
    trials = [tilt(arm, angle, split, NOISE, seed + i) for i, (angle, split) in enumerate(plan)]
    return [replace(t, session=session, name=f"{session}/{t.name}") for t in trials]


@pytest.fixture(scope="module")
def identified(tmp_path_factory):
    """By what was identified: metrics, the table of parameters, and the model. And the true stiffness."""
    results = {}
    with pytest.MonkeyPatch.context() as patch:
        patch.setattr("trunkline.identification.fit.intervals.RESAMPLINGS", 2000)
        patch.chdir(tmp_path_factory.mktemp("sessions"))
        model = begin_project(Path("."), 6)
        middle = model.jnt_stiffness[0]
        truth = with_values(model, {"stiffness": STIFFNESS * middle})
        days = {session: session_of(truth, session, seed) for session, seed in (("monday", 0), ("friday", 100))}
        alone = {s: [replace(t, session="") for t in trials] for s, trials in days.items()}
        cases = alone | {"together": [*days["monday"], *days["friday"]],
                         "as one": [*alone["monday"], *alone["friday"]]}  # fmt: skip
        ranges = {"stiffness": (0.3 * middle, 3 * middle)} | dict.fromkeys(NAMES, (-0.1, 0.1))
        for name, trials in cases.items():
            write_trials(Path("data/processed/filter"), trials)
            run("identify_stiffness", settings(["static_tilt"], ["static_tilt"], ranges), CAD_MODEL)
            folder = Path("artifacts/identify_stiffness")
            table = json.loads((folder / "parameters.json").read_text())
            results[name] = (
                metrics_of(Path("."), "identify_stiffness"), table,
                mujoco.MjModel.from_xml_path(str(folder / "arm.xml")),
            )  # fmt: skip
        results["truth"] = STIFFNESS * middle
    return results


def held_out(case) -> float:
    return case[0]["identified"]["validate"]["e_position_mm"]


def half_width(case) -> float:
    low, high = np.log(case[1]["parameters"]["stiffness"]["interval_95_given_model"])
    return (high - low) / 2


def test_each_session_gets_its_own_mount_and_both_one_stiffness(identified):
    _, table, model = identified["together"]
    assert table["parameters"]["stiffness"]["value"] == pytest.approx(identified["truth"], rel=0.01)
    for i, name in enumerate(NAMES):
        assert table["parameters"][name]["value"] == pytest.approx(MOUNTS["monday"][i], abs=0.002)
        assert table["per_session"][f"{name}@friday"]["value"] == pytest.approx(MOUNTS["friday"][i], abs=0.002)
    assert set(table["correlation"]) == {"stiffness", *NAMES}  # what others read knows one session


def test_held_out_errors_together_are_those_of_each_alone_and_far_below_those_as_one(identified):
    alone = np.mean([held_out(identified[session]) for session in MOUNTS])
    assert held_out(identified["together"]) < 1.2 * alone
    assert held_out(identified["as one"]) > 5 * held_out(identified["together"])


def test_two_sessions_tell_stiffness_better_than_one(identified):
    assert half_width(identified["together"]) < 0.9 * min(half_width(identified[session]) for session in MOUNTS)


def test_the_written_model_holds_both_mounts(identified):
    model = identified["together"][2]
    assert model_in("monday", model) is model
    for session, mount in MOUNTS.items():
        turned = model_in(session, model).body("base").quat
        np.testing.assert_allclose(2 * turned[1:3], mount, atol=0.002)


def test_what_a_session_has_for_itself_may_be_its_shape_at_rest():
    spec = small_spec(6)
    names = per_session_names(["stiffness", "rest_bend_x", "mount_tilt_x"], ["rest_bend_x"], ["friday"])
    make_room(spec, names)
    model = with_values(spec.compile(), {"rest_bend_x": 0.01, "rest_bend_x@friday": 0.03})
    read = PARAMETERS["rest_bend_x"].read
    assert names == {"rest_bend_x@friday": "rest_bend_x"}
    assert (read(model), read(model_in("friday", model))) == pytest.approx((0.01, 0.03))
    assert read(model_in("monday", model)) == pytest.approx(0.01)


def test_a_single_session_leaves_no_trace_of_several(identified):
    _, table, model = identified["monday"]
    assert "per_session" not in table
    assert not any("@" in model.numeric(i).name for i in range(model.nnumeric))


@pytest.mark.parametrize("unidentifiable", ["monday", "friday"])
def test_a_session_that_does_not_tell_its_mount_is_refused(tmp_path, monkeypatch, unidentifiable):
    monkeypatch.chdir(tmp_path)
    model = begin_project(tmp_path, 6)
    days = [*session_of(model, "monday", 0), *session_of(model, "friday", 9)]
    retained = [trial for trial in days if trial.session != unidentifiable or trial.split == "validate"]
    write_trials(tmp_path / "data/processed/filter", retained)
    ranges = {"stiffness": (0.1, 10.0), "mount_tilt_x": (-0.1, 0.1)}
    pattern = f"mount_tilt_x: found no static_tilt of the session {unidentifiable} with split identify"
    with pytest.raises(InputError, match=pattern):
        run("identify_stiffness", settings(["static_tilt"], ["static_tilt"], ranges), CAD_MODEL)
