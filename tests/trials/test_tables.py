"""Trials and takes come back from Parquet as they were."""

import numpy as np
import pytest

from trunkline.errors import InputError
from trunkline.trials.take import Take, read_takes, write_takes
from trunkline.trials.trial import Trial, read_trials, write_trials

RNG = np.random.default_rng(0)


def trial(name, frames, segments, tendons, oriented):
    return Trial(
        name,
        "curl",
        "identify",
        20.0 if tendons else None,
        RNG.normal(size=3),
        np.arange(frames) / 120,
        tuple(f"unit_{i}" for i in range(segments)),
        RNG.normal(size=(frames, segments, 3)),
        RNG.normal(size=(frames, segments, 4)) if oriented else None,
        RNG.random((frames, segments)) < 0.5,
        tuple(f"tendon_{i}" for i in range(tendons)),
        RNG.normal(size=(frames, tendons)),
        RNG.normal(size=(frames, tendons)),
        0.5,
    )


def take(name, frames, segments, tendons, commands, oriented):
    return Take(
        name,
        "release",
        "validate",
        None,
        np.array([0.0, 1, 0]),
        np.arange(frames) / 120,
        tuple(f"unit_{i}" for i in range(segments)),
        np.where(RNG.random((frames, segments, 1)) < 0.2, np.nan, 1.5) * np.ones(3),
        RNG.normal(size=(frames, segments, 4)) if oriented else None,
        RNG.normal(size=(frames, 3)),
        RNG.normal(size=(frames, 4)),
        tuple(f"tendon_{i}" for i in range(tendons)),
        np.arange(commands) / 100,
        RNG.normal(size=(commands, tendons)),
        np.arange(2 * commands) / 200,
        RNG.normal(size=(2 * commands, tendons)),
        -0.137,
    )


@pytest.mark.parametrize(
    ("rows", "write", "read"),
    [
        ([trial("a", 5, 3, 3, True), trial("b", 1, 4, 0, False)], write_trials, read_trials),
        (
            [take("a", 7, 3, 2, 4, True), take("b", 5, 2, 0, 0, False), take("c", 6, 1, 1, 3, True)],
            write_takes,
            read_takes,
        ),
    ],
)
def test_round_trip(tmp_path, rows, write, read):
    write(tmp_path, rows)
    found = read(tmp_path)
    assert len(found) == len(rows)
    for one, other in zip(rows, found, strict=True):
        for key, value in vars(one).items():
            if isinstance(value, np.ndarray):
                np.testing.assert_array_equal(getattr(other, key), value, err_msg=key)
            else:
                assert getattr(other, key) == value, key


@pytest.mark.parametrize(("read", "stage"), [(read_takes, "ingest"), (read_trials, "filter")])
def test_missing_tables_name_the_file_and_the_stage_to_run(tmp_path, read, stage):
    with pytest.raises(InputError, match=rf"trials\.parquet: no such file, .*dvc repro {stage}"):
        read(tmp_path)
    (tmp_path / "trials.parquet").write_bytes(b"")
    with pytest.raises(InputError, match=rf"trials\.parquet: not readable as Parquet, .*dvc repro {stage}"):
        read(tmp_path)
