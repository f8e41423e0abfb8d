"""`trunkline monitor`: what it finds in a folder, what it says, and that nothing is lost or scored
twice."""

import json
import shutil
from pathlib import Path

import pandas as pd
import pytest

from tests.support.folders import ROOT
from tests.tools.monitor.sessions import TILTS, record, write_model
from trunkline.tools.monitor import pending
from trunkline.tools.monitor.__main__ import main
from trunkline.tools.monitor.monitor import LEARN


@pytest.fixture(scope="module")
def made(tmp_path_factory):
    """A model, sessions of the arm as it is (two of them) and 5 % softer; what the reference scored to is kept."""
    root = tmp_path_factory.mktemp("made")
    (root / "params.yaml").write_text((ROOT / "params.yaml").read_text())
    write_model(root / "arm.xml")
    for name, share, repeats, seed in (("reference", 1.0, 4, 1), ("same", 1.0, 1, 2), ("softer", 0.95, 1, 3)):
        record(root / "sessions" / name, share, repeats, seed)
    (root / "drop").mkdir()
    assert main(words(root)) == 0
    return root


def words(root: Path, *more: str) -> list[str]:
    arguments = [root / "arm.xml", root / "drop", "--reference", root / "sessions/reference", "--settings", root]
    return [*map(str, arguments), "--out", str(root / "out"), "--once", *more]


@pytest.fixture
def lab(made, tmp_path, monkeypatch):
    shutil.copytree(made, tmp_path, dirs_exist_ok=True)
    monkeypatch.chdir(tmp_path)
    shutil.rmtree(tmp_path / "out")  # its reference is of files elsewhere
    shutil.copytree(made / "out", tmp_path / "out")
    return tmp_path


def watch(root: Path, *more: str) -> int:
    return main(words(root, *more))


def drop(root: Path, name: str) -> Path:
    return Path(shutil.copytree(root / "sessions" / name, root / "drop" / name))


def scored(root: Path) -> list[str]:
    rows = [json.loads(line) for line in (root / "out/scores.jsonl").read_text().splitlines()[1:]]
    return [row["trial"] for row in rows if "slope" in row]


def test_an_unchanged_arm_is_within_limits_and_a_softer_one_is_found_within_three_trials(lab, capsys):
    drop(lab, "same")
    assert watch(lab) == 0
    output = capsys.readouterr().out
    assert output.count("within limits") == len(TILTS)
    drop(lab, "softer")
    assert watch(lab) == 1
    output = capsys.readouterr().out
    table = pd.read_csv(lab / "out/chart.csv")
    softer = list(dict.fromkeys(table.trial[table.trial.str.startswith("softer")]))
    assert softer.index(table.trial[table.beyond].iloc[0]) < 3
    explained = next(line for line in output.splitlines() if "explained best by" in line)
    assert "stiffness -" in explained
    assert float(explained.split("stiffness ")[1].split()[0]) == pytest.approx(-5, abs=0.8)
    assert (lab / "out/chart.png").stat().st_size > 10_000


def test_a_reference_of_few_conditions_is_said(lab, capsys):
    shutil.rmtree(lab / "out")
    assert watch(lab) == 0
    output = capsys.readouterr().out
    assert f"reference: {4 * len(TILTS)} static_tilt under {len(TILTS)} conditions" in output
    assert "few conditions of static_tilt, as where a session is planned for identification" in output


def test_nothing_is_scored_twice(lab, capsys):
    drop(lab, "same")
    watch(lab)
    before = (lab / "out/scores.jsonl").read_bytes()
    capsys.readouterr()
    assert watch(lab) == 0
    assert capsys.readouterr().out == f"monitor: {len(TILTS)} of {len(TILTS)} trials judged: no change is seen\n"
    assert (lab / "out/scores.jsonl").read_bytes() == before


