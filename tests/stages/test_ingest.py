"""The ingest stage: what it writes, and that a bad session ends in one line and nothing half-written."""

import errno
import json

import pytest
from mcap.reader import make_reader
from mcap_ros2.decoder import DecoderFactory
from mcap_ros2.writer import Writer as RosWriter

from stages import ingest
from tests.support.sessions import MARKERS
from tests.support.workbench import workbench
from trunkline.pipeline.stage import run_stage
from trunkline.recordings.logs.definitions import RIGID_BODIES
from trunkline.recordings.trials.raw_trial import read_raw_trials
from trunkline.recordings.trials.splits import SPLITS


@pytest.fixture
def project(tmp_path, monkeypatch):
    monkeypatch.chdir(workbench(tmp_path))
    return tmp_path


def run(capsys) -> tuple[int, str]:
    """(exit code, what went to stderr)"""
    try:
        run_stage("ingest", ingest.Config, ingest.main)
    except SystemExit as stop:
        return stop.code, capsys.readouterr().err
    return 0, capsys.readouterr().err


def set_param(project, old, new):
    path = project / "params.yaml"
    assert old in path.read_text()
    path.write_text(path.read_text().replace(old, new, 1))


def test_takes_report_and_metrics(project, capsys):
    code, output = run(capsys)
    assert code == 0
    warnings = [line.removeprefix("ingest: warning: ") for line in output.splitlines()]
    assert [line.split(":")[1].strip() for line in warnings] == ["splits", "experiments", "splits", "splits"]
    assert warnings[0].startswith("all trials: splits: no trial of the split test")
    assert warnings[1].startswith("all trials: experiments: no static_pull, motion in the session")
    raw_trials = read_raw_trials(ingest.PROCESSED, SPLITS)
    assert [raw.name for raw in raw_trials] == ["tilt_00", "tilt_60", "release_a", "curl_40"]
    assert {raw.markers for raw in raw_trials} == {MARKERS}
    metrics = json.loads((ingest.ARTIFACTS / "metrics.json").read_text())
    assert metrics["trials"] == 4
    assert metrics["refused"] == 0
    assert metrics["repairs"] == {"identify": 0, "validate": 0, "total": 0}
    assert metrics["warnings"] == 4 * 4
    assert metrics["position_noise_mm"] == pytest.approx(0.3, rel=0.15)
    assert metrics["orientation_noise_deg"] == pytest.approx(0.3, rel=0.15)
    assert metrics["clock_offset_ms"] == pytest.approx(-137, abs=0.5)
    assert metrics["clock_uncertainty_ms"] == pytest.approx(2.5, abs=1.5)
    assert metrics["clock_lag_ms"] == pytest.approx(0, abs=8)
    assert metrics["rate_hz"] == pytest.approx(120, rel=1e-3)
    report = json.loads((ingest.ARTIFACTS / "quality.json").read_text())
    for trial in report["trials"].values():
        assert [f"all trials: {warning}" for warning in trial["warnings"]] == warnings
    assert report["trials"]["release_a"]["stamp_jitter_ms"] == pytest.approx(1.0, rel=0.3)
    assert set(report["trials"]["release_a"]["coverage"]) == set(MARKERS)
    assert (ingest.ARTIFACTS / "quality.png").stat().st_size > 20_000


def test_two_runs_write_the_same_bytes(project, capsys):
    run(capsys)
    files = [path for folder in (ingest.PROCESSED, ingest.ARTIFACTS) for path in sorted(folder.iterdir())]
    before = [path.read_bytes() for path in files]
    run(capsys)
    assert [path.read_bytes() for path in files] == before


def empty(session):
    for path in session.iterdir():
        path.unlink()


def truncate(session):
    path = session / "curl_40.mcap"
    path.write_bytes(path.read_bytes()[:3000])


def no_mcap(session):
    (session / "tilt_60.mcap").write_text("time,x,y,z\n")


def missing(session):
    (session / "release_a.mcap").unlink()


def mislabel(session):
    path = session / "session.yaml"
    right, wrong = "release_a.mcap, experiment: release", "release_a.mcap, experiment: static_tilt, level: 0"
    path.write_text(path.read_text().replace(right, wrong))


def never(session):
    path = session / "session.yaml"
    path.write_text(path.read_text() + "markers: {unit_08: unit_08, unit_09: unit_09}\n")


def rewritten(change, late=False, **options):
    """What writes release_a.mcap anew after `change` of each message of poses (number, content)."""

    def spoil(session):
        path = session / "release_a.mcap"
        with open(path, "rb") as file:
            reader = make_reader(file, decoder_factories=[DecoderFactory()])
            read = [decoded[2:] for decoded in reader.iter_decoded_messages(topics=["/rigid_bodies"])]
        with open(path, "wb") as file, RosWriter(file, **options) as writer:
            schema = writer.register_msgdef("mocap4r2_msgs/msg/RigidBodies", RIGID_BODIES)
            for number, (message, content) in enumerate(read):
                change(number, content)
                time = message.log_time + (2**63 if late else 0)
                writer.write_message("/rigid_bodies", schema, content, time, message.publish_time, number)

    return spoil


def no_bodies_in_every_second(number, content):
    content.rigidbodies = content.rigidbodies[: None if number % 2 else 0]


def turned_by_nothing(number, content):
    for body in content.rigidbodies:
        body.pose.orientation.w *= 3


SHORT = "{name: short, file: curl_40.mcap, window: [0, 0.2], experiment: curl, level: 40, split: validate}"


