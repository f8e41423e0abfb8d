"""What cameras measured in a live session is a session: `ingest`, `evaluate` and `monitor` read it, it has what was
there, and a run in which nothing was measured leaves none."""

import json
from dataclasses import replace
from pathlib import Path
from types import SimpleNamespace

import numpy as np
import pytest
import yaml
from mcap.reader import make_reader

from tests.ar.session.test_correction_steps import CHAIN, pulled, tip_of
from tests.ar.teleop.test_plan import MOUNT, OFFSET, START
from tests.support.camera_session import BEGIN, CameraSession, damped, damped_spec
from tests.support.sessions import LIMITS
from trunkline.ar.session import serving
from trunkline.ar.session.__main__ import main
from trunkline.ar.session.arm_cameras import markers_of
from trunkline.ar.session.log_reader import session_log, tip_path
from trunkline.ar.session.measured_session import (
    CUT,
    SPLITS,
    PlanRest,
    PlanRests,
    how_to_identify,
    marker_validation,
    plan_rests,
    write_session,
)
from trunkline.ar.teleop.base_frames import base_frames
from trunkline.pipeline.config import PROJECT
from trunkline.recordings.cleaning.loading import load_raw_trials
from trunkline.recordings.logs.mcap_log import read_log
from trunkline.recordings.session.session import read_session
from trunkline.tools.batch.listing import read_listing
from trunkline.tools.batch.running import prepare
from trunkline.tools.evaluate.__main__ import main as evaluate
from trunkline.tools.monitor.__main__ import main as monitor

BENT = -0.015  # rad, of each joint of the arm at rest: what its twin does not know
WAY = tip_of(CHAIN, pulled(0.02, 0, 0)) - base_frames(START, OFFSET)[0]
PLANS = ((0.0, 0.0, 0.0), (0.05, -0.1, 0.05))  # m, of mounts from MOUNT


@pytest.fixture(scope="module")
def run(tmp_path_factory):
    """Two plans, the second of which corrects itself: the log, its session's folder, and what was true."""
    path = tmp_path_factory.mktemp("run") / "2026-01-01T00-00-00.mcap"
    session = CameraSession(path, damped(BENT))
    names, at_rest, foreseen = session.cameras.names, [], []
    marked = markers_of(damped().twin.model, names)
    rows = [damped().bodies.index(body) for body, _ in marked]

    def markers(bodies):
        pairs = zip(rows, marked, strict=True)
        return np.array([tip_path(bodies[[row]].astype(float), place)[0] for row, (_, place) in pairs])

    for number, shift in enumerate(PLANS):
        session.correct = number == 1
        session.plan(np.array(MOUNT) + shift, np.array(MOUNT) + WAY + shift, 6.0)
        foreseen.append(markers(session.controller.pieces[-1].poses[-1]))
        robot = session.robot.robot_state()
        at_rest.append((markers(robot.bodies), robot.joints, robot.commands, robot.lengths))
    session.close()
    lines = write_session(path)
    return SimpleNamespace(path=path, folder=path.with_suffix(""), lines=lines, names=names, at_rest=at_rest,
                           foreseen=foreseen, straight=damped().commands)  # fmt: skip


def test_the_session_is_what_ingest_reads_with_what_was_there(run):
    session = read_session(run.folder)
    assert not session.even_times, "looks are seldom where nothing moves; each pose is dated by when it was taken"
    assert [(trial.experiment, trial.split) for trial in session.trials] == [
        ("static_pull", split) for split in SPLITS[: len(PLANS)]
    ]
    for (trial, raw, findings), truth in zip(load_raw_trials(run.folder, session, LIMITS), run.at_rest, strict=True):
        markers, joints, commands, lengths = truth
        assert raw.markers == run.names[1:] == ("unit_04", "unit_08"), trial.name
        np.testing.assert_allclose(np.nanmedian(raw.positions, axis=0), markers[1:], atol=5e-4)
        place, turn = base_frames(joints, OFFSET)
        np.testing.assert_allclose(np.nanmedian(raw.base_positions, axis=0), place, atol=5e-4)
        assert np.degrees(np.arccos(np.clip(turn[:, 2] @ raw.up, -1, 1))) < 2.0  # it hangs straight down
        np.testing.assert_allclose(raw.commands[-1], run.straight - commands, atol=1e-9)
        np.testing.assert_allclose(raw.tendon_positions[-1], run.straight - lengths, atol=1e-3)
        assert raw.commands[0].max() < raw.commands[-1].max() or trial.name == "plan_02"  # from before the plan on
        assert findings.warnings == []


