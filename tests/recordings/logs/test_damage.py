"""Logs whose bytes are whole and whose content is wrong: each mistake is named, and put right where that is safe."""

import itertools
import json
import tracemalloc

import numpy as np
import pytest

from demo.instruments import measure
from demo.recorder import write_log, write_session
from stages import ingest
from tests.recordings.cleaning.test_loading import edit_session
from tests.support.sessions import (
    LIMITS,
    MARKERS,
    all_truths,
    curl_truth,
    instruments,
    record,
    release_truth,
    static_truth,
)
from tests.support.workbench import ROOT
from trunkline.pipeline.stage import run_stage
from trunkline.recordings.cleaning.clock_offset import set_gravity_direction
from trunkline.recordings.cleaning.label_swaps import find_label_swaps
from trunkline.recordings.cleaning.loading import load_raw_trials
from trunkline.recordings.cleaning.usual_distances import usual_distances
from trunkline.recordings.session.session import read_session
from trunkline.recordings.signals.repeats import stale_samples

CLEAN = instruments(occlusions_per_s=0.3, outliers=0)
SPANS = slice(60, 110), slice(60, 61), slice(200, None), slice(0, 250)  # frames


def session(folder, change=None, truths=None, settings=CLEAN, every=False):
    """(raw trials, findings) of a session, the first of whose measurements went through `change`; all, if `every`."""
    folder.mkdir(exist_ok=True)
    measured = [
        measure(truth, settings, np.random.default_rng(seed), 30.0 * seed)
        for seed, truth in enumerate(truths or [release_truth(), static_truth(30.0), curl_truth(split="identify")])
    ]
    for m in measured[: None if every else 1] if change else []:
        change(m)
    for m in measured:
        write_log(folder / f"{m.name}.mcap", m)
    write_session(folder, measured, settings)
    return taken(folder)


def taken(folder):
    declared = read_session(folder)
    _, raw_trials, findings = zip(*load_raw_trials(folder, declared, LIMITS), strict=True)
    set_gravity_direction(raw_trials, findings, declared)
    return raw_trials, findings


@pytest.fixture(scope="module")
def right(tmp_path_factory):
    """The raw trials of the session to which nothing happened."""
    return session(tmp_path_factory.mktemp("session") / "right")[0]


def test_of_three_discs_one_may_be_lost_as_another_takes_its_place():
    """As in a real log: disc 3 is at disc 1's place while nothing is said of disc 1, so two distances have to do."""
    discs = np.array([[0, 0, 0], [0, 0, -0.1], [0, 0, -0.2], [0, 0, -0.32]])
    swing = 0.1 * np.sin(np.linspace(0, 9, 200))[:, None, None] * np.array([1.0, 0, 0]) * [[0], [0.2], [0.5], [1]]
    positions = discs + swing
    usual = usual_distances([positions])
    wrong = positions.copy()
    wrong[50:56, 3], wrong[50:56, 1] = positions[50:56, 1], np.nan
    wrong[90, 3], wrong[90, 1] = positions[90, 1], np.nan  # for a frame alone, it may be an outlier
    (swap,) = find_label_swaps(wrong, usual, marked_base=False)
    assert (swap.bodies, np.flatnonzero(swap.frames).tolist()) == ((1, 3), list(range(50, 56)))
    positions[60:70, 1] = np.nan
    assert find_label_swaps(positions, usual, marked_base=False) == []


SWAPPED = [*itertools.product(SPANS, [(1, 2), (2, 3), (3, 4), (1, 2, 3)]), (SPANS[0], (0, 1))]


@pytest.mark.parametrize(("frames", "bodies"), SWAPPED)
def test_bodies_taken_for_each_other_are_put_right(tmp_path, right, frames, bodies):
    """Each label on the next one's pose: pairs, the base among them, and rounds of three."""

    def swap(m):
        for values in (m.positions, m.quaternions):
            values[frames, list(bodies)] = values[frames, [*bodies[1:], bodies[0]]]

    raw_trials, findings = session(tmp_path / "wrong", swap)
    names = " and ".join(repr(("base", *MARKERS)[body]) for body in bodies)
    (repair,) = [line for line in findings[0].repairs if "taken for each other" in line]
    assert repair.startswith(f"{names} were taken for each other in ")
    begin, end = map(float, repair.partition(" between ")[2].removesuffix(" s, put right").split(" and "))
    times = raw_trials[0].time[frames]
    assert begin == pytest.approx(times[0], abs=0.02)
    assert end == pytest.approx(times[-1], abs=0.02)
    assert findings[1].repairs == findings[2].repairs == []
    # a body beside a hidden one may lack the neighbours that would tell
    same = np.isclose(raw_trials[0].positions, right[0].positions, equal_nan=True).all(axis=(1, 2))
    assert same.mean() > 0.97
    np.testing.assert_array_equal(raw_trials[0].quaternions[same], right[0].quaternions[same])
    np.testing.assert_array_equal(raw_trials[0].base_positions[same], right[0].base_positions[same])
    np.testing.assert_array_equal(raw_trials[0].base_quaternions[same], right[0].base_quaternions[same])