def test_a_half_written_log_is_said_in_one_line_and_scored_once_it_is_whole(lab, capsys):
    session = drop(lab, "same")
    log = session / "tilt_50_0.mcap"
    whole = log.read_bytes()
    log.write_bytes(whole[: len(whole) // 2])
    assert watch(lab) == 0
    assert [line for line in capsys.readouterr().out.splitlines() if "not whole yet" in line] == [
        f"monitor: {log}: not whole yet ({len(whole) // 2} bytes, no end): waits until it changes"
    ]
    assert len(scored(lab)) == len(TILTS) - 1
    log.write_bytes(whole[: 2 * len(whole) // 3])
    watch(lab)
    (line,) = capsys.readouterr().out.splitlines()  # it grows: said before
    assert line == f"monitor: {len(TILTS) - 1} of {len(TILTS) - 1} trials judged: no change is seen"
    log.write_bytes(whole)
    watch(lab)
    assert "tilt_50_0: within limits" in capsys.readouterr().out
    assert sorted(scored(lab)) == sorted(f"tilt_{angle:.0f}_0" for angle in TILTS)


def test_a_log_that_was_cut_off_is_taken_in_the_end(lab, capsys, monkeypatch):
    session = drop(lab, "same")
    log = session / "tilt_50_0.mcap"
    log.write_bytes(log.read_bytes()[:-9])
    watch(lab)
    assert len(scored(lab)) == len(TILTS) - 1
    monkeypatch.setattr(pending, "PATIENCE", 0.0)
    watch(lab)
    assert "taken with what is left" in capsys.readouterr().out
    assert len(scored(lab)) == len(TILTS)


def test_a_log_that_is_named_and_yet_to_come_is_awaited(lab):
    session = drop(lab, "same")
    elsewhere = lab / "tilt_50_0.mcap"
    (session / elsewhere.name).rename(elsewhere)
    assert watch(lab) == 0
    assert len(scored(lab)) == len(TILTS) - 1
    elsewhere.rename(session / elsewhere.name)
    watch(lab)
    assert len(scored(lab)) == len(TILTS)


def test_a_session_with_a_mistake_stops_no_other_and_is_scored_once_it_is_put_right(lab, capsys):
    drop(lab, "same")
    wrong = drop(lab, "softer")
    text = (wrong / "session.yaml").read_text()
    (wrong / "session.yaml").write_text(text.replace("experiment: static_tilt", "experiment: tilted", 1))
    assert watch(lab) == 2
    lines = [line for line in capsys.readouterr().out.splitlines() if "softer" in line]
    assert len(lines) == 1
    assert f"{wrong}/session.yaml: trials.0.experiment: found 'tilted', expected" in lines[0]
    assert len(scored(lab)) == len(TILTS)
    (wrong / "session.yaml").write_text(text)
    assert watch(lab) == 1
    assert len(scored(lab)) == 2 * len(TILTS)


def test_a_trial_of_another_arm_is_refused_in_one_line(lab, capsys):
    session = drop(lab, "same")
    text = (session / "session.yaml").read_text()
    named = "markers: {unit_01: unit_01, unit_02: joint_02}\n"
    (session / "session.yaml").write_text(text.replace("trials:", f"{named}trials:"))
    assert watch(lab) == 2
    *lines, last = capsys.readouterr().out.splitlines()
    assert last == "monitor: 0 of 0 trials judged"
    assert len(lines) == len(TILTS)
    assert all("refused: session.yaml: markers: " in line and "found 'joint_02'" in line for line in lines)


def test_a_model_that_does_not_fit_the_reference_is_refused_in_one_line(lab, capsys):
    write_model(lab / "arm.xml", "link_")
    assert watch(lab, "--out", str(lab / "other")) == 2
    assert "error: session.yaml: markers: trial tilt_35_0: found 'unit_01', expected" in capsys.readouterr().err


def test_the_state_of_another_model_is_refused(lab, capsys):
    drop(lab, "same")
    assert watch(lab) == 0
    text = (lab / "arm.xml").read_text()
    (lab / "arm.xml").write_text(text + "\n")
    assert watch(lab) == 2
    assert "found scores of other model, expected the same; begin anew with --out" in capsys.readouterr().err


def test_without_a_reference_the_first_trials_of_a_kind_stand_for_the_unchanged_arm(lab, capsys):
    shutil.copytree(lab / "sessions/reference", lab / "drop/a")
    drop(lab, "softer")
    words = [str(lab / "arm.xml"), str(lab / "drop"), "--settings", str(lab), "--out", str(lab / "learned"), "--once"]
    assert main(words) == 1
    output = capsys.readouterr().out
    assert output.count("kept to learn from") == LEARN
    assert f"of {LEARN + len(TILTS) + 1} trials judged: the arm has changed" in output
    assert "explained best by stiffness -" in output


def test_a_folder_that_is_not_there_is_refused_in_one_line(lab, capsys):
    arguments = [str(lab / "arm.xml"), str(lab / "nowhere"), "--settings", str(lab), "--out", str(lab / "o"), "--once"]
    assert main(arguments) == 2
    assert "nowhere: no such folder, expected one into which sessions are dropped" in capsys.readouterr().err