def test_a_plans_log_has_what_was_measured_and_sent_and_nothing_of_a_twin(run):
    for file in sorted(run.folder.glob("*.mcap")):
        with open(file, "rb") as log:
            topics = {channel.topic for _, channel, _ in make_reader(log).iter_messages()}
        assert topics == set(CUT)


def test_evaluate_and_monitor_read_it(run, tmp_path, capsys, monkeypatch):
    monkeypatch.chdir(tmp_path)
    spec = damped_spec().copy()
    spec.compile()
    (tmp_path / "arm.xml").write_text(spec.to_xml())
    settings = ["--settings", str(PROJECT)]
    assert evaluate(["arm.xml", str(run.folder), *settings]) == 0
    metrics = json.loads((tmp_path / "evaluation" / run.folder.name / "metrics.json").read_text())
    assert metrics["model"]["by_experiment"]["static_pull"]["trials"] == len(PLANS)
    assert 1.0 < metrics["model"]["by_experiment"]["static_pull"]["e_tip_mm"] < 15.0  # its twin is straight at rest
    assert monitor(["arm.xml", str(run.folder), "--once", *settings]) == 0
    assert "learning: 2 of 15 static_pull" in capsys.readouterr().out


@pytest.mark.parametrize(("count", "words"), [
    (1, "session: found 1 plan at rest and none to validate, expected at least 2 to identify from"),
    (2, "session: to identify from it: trunkline batch run/identify.yaml --until identify_stiffness"),
])  # fmt: skip
def test_a_session_of_a_single_plan_names_no_command_that_would_fail(count, words):
    assert how_to_identify(Path("run"), SPLITS[:count]) == words


def test_one_command_identifies_from_it_and_live_prints_it(run, tmp_path):
    assert run.lines[0] == f"session: {run.folder}: the arm at rest after 2 of 2 plans"
    command = f"trunkline batch {run.folder / 'identify.yaml'} --until identify_stiffness"
    assert run.lines[-1] == f"session: to identify from it: {command}"
    (arm,) = read_listing(run.folder / "identify.yaml").arms
    prepare(arm, tmp_path, "identify_stiffness")
    params = yaml.safe_load((tmp_path / "params.yaml").read_text())
    assert params["ingest"]["session"] == run.folder.name
    assert params["identify_stiffness"]["experiments"] == ["static_pull"]
    assert read_session(tmp_path / "data/raw" / run.folder.name).trials


def test_previews_are_scored_by_markers_before_they_are_corrected(run):
    validation = json.loads((run.folder / "marker_validation.json").read_text())
    assert validation["markers"] == ["unit_04", "unit_08"]
    assert [row["plan"] for row in validation["plans"]] == [1, 2]
    true = 1e3 * np.linalg.norm(run.at_rest[0][0] - run.foreseen[0], axis=1)
    row = validation["plans"][0]
    assert row["last_mm"] == pytest.approx(true[-1], abs=0.4)
    assert row["mean_mm"] == pytest.approx(true[1:].mean(), abs=0.4)
    assert row["mount_mm"] < 1.0 < row["last_mm"]
    after = 1e3 * np.linalg.norm(run.at_rest[1][0] - run.foreseen[1], axis=1)[-1]
    assert validation["plans"][1]["last_mm"] > after + 1.0  # the correction brought it nearer, and does not count
    assert validation["last_mm"] == pytest.approx(np.mean([row["last_mm"] for row in validation["plans"]]), rel=1e-3)