@pytest.mark.parametrize("bodies", [(2, 3, 4, 5), (0, 2, 1, 3), (4, 7, 5, 6)])
def test_rounds_of_four_are_told_too(bodies):
    """On a tapering arm of nine markers that swings; for two frames, and for one."""
    rng = np.random.default_rng(0)
    along = np.concatenate([[0], np.cumsum(0.06 * 0.9 ** np.arange(9))])
    angle = 2.0 * np.sin(0.1 * np.arange(300))[:, None] * along / along[-1] + 1e-9
    arc = np.stack([1 - np.cos(angle), 0 * angle, -np.sin(angle)], axis=-1) / (angle[:, -1:, None] / along[-1])
    right = arc + rng.normal(scale=3e-4, size=arc.shape)
    usual, positions = usual_distances([right]), right.copy()
    wrong = np.isin(np.arange(300), [50, 51, 120])
    positions[np.ix_(wrong, bodies)] = right[np.ix_(wrong, [*bodies[1:], bodies[0]])]
    assert find_label_swaps(right, usual) == []
    for swap in find_label_swaps(positions, usual):
        positions[np.ix_(swap.frames, [*swap.bodies[1:], swap.bodies[0]])] = positions[np.ix_(swap.frames, swap.bodies)]
    np.testing.assert_array_equal(positions, right)


def test_memory_for_finding_swaps_hardly_grows_with_the_rounds_that_are_tried():
    """Beside the distances between all bodies, only what is kept of each frame."""
    frames, bodies = 2000, 19
    positions = np.linspace([0, 0, 0], [0, 0, -0.5], bodies) + np.random.default_rng(0).normal(0, 3e-4, (frames, 1, 3))
    usual = usual_distances([positions])
    tracemalloc.start()
    find_label_swaps(positions, usual)
    peak = tracemalloc.get_traced_memory()[1]
    tracemalloc.stop()
    assert peak < 2 * 8 * frames * bodies**2


@pytest.mark.parametrize("truth", [release_truth(), static_truth(60.0), curl_truth(100.0)])
def test_nothing_is_swapped_where_nothing_was(tmp_path, truth):
    for seed in range(3):
        settings = instruments(occlusions_per_s=2.0, outliers=0.01)
        m = measure(truth, settings, np.random.default_rng(seed))
        assert find_label_swaps(m.positions, usual_distances([m.positions])) == []


def test_repeated_poses_are_dropped_as_frozen(tmp_path):
    def freeze(m):
        m.positions[100:140, 3], m.quaternions[100:140, 3] = m.positions[100, 3], m.quaternions[100, 3]

    raw_trials, findings = session(tmp_path, freeze)
    assert findings[0].repairs == ["39 samples that only repeat the one before, to the last bit, dropped (unit_06)"]
    assert np.isnan(raw_trials[0].positions[101:140, 2]).all()
    assert np.isfinite(raw_trials[0].positions[100, 2]).all()


def test_all_bodies_frozen_at_once_and_float32(tmp_path):
    def freeze(m):
        m.positions[:] = m.positions.astype(np.float32)
        m.positions[100:140] = m.positions[100]

    raw_trials, _ = session(tmp_path, freeze, settings=instruments(occlusions_per_s=0, outliers=0))
    assert np.isnan(raw_trials[0].positions[101:140]).all()
    assert np.isfinite(raw_trials[0].positions[140:]).all()


def test_rounded_and_constant_positions_are_not_frozen():
    rng = np.random.default_rng(0)
    noise = rng.normal(scale=3e-4, size=(600, 2, 3))
    rounded = np.round(noise, 3)
    assert not stale_samples(rounded).any(), "noise of 0.3 mm rounded to 1 mm repeats itself"
    assert not stale_samples(np.zeros((600, 2, 3))).any()
    assert not stale_samples(noise).any()


