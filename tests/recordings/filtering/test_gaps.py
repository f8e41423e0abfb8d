"""What cameras missed: which frames count as measured, how long a gap is bridged, and that fillers get nowhere."""

from dataclasses import replace

import numpy as np
import pytest

from trunkline.errors import InputError
from trunkline.frames import STANDARD_GRAVITY
from trunkline.recordings.filtering.filter import Filter, _check_near, average_static, filter_raw_trial, start_of
from trunkline.recordings.trials.experiments import EXPERIMENTS
from trunkline.recordings.trials.raw_trial import RawTrial
from trunkline.recordings.trials.trial import Trial

RATE, FRAMES = 120, 360
SETTINGS = Filter(rate=RATE, cutoff=20, order=4, longest_bridge=0.104, outlier_deviations=8, release="onset")
BRIDGED = 11  # missed frames in a row: from the sample before them to the one after are 0.1 s, 8 ms short of the next
MARGIN = 3  # frames: half a period of the cutoff, as far as the low-pass carries what fills a gap
TIME = np.arange(FRAMES) / RATE


def raw(kind: str = "motion", oriented: bool = False, **changes) -> RawTrial:
    """Two markers that sway, seen in every frame of the uniform clock, and a base that stands still."""
    positions = np.zeros((FRAMES, 2, 3))
    positions[..., 2] = [-0.2, -0.4]
    if not EXPERIMENTS[kind].static:
        positions[..., 0] = 0.05 * np.sin(6 * TIME)[:, None] * [0.5, 1.0]
    quaternions = np.tile([1.0, 0, 0, 0], (FRAMES, 2, 1)) if oriented else None
    facts = {
        "name": "by hand", "experiment": kind, "split": "identify", "level": None, "time": TIME,
        "markers": ("unit_1", "unit_2"), "positions": positions, "quaternions": quaternions,
        "base_positions": np.zeros((FRAMES, 3)), "base_quaternions": np.tile([1.0, 0, 0, 0], (FRAMES, 1)),
        "up": np.array([0.0, 0.0, 1.0]), "tendons": ("tendon_1",), "command_time": TIME, "tendon_time": np.empty(0),
        "commands": 0.01 * np.clip(TIME - 0.5, 0, 1)[:, None], "tendon_positions": np.empty((0, 1)),
    }  # fmt: skip
    return RawTrial(**facts | changes)


def missing(source: RawTrial, begin: int, count: int, marker: int = 1) -> RawTrial:
    positions = source.positions.copy()
    positions[begin : begin + count, marker] = np.nan
    return replace(source, positions=positions)


@pytest.mark.parametrize("missed", [1, BRIDGED - 1, BRIDGED])
def test_a_gap_that_is_short_enough_is_measured_throughout(missed):
    trial, effect = filter_raw_trial(missing(raw(), 100, missed), SETTINGS)
    assert trial.measured.all()
    assert effect.gap_share == 0
    assert effect.filled_share == pytest.approx(missed / (2 * FRAMES))


@pytest.mark.parametrize("missed", [BRIDGED + 1, 2 * BRIDGED, 3 * BRIDGED, 100])
def test_a_longer_gap_is_not_measured_nor_is_what_the_low_pass_carries_beyond_it(missed):
    trial, effect = filter_raw_trial(missing(raw(), 100, missed), SETTINGS)
    assert trial.measured[:, 0].all(), "the other marker was seen"
    hidden = np.flatnonzero(~trial.measured[:, 1])
    assert hidden.tolist() == list(range(100 - MARGIN, 100 + missed + MARGIN))
    assert effect.gap_share == pytest.approx(len(hidden) / (2 * FRAMES))


@pytest.mark.parametrize("missed", [30, 60])
def test_what_is_measured_does_not_depend_on_what_fills_a_gap(missed):
    """The same motion but for a jerk that happens while nobody looks."""
    calm, jerked = raw(), raw()
    inside = slice(100, 100 + missed)
    jerked.positions[inside, 1, 1] += 0.1 * np.hanning(missed)
    full, _ = filter_raw_trial(jerked, SETTINGS)
    filtered, _ = filter_raw_trial(missing(calm, 100, missed), SETTINGS)
    off = np.abs(filtered.positions - full.positions).max(axis=2)
    assert off[~filtered.measured].max() > 50e-3
    assert off[filtered.measured].max() < 0.5e-3