def rest(number, off, corrected=False):
    return PlanRest(number, 0.0, 1.0, 2.0, np.full((2, 3), off), np.zeros((2, 3)), corrected)


def test_what_was_not_foreseen_or_was_corrected_is_not_scored():
    unknown = replace(rest(3, 1.0), foreseen=np.full((2, 3), np.nan))
    rests = (rest(1, 1e-3), rest(1, 5e-3, True), rest(2, 9e-3, True), unknown)
    table = marker_validation(PlanRests(rests, (), ("base", "unit_08")))
    assert [row["plan"] for row in table["plans"]] == [1]
    assert table["last_mm"] == pytest.approx(np.sqrt(3))


def changed(kind, change):
    return lambda events: [event | change if event["event"] == kind else event for event in events]


def without_arrival(events):
    return [event for event in events if event["event"] != "robot" or event["robot"]["mode"] != "done"]


def overtaken(events):
    """Each plan followed at once by another, before the arm is at rest."""
    at_once = [
        {"event": "execute", "time": event["time"] + 0.1, "digest": "x", "refused": ""}
        for event in events
        if event["event"] == "robot" and event["robot"]["mode"] == "done"
    ]
    return sorted([*events, *at_once], key=lambda event: event["time"])


@pytest.mark.parametrize(
    ("change", "reason"),
    [
        (changed("begin", {"measured": []}), "the session had no cameras (--cameras)"),
        (changed("begin", {"mount": ""}), "no body is at the arm's mount"),
        (changed("execute", {"refused": "busy"}), "no plan was executed"),
        (changed("request", {"request": {"targets": {"thing": "the cup"}}}), "the arm grasps or holds something"),
        (changed("world", {"world": {"things": [{"support": "held"}]}}), "the arm grasps or holds something"),
        (without_arrival, "it did not arrive"),
        (overtaken, "the arm was not seen at rest"),
        (lambda events: [*events[:1], {"event": "cameras", "time": BEGIN, "fault": "frozen"}, *events[1:]],
         "cameras: frozen"),
        (changed("begin", {"measured": ["base", "unit_01", "unit_08"]}), "'unit_01' is in 0 % of the poses"),
    ],
)  # fmt: skip
def test_where_nothing_was_measured_it_is_said_why(run, change, reason):
    log = read_log(run.path)
    reader = session_log(log)
    measured = plan_rests(replace(reader, events=change(reader.events)), log)
    assert measured.rests == ()
    assert any(reason in line for line in measured.left_out), measured.left_out


def test_a_run_without_cameras_leaves_no_session(tmp_path):
    session = CameraSession(tmp_path / "run.mcap", cameras=False)
    session.wait(1.0)
    assert write_session(Path(session.close())) == [
        "session: nothing was measured: the session had no cameras (--cameras)"
    ]
    assert not (tmp_path / "run").exists()


def test_live_says_at_its_end_what_was_measured(tmp_path, monkeypatch, capsys):
    """Once all of its processes have ended."""
    closed = []

    class Opened:
        def __init__(self, *_, **__):
            pass

        async def __aenter__(self):
            return SimpleNamespace(composition=SimpleNamespace(token="t")), SimpleNamespace(
                log_writer=SimpleNamespace(path=tmp_path / "run.mcap")
            )

        async def __aexit__(self, *_):
            closed.append(True)

    def ends(*_):
        raise KeyboardInterrupt

    monkeypatch.setattr(serving, "opened", Opened)
    monkeypatch.setattr(serving, "expect_free", lambda address: None)
    monkeypatch.setattr(serving, "_pair", ends)
    monkeypatch.setattr(serving, "write_session", lambda path: [f"{path.name} {closed}"])
    assert main([str(tmp_path)]) == 0
    assert "run.mcap [True]" in capsys.readouterr().out