@pytest.mark.parametrize("resolution", [1e-4, 5e-4])
def test_stale_poses_of_a_rounded_log_are_those_of_a_body_beyond_others_that_move(resolution):
    time = np.arange(400) / 100
    swing = np.where(time < 2, np.sin(2 * np.pi * time), 0.0)[:, None, None]  # and at rest for 2 s
    sizes = np.array([0.0, 0.02, 0.05, 0.1])[:, None]
    noise = np.random.default_rng(0).normal(scale=2e-5, size=(400, 4, 3))
    rounded = resolution * np.round((swing * sizes * [1, 0.5, 0.2] + noise) / resolution)
    rounded[300, 1] += 0.04  # an outlier, while others rest
    assert not stale_samples(rounded).any()
    rounded[61:90, 3] = rounded[60, 3]
    expected = np.zeros((400, 4), bool)
    expected[61:90, 3] = True
    np.testing.assert_array_equal(stale_samples(rounded), expected)


@pytest.mark.parametrize(("factor", "declared", "taken_as"), [(1000.0, "m", "mm"), (1.0, "mm", "m")])
def test_wrong_unit_is_recognised(tmp_path, right, factor, declared, taken_as):
    def scale(m):
        m.positions *= factor

    session(tmp_path, scale, every=True)
    edit_session(tmp_path, "unit: m}", f"unit: {declared}}}")
    raw_trials, findings = taken(tmp_path)
    for raw, expected, remarks in zip(raw_trials, right, findings, strict=True):
        np.testing.assert_allclose(raw.positions, expected.positions, rtol=1e-12)
        assert f"are no arm in {declared}, as declared; taken as {taken_as}" in remarks.repairs[0]


def test_wrong_vertical_is_put_right_by_the_tilts(tmp_path):
    truths = [static_truth(0.0), static_truth(30.0), static_truth(60.0), release_truth()]
    raw_trials, findings = session(tmp_path, truths=truths)
    assert [remarks.repairs + remarks.warnings for remarks in findings] == [[]] * 4
    edit_session(tmp_path, "up: [0, 1, 0]", "up: [0, 0, 1]")
    raw_trials, findings = taken(tmp_path)
    for raw, remarks in zip(raw_trials, findings, strict=True):
        np.testing.assert_array_equal(raw.up, [0, 1, 0])
        assert "with [0, 0, 1]" in remarks.repairs[-1]
        assert "with [0, 1, 0], which was taken" in remarks.repairs[-1]


def test_wrong_levels_are_named_and_change_nothing(tmp_path):
    session(tmp_path, truths=[static_truth(0.0), static_truth(30.0), static_truth(60.0)])
    for old, new in (("level: 30", "level: 85"), ("level: 0", "level: 50"), ("level: 60", "level: 10")):
        edit_session(tmp_path, old, new)
    raw_trials, findings = taken(tmp_path)
    assert all(remarks.repairs == [] and "no other axis fits" in remarks.warnings[0] for remarks in findings)
    np.testing.assert_array_equal(raw_trials[0].up, [0, 1, 0])


def test_releases_alone_only_warn_of_a_wrong_vertical(tmp_path):
    session(tmp_path, truths=[release_truth()])
    edit_session(tmp_path, "up: [0, 1, 0]", "up: [0, 0, 1]")
    raw_trials, (findings,) = taken(tmp_path)
    assert "released arms come to rest" in findings.warnings[0]
    assert "with [0, 1, 0]: check `frame.up`" in findings.warnings[0]
    np.testing.assert_array_equal(raw_trials[0].up, [0, 0, 1])


def test_the_report_names_what_was_found(tmp_path, monkeypatch, capsys):
    (tmp_path / "conf").symlink_to(ROOT / "conf")
    (tmp_path / "params.yaml").write_text((ROOT / "params.yaml").read_text())
    monkeypatch.chdir(tmp_path)
    record(tmp_path / "data/raw/demo", all_truths(), instruments())
    edit_session(tmp_path / "data/raw/demo", "up: [0, 1, 0]", "up: [1, 0, 0]")
    run_stage("ingest", ingest.Config, ingest.main)
    report = json.loads((ingest.ARTIFACTS / "quality.json").read_text())["trials"]
    for trial in report.values():
        assert "which was taken" in trial["repairs"][-1]
        assert abs(trial["stamps_over_log_times"]["drift_ppm"]) < 2000
        assert any("the vertical is by the tilts of other splits too" in warning for warning in trial["warnings"])
