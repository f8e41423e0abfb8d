"""Trials and raw trials come back from Parquet as they were."""

import numpy as np
import pyarrow.parquet as pq
import pytest

from trunkline.errors import InputError
from trunkline.recordings.trials.raw_trial import RawTrial, read_raw_trials, write_raw_trials
from trunkline.recordings.trials.splits import SPLITS
from trunkline.recordings.trials.trial import Trial, read_trials, write_trials

RNG = np.random.default_rng(0)


def trial(name, frames, markers, tendons, oriented):
    return Trial(
        name=name,
        experiment="curl",
        split="identify",
        level=20.0 if tendons else None,
        load=0.25,
        gravity=RNG.normal(size=3),
        time=np.arange(frames) / 120,
        markers=tuple(f"unit_{i}" for i in range(markers)),
        positions=RNG.normal(size=(frames, markers, 3)),
        quaternions=RNG.normal(size=(frames, markers, 4)) if oriented else None,
        measured=RNG.random((frames, markers)) < 0.5,
        tendons=tuple(f"tendon_{i}" for i in range(tendons)),
        commands=RNG.normal(size=(frames, tendons)),
        tendon_positions=RNG.normal(size=(frames, tendons)),
        start=0.5,
        start_sigma=0.003,
        repairs=2,
    )


def raw(name, frames, markers, tendons, commands, oriented):
    return RawTrial(
        name=name,
        experiment="release",
        split="validate",
        level=None,
        load=0.1,
        up=np.array([0.0, 1, 0]),
        time=np.arange(frames) / 120,
        markers=tuple(f"unit_{i}" for i in range(markers)),
        positions=np.where(RNG.random((frames, markers, 1)) < 0.2, np.nan, 1.5) * np.ones(3),
        quaternions=RNG.normal(size=(frames, markers, 4)) if oriented else None,
        base_positions=RNG.normal(size=(frames, 3)),
        base_quaternions=RNG.normal(size=(frames, 4)),
        tendons=tuple(f"tendon_{i}" for i in range(tendons)),
        command_time=np.arange(commands) / 100,
        commands=RNG.normal(size=(commands, tendons)),
        tendon_time=np.arange(2 * commands) / 200,
        tendon_positions=RNG.normal(size=(2 * commands, tendons)),
        clock_offset=-0.137,
        repairs=1,
    )


@pytest.mark.parametrize(
    ("rows", "write", "read"),
    [
        ([trial("a", 5, 3, 3, True), trial("b", 1, 4, 0, False)], write_trials, read_trials),
        (
            [raw("a", 7, 3, 2, 4, True), raw("b", 5, 2, 0, 0, False), raw("c", 6, 1, 1, 3, True)],
            write_raw_trials,
            read_raw_trials,
        ),
    ],
)
def test_round_trip(tmp_path, rows, write, read):
    write(tmp_path, rows)
    result = read(tmp_path, SPLITS)
    assert len(result) == len(rows)
    for row, copy in zip(rows, result, strict=True):
        for key, value in vars(row).items():
            if isinstance(value, np.ndarray):
                np.testing.assert_array_equal(getattr(copy, key), value, err_msg=key)
            else:
                assert getattr(copy, key) == value, key


@pytest.mark.parametrize(("read", "stage"), [(read_raw_trials, "ingest"), (read_trials, "filter")])
def test_missing_tables_name_the_file_and_the_stage_to_run(tmp_path, read, stage):
    with pytest.raises(InputError, match=rf"trials\.parquet: no such file, .*dvc repro {stage}"):
        read(tmp_path, SPLITS)
    (tmp_path / "trials.parquet").write_bytes(b"")
    with pytest.raises(InputError, match=rf"trials\.parquet: not readable as Parquet, .*dvc repro {stage}"):
        read(tmp_path, SPLITS)


def test_the_unit_of_commands_comes_back_and_has_no_column_where_all_are_lengths(tmp_path):
    forced, plain = trial("b", 4, 2, 2, True), trial("a", 5, 2, 2, True)
    forced.command_unit = "N"
    for trials, units in (([plain, forced], ["m", "N"]), ([plain], ["m"])):
        write_trials(tmp_path, trials)
        assert [each.command_unit for each in read_trials(tmp_path, SPLITS)] == units
    assert "command_unit" not in pq.read_schema(tmp_path / "trials.parquet").names
