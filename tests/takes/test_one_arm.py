"""Several sessions of one arm through `ingest` and `filter`: names, clocks, and what is refused."""

import json
import shutil
from dataclasses import replace

import pytest

from stages import filter as filtering
from stages import ingest
from tests.support.sessions import all_truths, curl_truth, instruments, record, release_truth
from tests.support.workbench import ROOT, workbench
from trunkline.errors import InputError
from trunkline.pipeline.config import load_config
from trunkline.pipeline.settings import require_session
from trunkline.trials.splits import SPLITS
from trunkline.trials.take import read_takes
from trunkline.trials.trial import read_trials

CLOCKS = {"monday": 0.137, "friday": -0.061}  # s, by which the motors' clock is ahead


def project(folder, session: str):
    workbench(folder)
    params = (ROOT / "params.yaml").read_text().replace("session: demo ", f"session: {session} ")
    (folder / "params.yaml").write_text(params)
    return folder


@pytest.fixture
def two(tmp_path, monkeypatch):
    """A project whose two sessions have clocks of their own."""
    project(tmp_path, "[monday, friday]")
    shutil.rmtree(tmp_path / "data/raw/demo")
    for seed, (name, clock) in enumerate(CLOCKS.items()):
        record(tmp_path / "data/raw" / name, all_truths(), instruments(clock_offset_s=clock), seed)
    monkeypatch.chdir(tmp_path)
    return tmp_path


def run_ingest(root) -> None:
    ingest.main(load_config(ingest.Config, "ingest", root))


def test_each_session_has_its_names_and_its_clock(two):
    require_session(two)
    run_ingest(two)
    takes = read_takes(two / "data/processed/ingest", SPLITS)
    assert [take.name for take in takes[:4]] == [f"monday/{truth.name}" for truth in all_truths()]
    assert len({take.name for take in takes}) == 2 * len(all_truths())
    for take in takes:
        assert take.clock_offset == pytest.approx(-CLOCKS[take.session], abs=0.01)
    quality = json.loads((two / "artifacts/ingest/quality.json").read_text())
    assert len(quality["logs"]) == len(takes)
    assert set(quality["clocks"]) == set(CLOCKS)
    filtering.main(load_config(filtering.Config, "filter", two))
    trials = read_trials(two / "data/processed/filter", SPLITS)
    assert [trial.session for trial in trials] == [take.session for take in takes]


def test_a_folder_of_sessions_is_read_as_all_of_them(two):
    run_ingest(two)
    listed = {take.name: take.clock_offset for take in read_takes(two / "data/processed/ingest", SPLITS)}
    for name in CLOCKS:
        shutil.move(two / "data/raw" / name, two / "data/raw/arm_7" / name)
    (two / "params.yaml").write_text((ROOT / "params.yaml").read_text().replace("session: demo ", "session: arm_7 "))
    require_session(two)
    run_ingest(two)
    assert {take.name: take.clock_offset for take in read_takes(two / "data/processed/ingest", SPLITS)} == listed


def test_a_list_of_one_is_the_session_itself(tmp_path, monkeypatch):
    monkeypatch.chdir(project(tmp_path, "demo"))
    files = {}
    for session in ("demo", "[demo]"):
        text = (ROOT / "params.yaml").read_text().replace("session: demo ", f"session: {session} ")
        (tmp_path / "params.yaml").write_text(text)
        run_ingest(tmp_path)
        files[session] = {f.name: f.read_bytes() for f in (tmp_path / "data/processed/ingest").iterdir()}
    assert files["demo"] == files["[demo]"]
    assert not any(take.session for take in read_takes(tmp_path / "data/processed/ingest", SPLITS))


@pytest.mark.parametrize(
    ("names", "said"),
    [
        ("[]", "found an empty list, expected the name of a session, or several"),
        ("[monday, friday, monday]", "found 'monday' twice, expected each session once"),
        ("[monday, fri/day]", "expected the name of a folder"),
    ],
)
def test_a_list_that_names_no_sessions_is_refused_in_one_line(tmp_path, names, said):
    project(tmp_path, names)
    with pytest.raises(InputError, match=said) as caught:
        load_config(ingest.Config, "ingest", tmp_path)
    assert "\n" not in str(caught.value)
    assert "ingest.session" in str(caught.value)


def test_a_session_that_is_not_there_is_named(two):
    shutil.rmtree(two / "data/raw/friday")
    with pytest.raises(InputError, match="ingest.session: found 'friday', expected one of the sessions"):
        require_session(two)


def test_another_arm_is_refused(two):
    longer = [replace(t, positions=t.base_position + 1.3 * (t.positions - t.base_position)) for t in all_truths()]
    renamed = [replace(t, segments=tuple(f"part_{name[-2:]}" for name in t.segments)) for t in all_truths()]
    threads = ("thread_1", "thread_2", "thread_3")
    cables = [release_truth(), replace(curl_truth(split="identify"), tendons=threads)]
    for truths, said in ((longer, "from the body before it, expected about"), (renamed, "found segments part_02"),
                         (cables, "found tendons thread_1")):  # fmt: skip
        shutil.rmtree(two / "data/raw/friday")
        record(two / "data/raw/friday", truths, instruments(), 7)
        with pytest.raises(InputError, match=f"session friday: .*{said}"):
            run_ingest(two)
        assert not (two / "data/processed/ingest").exists()


def test_a_log_in_two_sessions_is_refused(two):
    shutil.rmtree(two / "data/raw/friday")
    shutil.copytree(two / "data/raw/monday", two / "data/raw/friday")
    with pytest.raises(InputError, match="session friday: found .* with the bytes of .* of the session monday"):
        run_ingest(two)
