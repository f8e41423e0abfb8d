"""The filter stage against the truth: poses, tilt, commands and the moment of release."""

import contextlib
import json
import re
from dataclasses import replace

import numpy as np
import pytest
from scipy.spatial.transform import Rotation

from stages import filter as filter_stage
from stages import ingest
from tests.support.sessions import CURL_BEGIN, RELEASE, all_truths
from tests.support.workbench import workbench
from trunkline.errors import InputError
from trunkline.frames import gravity_in_base, rotation_from_wxyz
from trunkline.pipeline.stage import run_stage
from trunkline.recordings.filtering.filter import Filter, _check_near, _marker
from trunkline.recordings.trials.splits import SPLITS
from trunkline.recordings.trials.trial import read_trials


@pytest.fixture(scope="module")
def results(tmp_path_factory):
    """(trials by name, metrics) of the small session."""
    project = workbench(tmp_path_factory.mktemp("project"))
    with pytest.MonkeyPatch.context() as patch:
        patch.chdir(project)
        run_stage("ingest", ingest.Config, ingest.main)
        run_stage("filter", filter_stage.Config, filter_stage.main)
        metrics = json.loads((filter_stage.ARTIFACTS / "metrics.json").read_text())
        assert (filter_stage.ARTIFACTS / "filter.png").stat().st_size > 20_000
        return {trial.name: trial for trial in read_trials(filter_stage.PROCESSED, SPLITS)}, metrics


def in_base_frame(truth, time):
    """Positions (T, S, 3) and rotations (T·S) of a truth at `time`; the middle of a static one."""
    turn = rotation_from_wxyz(truth.base_quaternion).inv()
    rows = np.searchsorted(truth.time, time).clip(0, len(truth.time) - 1)
    positions = turn.apply((truth.positions[rows] - truth.base_position).reshape(-1, 3))
    rotations = turn * rotation_from_wxyz(truth.quaternions[rows].reshape(-1, 4))
    return positions.reshape(len(time), -1, 3), rotations


@pytest.mark.parametrize("truth", all_truths(), ids=lambda truth: truth.name)
def test_poses_agree_with_the_truth(results, truth):
    trial = results[0][truth.name]
    positions, rotations = in_base_frame(truth, trial.time)
    error = np.linalg.norm(trial.positions - positions, axis=2)[trial.measured]
    # 0.3 mm per axis in, a third of the bandwidth left, and the base's 0.3° averaged over the trial
    assert np.sqrt(np.mean(error**2)) < 0.6e-3
    assert error.max() < 3e-3
    angle = (rotations.inv() * rotation_from_wxyz(trial.quaternions.reshape(-1, 4))).magnitude()
    assert np.degrees(np.median(angle)) < 0.45


@pytest.mark.parametrize("truth", all_truths(), ids=lambda truth: truth.name)
def test_gravity_and_labels(results, truth):
    trial = results[0][truth.name]
    tilt = truth.level if truth.experiment == "static_tilt" else 0.0
    expected = gravity_in_base(np.deg2rad(tilt))
    angle = np.arccos(np.clip(trial.gravity @ expected / np.linalg.norm(expected) ** 2, -1, 1))
    assert np.degrees(angle) < 0.15
    labels = (trial.experiment, trial.split, trial.level)
    assert labels == (truth.experiment, truth.split, truth.level)


def test_static_tilts_are_one_frame_and_the_others_uniform(results):
    for trial in results[0].values():
        if trial.experiment == "static_tilt":
            assert len(trial.time) == 1
        else:
            np.testing.assert_allclose(np.diff(trial.time), 1 / 120, atol=1e-12)
            assert trial.measured.mean() > 0.9
        assert np.isfinite(trial.positions).all()
        np.testing.assert_allclose(np.linalg.norm(trial.quaternions, axis=-1), 1)
        assert np.all(np.sum(trial.quaternions[1:] * trial.quaternions[:-1], axis=-1) > 0)


def test_starts_are_found(results):
    trials = results[0]
    assert trials["release_a"].start == pytest.approx(RELEASE, abs=1 / 120)
    assert trials["curl_40"].start == pytest.approx(CURL_BEGIN, abs=0.07)  # the pull begins gently