def twice(number, content):
    content.rigidbodies = [*content.rigidbodies, *content.rigidbodies]


@pytest.mark.parametrize(
    ("spoil", "culprits"),
    [
        (empty, ["data/raw/demo", "found 0 logs and no session.yaml"]),
        (truncate, ["curl_40.mcap", "cut off at byte 3000"]),
        (no_mcap, ["tilt_60.mcap", "found no MCAP file"]),
        (missing, ["session.yaml", "trials.2.file", "release_a.mcap"]),
        (mislabel, ["release_a.mcap: trial release_a: experiment: 'unit_08' moves by", "in a static_tilt"]),
        (never, ["tilt_00.mcap", "'unit_09' never appears", "`markers` in session.yaml"]),
        (rewritten(no_bodies_in_every_second), ["release_a.mcap", "never in four in a row"]),
        (rewritten(turned_by_nothing), ["release_a.mcap", "'base' is seen in 0.0 %", "unnormalised quaternion"]),
        (rewritten(twice), ["release_a.mcap", "found 'base' twice in a message"]),
        (rewritten(lambda number, content: None, late=True), ["release_a.mcap", "log time beyond the year 2262"]),
    ],
)
def test_bad_session_ends_in_one_line_and_leaves_nothing(project, capsys, spoil, culprits):
    spoil(project / "data/raw/demo")
    set_param(project, "ingest:\n", "ingest:\n  refused_trials: stop\n")
    code, stderr = run(capsys)
    assert code == 1
    assert stderr.startswith("error: ")
    assert stderr.count("\n") == 1
    for culprit in culprits:
        assert culprit in stderr
    assert not (project / "artifacts").exists()
    assert not (project / "data/processed").exists()


def test_a_failing_run_keeps_the_results_of_the_one_before(project, capsys):
    run(capsys)
    before = (ingest.ARTIFACTS / "metrics.json").read_bytes()
    truncate(project / "data/raw/demo")
    assert run(capsys)[0] == 1
    assert (ingest.ARTIFACTS / "metrics.json").read_bytes() == before


def test_a_trial_can_be_left_out_and_is_reported(project, capsys):
    plan = project / "data/raw/demo/session.yaml"
    plan.write_text(f"{plan.read_text()}  - {SHORT}\n")
    code, stderr = run(capsys)
    assert code == 0
    assert "ingest: warning: left out: data/raw/demo/curl_40.mcap: trial short: found 0." in stderr
    report = json.loads((ingest.ARTIFACTS / "quality.json").read_text())
    assert list(report["refused"]) == ["short"]
    assert json.loads((ingest.ARTIFACTS / "metrics.json").read_text())["clock_spread_ms"] < 1, "of the others"
    set_param(project, "ingest:\n", "ingest:\n  refused_trials: stop\n")
    code, stderr = run(capsys)
    assert (code, stderr.count("\n")) == (1, 1), "a setting can have it stop"
    assert "trial short: found 0." in stderr


def test_what_is_left_without_a_refused_trial_has_to_be_enough(project, capsys):
    truncate(project / "data/raw/demo")
    code, stderr = run(capsys)
    assert code == 1
    assert "cut off at byte 3000" in stderr
    assert stderr.endswith("expected another curl of the split validate to go on with\n")
    for log in (project / "data/raw/demo").glob("*.mcap"):
        log.write_bytes(b"")
    code, stderr = run(capsys)
    assert code == 1
    assert "all 4 trials refused" in stderr


@pytest.mark.parametrize(
    ("old", "new", "message"),
    [
        ("session: demo", "sesion: demo", "ingest.sesion: unknown key, did you mean 'session'?"),
        ("session: demo", "session: 3", "ingest.session: found 3"),
        ("session: demo", "session: ..", "ingest.session: found '..', expected the name of a folder"),
        ("session: demo", "session: .", "ingest.session: found '.', expected the name of a folder"),
        ("session: demo", "session: ../x", "ingest.session: found '../x', expected the name of a folder"),
        ("session: demo", "session: nowhere", "a session.yaml; found demo"),
        ("session: demo", "session: demo\n  limits: {coverage: 1.5}", "ingest.limits.coverage: found 1.5"),
    ],
)
def test_bad_settings_are_one_line(project, capsys, old, new, message):
    set_param(project, old, new)
    code, stderr = run(capsys)
    assert code == 1
    assert message in stderr
    assert stderr.count("\n") == 1


def test_logs_without_checksums_are_said(project, capsys):
    run_stage("ingest", ingest.Config, ingest.main)
    assert "checksums" not in capsys.readouterr().out
    rewritten(lambda number, content: None, enable_crcs=False)(project / "data/raw/demo")
    run_stage("ingest", ingest.Config, ingest.main)
    output = capsys.readouterr().out
    assert "ingest: 1 of 4 logs have messages without checksums, such as release_a.mcap" in output
    logs = json.loads((ingest.ARTIFACTS / "quality.json").read_text())["logs"]
    assert logs["tilt_00.mcap"]["without_checksum"] == 0
    assert logs["release_a.mcap"]["without_checksum"] == logs["release_a.mcap"]["messages"] > 0


def test_a_full_disk_is_one_line_and_leaves_nothing(project, capsys, monkeypatch):
    def full(*arguments):
        raise OSError(errno.ENOSPC, "No space left on device")

    monkeypatch.setattr(ingest, "write_raw_trials", full)
    code, stderr = run(capsys)
    assert (code, stderr) == (1, "error: [Errno 28] No space left on device\n")
    assert not any(path for folder in (project / "artifacts", project / "data/processed") for path in folder.iterdir())
