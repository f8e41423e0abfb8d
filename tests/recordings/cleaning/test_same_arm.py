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
from trunkline.recordings.trials.raw_trial import read_raw_trials
from trunkline.recordings.trials.splits import SPLITS
from trunkline.recordings.trials.trial import read_trials
from trunkline.tools.evaluate.session import trials_of

CLOCKS = {"monday": 0.137, "friday": -0.061}  # s, by which the motors' clock is ahead


def set_session(root, lines: str) -> None:
    """lines: of the section `ingest`."""
    (root / "params.yaml").write_text((ROOT / "params.yaml").read_text().replace("session: demo ", f"{lines} #"))


@pytest.fixture(scope="module")
def recorded(tmp_path_factory):
    folder = tmp_path_factory.mktemp("arm_7")
    for seed, (name, clock) in enumerate(CLOCKS.items()):
        record(folder / name, all_truths(), instruments(clock_offset_s=clock), seed)
    return folder


@pytest.fixture
def two(recorded, tmp_path, monkeypatch):
    """A project with an arm of two sessions, which have clocks of their own."""
    workbench(tmp_path)
    shutil.rmtree(tmp_path / "data/raw/demo")
    shutil.copytree(recorded, tmp_path / "data/raw/arm_7")
    set_session(tmp_path, "session: arm_7\n  only: [monday, friday]")
    monkeypatch.chdir(tmp_path)
    return tmp_path


def run_ingest(root) -> None:
    ingest.main(load_config(ingest.Config, "ingest", root))


def test_each_session_has_its_names_and_its_clock(two):
    require_session(two)
    run_ingest(two)
    raw_trials = read_raw_trials(two / "data/processed/ingest", SPLITS)
    assert [raw.name for raw in raw_trials[:4]] == [f"monday/{truth.name}" for truth in all_truths()]
    assert len({raw.name for raw in raw_trials}) == 2 * len(all_truths())
    for raw in raw_trials:
        assert raw.clock_offset == pytest.approx(-CLOCKS[raw.session], abs=0.01)
    quality = json.loads((two / "artifacts/ingest/quality.json").read_text())
    assert len(quality["logs"]) == len(raw_trials)
    assert set(quality["clocks"]) == set(CLOCKS)
    filtering.main(load_config(filtering.Config, "filter", two))
    trials = read_trials(two / "data/processed/filter", SPLITS)
    assert [trial.session for trial in trials] == [raw.session for raw in raw_trials]
    checked = {trial.name: trial.positions.tobytes() for trial in trials_of(two / "data/raw/arm_7", two, "evaluate")}
    assert checked == {trial.name: trial.positions.tobytes() for trial in trials}  # as `check` and `evaluate` read them


def test_without_only_all_sessions_of_the_folder_are_read_by_name(two):
    run_ingest(two)
    listed = {raw.name: raw.clock_offset for raw in read_raw_trials(two / "data/processed/ingest", SPLITS)}
    set_session(two, "session: arm_7")
    require_session(two)
    run_ingest(two)
    raw_trials = read_raw_trials(two / "data/processed/ingest", SPLITS)
    assert {raw.name: raw.clock_offset for raw in raw_trials} == listed
    assert raw_trials[0].session == "friday"


def test_one_of_several_sessions_by_itself_is_as_if_it_were_alone(two):
    files = {}
    shutil.copytree(two / "data/raw/arm_7/monday", two / "data/raw/monday")
    for lines in ("session: arm_7\n  only: [monday]", "session: monday"):
        set_session(two, lines)
        run_ingest(two)
        files[lines] = {f.name: f.read_bytes() for f in (two / "data/processed/ingest").iterdir()}
        assert not any(raw.session for raw in read_raw_trials(two / "data/processed/ingest", SPLITS))
    first, second = files.values()
    assert first == second


@pytest.mark.parametrize(
    ("lines", "message"),
    [
        ("session: [monday, friday]", "ingest.session: found a list, expected one folder: move these sessions into "
         "one, such as data/raw/arm_7, and write session: arm_7, only: [monday, friday]"),
        ("session: arm_7\n  only: [monday, friday, monday]", "ingest.only: found 'monday' twice, expected each"),
        ("session: arm_7\n  only: [monday, fri/day]", "ingest.only.1: found 'fri/day', expected the name of a folder"),
        ("session: arm_7\n  only: [monday, fridy]", "ingest.only: found 'fridy', expected one of the sessions in "
         "data/raw/arm_7: friday, monday, did you mean 'friday'?"),
        ("session: monday\n  only: [monday]", "ingest.only: found 'monday', expected none, as data/raw/monday holds"),
    ],
)  # fmt: skip
def test_what_names_no_sessions_is_refused_in_one_line(two, lines, message):
    shutil.copytree(two / "data/raw/arm_7/monday", two / "data/raw/monday")
    set_session(two, lines)
    with pytest.raises(InputError) as caught:
        run_ingest(two)
    assert message in str(caught.value)
    assert not (two / "data/processed").exists()


def test_another_arm_is_refused(two):
    longer = [replace(t, positions=t.base_position + 1.3 * (t.positions - t.base_position)) for t in all_truths()]
    renamed = [replace(t, markers=tuple(f"part_{name[-2:]}" for name in t.markers)) for t in all_truths()]
    threads = ("thread_1", "thread_2", "thread_3")
    cables = [release_truth(), replace(curl_truth(split="identify"), tendons=threads)]
    for truths, message in ((longer, "from the body before it, expected about"), (renamed, "found markers part_02"),
                         (cables, "found tendons thread_1")):  # fmt: skip
        shutil.rmtree(two / "data/raw/arm_7/friday")
        record(two / "data/raw/arm_7/friday", truths, instruments(), 7)
        with pytest.raises(InputError, match=f"session friday: .*{message}"):
            run_ingest(two)
        assert not (two / "data/processed/ingest").exists()


def test_a_log_in_two_sessions_is_refused(two):
    shutil.rmtree(two / "data/raw/arm_7/friday")
    shutil.copytree(two / "data/raw/arm_7/monday", two / "data/raw/arm_7/friday")
    with pytest.raises(InputError, match="session friday: found .* with the bytes of .* of the session monday"):
        run_ingest(two)