@pytest.mark.parametrize(("begin", "hidden"), [(0, range(20 + MARGIN)), (340, range(340 - MARGIN, FRAMES))])
def test_before_the_first_and_after_the_last_sample_nothing_is_measured(begin, hidden):
    trial, _ = filter_raw_trial(missing(raw(), begin, 20), SETTINGS)
    assert np.flatnonzero(~trial.measured[:, 1]).tolist() == list(hidden)


@pytest.mark.parametrize("what", ["position", "orientation"])
def test_a_sample_that_is_off_in_either_way_is_dropped(what):
    source = raw(oriented=True)
    if what == "position":
        source.positions[150, 1, 1] += 0.02
    else:
        source.quaternions[150, 1] = [np.cos(0.4), np.sin(0.4), 0, 0]
    trial, effect = filter_raw_trial(source, SETTINGS)
    assert effect.outliers == 1
    plain = filter_raw_trial(raw(oriented=True), SETTINGS)[0]
    np.testing.assert_allclose(trial.positions, plain.positions, atol=1e-4)
    np.testing.assert_allclose(trial.quaternions, plain.quaternions, atol=1e-3)


def test_a_sample_counts_only_with_its_orientation():
    source = raw(oriented=True)
    source.quaternions[100:140, 1] = np.nan
    trial, _ = filter_raw_trial(source, SETTINGS)
    assert np.flatnonzero(~trial.measured[:, 1]).tolist() == list(range(100 - MARGIN, 140 + MARGIN))


@pytest.mark.parametrize(("samples", "enough"), [(8, True), (7, False)])
def test_fewer_samples_than_the_low_pass_needs_are_refused(samples, enough):
    source = missing(raw(), samples, FRAMES)
    if enough:
        assert filter_raw_trial(source, SETTINGS)[0].measured[:, 1].sum() == samples - MARGIN
        return
    with pytest.raises(InputError, match=f"'unit_2': found {samples} good samples, expected more"):
        filter_raw_trial(source, SETTINGS)


def moving_while_hidden(count: int) -> tuple[RawTrial, slice]:
    """At rest, but for a while in which nobody sees the second marker and after which it is 2 mm elsewhere."""
    source, hidden = raw("static_pull"), slice(100, 100 + count)
    source.positions[hidden.stop :, 1, 0] += 2e-3
    source.positions[hidden, 1, 0] = np.nan
    return source, hidden


def test_filtered_positions_that_leave_all_samples_are_refused():
    time = np.arange(10) * 0.1
    samples = np.zeros((10, 3))
    _check_near(time, np.full((10, 3), 2.8e-3), time, samples, "trial a: 'tip'")
    far = np.where(np.arange(10) == 5, 3.4, 0.0)[:, None] * np.ones(3)
    with pytest.raises(InputError, match=r"trial a: 'tip': filtered positions are 5.89e\+03 mm from .* at 0.50 s"):
        _check_near(time, far, time, samples, "trial a: 'tip'")


def test_a_shape_at_rest_is_the_mean_of_the_frames_that_were_measured():
    source, hidden = moving_while_hidden(160)
    trial, _ = filter_raw_trial(source, SETTINGS)
    before, after = hidden.start - MARGIN, FRAMES - hidden.stop - MARGIN
    assert trial.positions.shape == (1, 2, 3)
    assert trial.measured.all()
    assert trial.positions[0, 1, 0] == pytest.approx(2e-3 * after / (before + after), abs=2e-6)
    assert trial.positions[0, 0, 0] == 0


def static(positions: np.ndarray, measured: np.ndarray, quaternions: np.ndarray | None = None) -> Trial:
    frames = len(positions)
    return Trial(
        name="by hand", experiment="static_tilt", split="identify", level=0.0, gravity=np.array([0, 0, -9.81]),
        time=np.arange(frames) / RATE, markers=("a", "b"), positions=positions, quaternions=quaternions,
        measured=measured, tendons=("t",), commands=np.arange(frames)[:, None] * 1.0,
        tendon_positions=np.arange(frames)[:, None] * 2.0,
    )  # fmt: skip