def test_commands_are_on_the_cameras_clock(results):
    trial = results[0]["curl_40"]
    truth = next(truth for truth in all_truths() if truth.name == "curl_40")
    for values in (trial.commands, trial.tendon_positions):
        expected = np.stack(
            [np.interp(trial.time, truth.time, pull) for pull in truth.tendon_positions.T], axis=1
        )
        # 70 mm/s at most: 0.5 mm for 8 ms of clock error
        assert np.abs(values - expected).max() < 0.8e-3
    assert results[0]["release_a"].commands.shape[1] == 0


def test_metrics(results):
    metrics = results[1]
    assert metrics["static"]["tilt_60"]["tilt_deg"] == pytest.approx(60, abs=0.15)
    assert metrics["removed_position_mm"] == pytest.approx(0.3 * np.sqrt(1 - 0.545**2), rel=0.15)
    assert 0 < metrics["gap_share"] < 0.1
    assert metrics["base_turn_deg"] < 0.2


def test_orientation_noise_is_reduced(results):
    trial = results[0]["release_a"]
    before_release = trial.time < RELEASE - 0.05
    rotations = [
        Rotation.from_quat(q[before_release], scalar_first=True) for q in np.moveaxis(trial.quaternions, 1, 0)
    ]
    spread = [np.sqrt(np.mean((r.mean().inv() * r).magnitude() ** 2) / 3) for r in rotations]
    assert np.degrees(np.median(spread)) < 0.3 * 0.7


@pytest.mark.parametrize(("beyond", "refused"), [(54.9, False), (55.1, True)])
def test_filtered_positions_beside_the_measured_ones_are_refused_from_half_their_way_on(beyond, refused):
    """And 5 mm: here 55 mm."""
    time = np.arange(200) / 100
    samples = 0.05 * np.sin(2 * np.pi * time)[:, None] * [1.0, 0.0, 0.0]
    filtered = samples.copy()
    filtered[120, 2] = -1e-3 * beyond
    far = f"filtered positions are {beyond} mm from the measured ones at 1.20 s, expected at most 55 mm"
    message = re.escape(f"trial swing: 'tip': {far}: are its times right?")
    with pytest.raises(InputError, match=message) if refused else contextlib.nullcontext():
        _check_near(time, filtered, time, samples, "trial swing: 'tip'")


def test_a_curve_among_the_measured_positions_at_other_times_is_refused():
    time = np.arange(200) / 100
    samples = 0.05 * np.sin(2 * np.pi * time)[:, None] * [1.0, 0.0, 0.0]
    with pytest.raises(InputError, match="filtered positions are 100 mm from the measured ones at 0.25 s"):
        _check_near(time, -samples, time, samples, "trial swing: 'tip'")


def test_a_curve_that_leaves_what_was_measured_is_refused_only_where_it_is_trusted():
    """Unseen for a second on its way up, and seen again on its way down: a smooth curve goes far beyond."""
    time = np.delete(np.arange(300) / 100, slice(100, 200))
    swing = 0.02 * np.sin(6 * np.pi * time) * np.where(time < 1, 1, -1)
    samples, grid = swing[:, None] * [1.0, 0.0, 0.0], np.arange(300) / 100
    trusting = Filter(rate=100, cutoff=20, order=4, longest_bridge=2, outlier_deviations=1000, release="onset")
    with pytest.raises(InputError, match=r"swing: filtered positions are [\d.]+ mm from .* expected at most 25 mm"):
        _marker(time, samples, grid, trusting, "trial swing")
    filtered = _marker(time, samples, grid, replace(trusting, longest_bridge=0.06), "trial swing")
    assert np.abs(filtered.columns[filtered.measured]).max() < 0.025


def test_cutoff_beyond_the_nyquist_rate_is_one_line(tmp_path, monkeypatch, capsys):
    monkeypatch.chdir(workbench(tmp_path))
    path = tmp_path / "params.yaml"
    path.write_text(path.read_text().replace("cutoff: 20.0", "cutoff: 70.0"))
    with pytest.raises(SystemExit):
        run_stage("filter", filter_stage.Config, filter_stage.main)
    assert (
        "cutoff: found 70.0 Hz, expected less than half the rate of 120.0 Hz" in capsys.readouterr().err
    )
