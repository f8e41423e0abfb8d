"""The ingest stage: what it writes, and that a bad session ends in one line and nothing half-written."""

import json

import pytest

from stages import ingest
from tests.support.sessions import SEGMENTS
from tests.support.workbench import workbench
from trunkline.pipeline.stage import run_stage
from trunkline.trials.splits import SPLITS
from trunkline.trials.take import read_takes


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
    assert run(capsys) == (0, "")
    takes = read_takes(ingest.PROCESSED, SPLITS)
    assert [take.name for take in takes] == ["tilt_00", "tilt_60", "release_a", "curl_40"]
    assert {take.segments for take in takes} == {SEGMENTS}
    metrics = json.loads((ingest.ARTIFACTS / "metrics.json").read_text())
    assert metrics["trials"] == 4
    assert metrics["refused"] == metrics["repairs"] == 0
    assert metrics["position_noise_mm"] == pytest.approx(0.3, rel=0.15)
    assert metrics["orientation_noise_deg"] == pytest.approx(0.3, rel=0.15)
    assert metrics["clock_offset_ms"] == pytest.approx(-137, abs=8)
    assert metrics["rate_hz"] == pytest.approx(120, rel=1e-3)
    report = json.loads((ingest.ARTIFACTS / "quality.json").read_text())
    assert report["trials"]["release_a"]["stamp_jitter_ms"] == pytest.approx(1.0, rel=0.3)
    assert set(report["trials"]["release_a"]["coverage"]) == set(SEGMENTS)
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


def never(session):
    path = session / "session.yaml"
    path.write_text(path.read_text() + "segments: {unit_08: unit_08, unit_09: unit_09}\n")


@pytest.mark.parametrize(
    ("spoil", "culprits"),
    [
        (empty, ["data/raw/demo", "found 0 logs and no session.yaml"]),
        (truncate, ["curl_40.mcap", "cut off at byte 3000"]),
        (no_mcap, ["tilt_60.mcap", "found no MCAP file"]),
        (missing, ["session.yaml", "trials.2.file", "release_a.mcap"]),
        (never, ["tilt_00.mcap", "'unit_09' never appears"]),
    ],
)
def test_bad_session_ends_in_one_line_and_leaves_nothing(project, capsys, spoil, culprits):
    spoil(project / "data/raw/demo")
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
    truncate(project / "data/raw/demo")
    set_param(project, "ingest:\n", "ingest:\n  refused_trials: leave_out\n")
    assert run(capsys)[0] == 0
    report = json.loads((ingest.ARTIFACTS / "quality.json").read_text())
    assert list(report["refused"]) == ["curl_40"]
    assert "cut off at byte 3000" in report["refused"]["curl_40"]
    assert json.loads((ingest.ARTIFACTS / "metrics.json").read_text())["clock_spread_ms"] is None
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
        ("session: demo", "session: nowhere", "data/raw/nowhere: no such folder"),
        ("session: demo", "session: demo\n  limits: {coverage: 1.5}", "ingest.limits.coverage: found 1.5"),
    ],
)
def test_bad_settings_are_one_line(project, capsys, old, new, message):
    set_param(project, old, new)
    code, stderr = run(capsys)
    assert code == 1
    assert message in stderr
    assert stderr.count("\n") == 1