@pytest.mark.filterwarnings("ignore:invalid value")
def test_the_mean_shape_by_hand():
    positions = np.zeros((4, 2, 3))
    positions[:, 0, 0] = [1.0, 2.0, 90.0, 3.0]
    positions[:, 1, 1] = [50.0, 60.0, 70.0, 80.0]
    half = np.sqrt(0.5)
    quaternions = np.tile([1.0, 0, 0, 0], (4, 2, 1))
    quaternions[3, 0] = [0, 1, 0, 0]
    quaternions[1, 0] = [0, 1, 0, 0]
    quaternions[2, 0] = [0, 0, 0, 1]
    measured = np.array([[True, False], [True, False], [False, False], [False, False]])
    result = average_static(static(positions, measured, quaternions))
    assert result.positions[0, 0].tolist() == [1.5, 0, 0]
    np.testing.assert_allclose(result.quaternions[0, 0], [half, half, 0, 0])
    assert result.measured.tolist() == [[True, False]]
    assert (result.commands.item(), result.tendon_positions.item()) == (1.5, 3.0)
    assert result.time.tolist() == [0.0]


@pytest.mark.parametrize("oriented", [False, True])
def test_a_path_counts_frame_by_frame_what_was_seen_whole(oriented):
    source = raw("static_path", oriented)
    source.positions[5, 1] = np.nan
    if oriented:
        source.quaternions[7, 0] = np.nan
    trial, effect = filter_raw_trial(source, SETTINGS)
    hidden = [(5, 1), (7, 0)] if oriented else [(5, 1)]
    assert [tuple(place) for place in np.argwhere(~trial.measured).tolist()] == hidden
    assert effect.gap_share == pytest.approx(len(hidden) / (2 * FRAMES))
    np.testing.assert_allclose(trial.positions[trial.measured], source.positions[trial.measured], atol=1e-12)


@pytest.mark.parametrize("lacking", ["commands", "tendon positions", "both"])
def test_of_commands_and_positions_one_stands_for_the_other(lacking):
    pulls, none = 0.01 * np.clip(TIME - 0.5, 0, 1)[:, None], np.empty((0, 1))
    commands, wound = {"commands": (none, pulls), "tendon positions": (pulls, none), "both": (none, none)}[lacking]
    source = raw(
        command_time=TIME[: len(commands)], commands=commands, tendon_time=TIME[: len(wound)], tendon_positions=wound
    )
    trial, _ = filter_raw_trial(source, SETTINGS)
    expected = np.zeros((FRAMES, 1)) if lacking == "both" else pulls
    np.testing.assert_allclose(trial.commands, expected, atol=1e-9)
    np.testing.assert_allclose(trial.tendon_positions, expected, atol=1e-9)


def test_commands_come_on_the_poses_clock():
    source = raw(clock_offset=0.25)
    trial, _ = filter_raw_trial(source, SETTINGS)
    np.testing.assert_allclose(trial.commands[:, 0], 0.01 * np.clip(TIME - 0.75, 0, 1), atol=1e-9)


@pytest.mark.parametrize(("kind", "release", "free"), [("release", "free", True), ("release", "onset", False),
                                                       ("motion", "free", False)])  # fmt: skip
def test_only_a_release_that_is_to_be_free_begins_in_motion(kind, release, free):
    source = raw(kind)
    aside = np.clip(1.2 - TIME, 0, 0.2) / 0.2  # let go at 1 s
    source.positions[..., 0] = 0.1 * aside[:, None] * [0.5, 1.0]
    trial, _ = filter_raw_trial(source, SETTINGS)
    result = start_of(trial, EXPERIMENTS[kind], replace(SETTINGS, release=release))
    assert result["in_motion"] is free
    if free:
        assert not result["swaying"]
        assert result["start"] == pytest.approx(1.0, abs=0.1)


def test_gravity_is_against_up_in_the_frame_of_the_base():
    turned = np.tile([np.sqrt(0.5), np.sqrt(0.5), 0, 0], (FRAMES, 1))  # a quarter about x
    trial, _ = filter_raw_trial(raw(base_quaternions=turned), SETTINGS)
    np.testing.assert_allclose(trial.gravity, [0, -STANDARD_GRAVITY, 0], atol=1e-9)
