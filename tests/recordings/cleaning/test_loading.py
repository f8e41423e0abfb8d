"""What a session's logs become: good raw trials, repairs that are said, refusals that name the culprit."""

import re
from dataclasses import replace

import numpy as np
import pytest
import yaml

from demo.instruments import measure
from demo.recorder import write_log, write_session
from tests.support.folders import SHARED, with_recordings
from tests.support.sessions import LIMITS, MARKERS, curl_truth, instruments, record, release_truth, static_truth
from trunkline.errors import InputError
from trunkline.recordings.cleaning.clock_offset import align_clocks
from trunkline.recordings.cleaning.loading import load_raw_trials
from trunkline.recordings.filtering.filter import Filter, filter_raw_trial
from trunkline.recordings.session.session import read_session

FILTER = Filter(120.0, 20.0, 4, 0.06, 8.0, "onset")
REAL = SHARED / "asl_trunk"
PER_FRAME = ("frames", "stamps", "logged", "positions", "quaternions")


def taken(folder):
    """[(raw trial or error, findings)] of the session in `folder`."""
    return [(raw, findings) for _, raw, findings in load_raw_trials(folder, read_session(folder), LIMITS)]


def one_trial(folder, change=lambda m: None, truth=None, clock="frame"):
    """The raw trial, or error, of a session of one trial whose measurement went through `change`."""
    m = measure(
        truth or release_truth(),
        instruments(occlusions_per_s=0, outliers=0),
        np.random.default_rng(0),
    )
    m = change(m) or m
    write_log(folder / f"{m.name}.mcap", m)
    write_session(folder, [m], instruments())
    edit_session(folder, "clock: frame", f"clock: {clock}")
    ((raw, findings),) = taken(folder)
    return raw, findings


def edit_session(folder, old, new):
    path = folder / "session.yaml"
    text = path.read_text()
    assert old in text
    path.write_text(text.replace(old, new))


def refused(result, message):
    error, _ = result
    assert isinstance(error, InputError), f"expected a refusal, found {error}"
    assert "release_a.mcap" in str(error)
    assert re.search(message, str(error)), str(error)


def test_takes_carry_what_was_measured(tmp_path):
    (m,) = record(tmp_path, [curl_truth()], instruments())
    ((raw, findings),) = taken(tmp_path)
    assert raw.markers == MARKERS
    assert findings.repairs == []
    np.testing.assert_array_equal(raw.positions, m.positions[:, 1:])
    np.testing.assert_array_equal(raw.base_positions, m.positions[:, 0])
    np.testing.assert_allclose(
        np.abs(np.nansum(raw.quaternions * m.quaternions[:, 1:], axis=-1)).max(), 1
    )
    np.testing.assert_allclose(raw.time, (m.frames - m.frames[0]) / 120, atol=2e-3)
    assert np.abs(np.diff(raw.time) * 120 - np.diff(m.frames)).max() < 1e-2, (
        "the frame clock has no jitter"
    )
    np.testing.assert_array_equal(raw.commands, m.commands[: len(raw.commands)])
    assert align_clocks([raw], [findings], 0.1).by == "log times"
    assert raw.clock_offset == pytest.approx(-0.137, abs=0.5e-3)


def test_stamp_and_log_clocks(tmp_path):
    (m,) = record(tmp_path, [release_truth()], instruments())
    edit_session(tmp_path, "clock: frame", "clock: stamp")
    ((raw, _),) = taken(tmp_path)
    np.testing.assert_allclose(raw.time, np.sort(m.stamps - m.stamps.min()) * 1e-9, atol=1e-9)
    edit_session(tmp_path, "clock: stamp", "clock: log")
    ((raw, _),) = taken(tmp_path)
    np.testing.assert_allclose(raw.time[-1], (m.logged[-1] - m.logged[0]) * 1e-9, atol=0.02)
    assert np.diff(raw.time).min() > 0.9 / 120, "what deliveries delayed is evened out"
    edit_session(tmp_path, "clock: log", "clock: log\neven_times: false")
    ((raw, findings),) = taken(tmp_path)
    np.testing.assert_allclose(raw.time, (np.unique(m.logged) - m.logged.min()) * 1e-9, atol=1e-9)
    assert not any("late" in repair for repair in findings.repairs)


def test_markers_by_the_name_of_the_release_before(tmp_path, capsys):
    record(tmp_path, [release_truth()], instruments())
    edit_session(tmp_path, "base: base", "base: base\nsegments: {unit_08: tip}")
    ((raw, _),) = taken(tmp_path)
    assert raw.markers == ("tip",)
    assert capsys.readouterr().out.startswith(f"{tmp_path / 'session.yaml'}: `segments` is called `markers` now: ")
    edit_session(tmp_path, "base: base", "base: base\nmarkers: {unit_08: tip}")
    with pytest.raises(InputError, match="found `segments` beside `markers`, its new name, expected `markers` alone"):
        read_session(tmp_path)


def test_window_and_names_from_the_session(tmp_path):
    record(tmp_path, [release_truth()], instruments())
    edit_session(tmp_path, "split: identify", "split: identify, window: [0.5, 1.5]")
    edit_session(tmp_path, "base: base", "base: base\nmarkers: {unit_08: tip, unit_02: root}")
    ((raw, _),) = taken(tmp_path)
    assert raw.markers == ("tip", "root")
    assert raw.time[0] == 0
    assert raw.time[-1] == pytest.approx(1.0, abs=0.02)
    edit_session(tmp_path, "[0.5, 1.5]", "[50, 60]")
    refused(taken(tmp_path)[0], r"window \[50.0, 60.0\] s holds no pose, the log has 2.\d+ s")


def test_bad_quaternions_and_positions_are_dropped_and_counted(tmp_path):
    def spoil(m):
        m.quaternions[10:15, 2] = np.nan
        m.quaternions[20:30, 3] = 0.0
        m.quaternions[40, 1] *= 1.5
        m.positions[50:52, 4, 1] = np.inf

    raw, findings = one_trial(tmp_path, spoil)
    assert findings.repairs == [
        "16 samples with a NaN, zero or unnormalised quaternion dropped (unit_02, unit_04, unit_06)",
        "2 samples with a position that is not finite dropped (unit_08)",
    ]
    assert np.isnan(raw.positions[10:15, 1]).all()
    assert np.isfinite(raw.positions).all(axis=-1).sum() == raw.positions[..., 0].size - 18


def test_markers_without_a_label_are_left_out_and_all_are_taken_where_none_has_one(tmp_path):
    record(tmp_path, [replace(release_truth(), markers=(*MARKERS[:3], "Unlabeled 1007"))], instruments())
    ((raw, findings),) = taken(tmp_path)
    assert raw.markers == MARKERS[:3]
    assert "Unlabeled 1007 left out: they are markers without a label" in findings.repairs
    unlabelled = tuple(f"Unlabeled {number}" for number in range(4))
    record(tmp_path / "none", [replace(release_truth(), markers=unlabelled)], instruments())
    assert taken(tmp_path / "none")[0][0].markers == unlabelled


@pytest.mark.parametrize(("key", "value"), [("quaternions", 0.0), ("positions", 0.0), ("positions", 1e300)])
def test_a_body_nowhere_is_not_taken_for_seen(tmp_path, key, value):
    def spoil(m):
        getattr(m, key)[:, 2] = value

    result = one_trial(tmp_path, spoil)
    refused(result, "trial release_a: 'unit_04' is seen in 0.0 % of 2.. frames")
    assert any("(unit_04)" in repair for repair in result[1].repairs)


def test_marker_that_never_appears_is_refused_by_name(tmp_path):
    def hide(m):
        m.positions[:, 3] = m.quaternions[:, 3] = np.nan

    one_trial(tmp_path, hide)
    edit_session(tmp_path, "base: base", "base: base\nmarkers: {unit_02: unit_02, unit_06: unit_06}")
    message = (
        "trial release_a: 'unit_06' never appears in /rigid_bodies, found base, unit_02, unit_04, unit_08"
    )
    refused(taken(tmp_path)[0], message)


def test_marker_that_only_other_trials_have_is_refused_by_name(tmp_path):
    record(tmp_path, [static_truth(0.0), release_truth()], instruments())
    m = measure(release_truth(), instruments(), np.random.default_rng(0))
    m.positions[:, 3] = m.quaternions[:, 3] = np.nan
    write_log(tmp_path / "release_a.mcap", m)
    good, bad = taken(tmp_path)
    assert good[0].markers == MARKERS
    refused(bad, "'unit_06' never appears")


def test_base_that_never_appears_is_refused(tmp_path):
    def hide(m):
        m.positions[:, 0] = m.quaternions[:, 0] = np.nan

    refused(one_trial(tmp_path, hide), "'base' never appears")


def test_no_pose_topic_is_refused(tmp_path):
    (m,) = record(tmp_path, [curl_truth()], instruments())
    nothing = {key: getattr(m, key)[:0] for key in PER_FRAME}
    write_log(tmp_path / "curl_40.mcap", replace(m, **nothing))
    ((error, _),) = taken(tmp_path)
    assert "curl_40.mcap: no pose topic, found /tendon_" in str(error)
    assert "(sensor_msgs/msg/JointState)" in str(error)


def test_named_topic_of_the_wrong_kind_is_refused(tmp_path):
    record(tmp_path, [curl_truth()], instruments())
    edit_session(tmp_path, "poses: /rigid_bodies", "poses: /tendon_states")
    ((error, _),) = taken(tmp_path)
    assert "/tendon_states: found sensor_msgs/msg/JointState, expected a pose schema: mocap4r2" in str(
        error
    )


def test_topics_are_found_by_schema_and_name(tmp_path):
    record(tmp_path, [curl_truth()], instruments())
    text = (tmp_path / "session.yaml").read_text().splitlines(keepends=True)
    (tmp_path / "session.yaml").write_text(
        "".join(line for line in text if not line.startswith("topics"))
    )
    ((raw, _),) = taken(tmp_path)
    assert len(raw.command_time) > 100
    assert len(raw.tendon_time) > 400


@pytest.mark.parametrize("clock", ["stamp", "frame"])
def test_time_running_backwards_is_refused(tmp_path, clock):
    def reset(m):
        m.stamps[150:] -= 2_000_000_000
        m.frames[:150] += 240

    result = one_trial(tmp_path, reset, clock=clock)
    if clock == "stamp":
        refused(
            result,
            r"/rigid_bodies: time runs backwards by 1\.99\d s at message 150, expected no step back",
        )
    else:
        refused(result, "frame numbers do not increase, expected `clock: stamp` or `log`")


def test_a_clock_that_was_not_set_yet_dates_nothing(tmp_path):
    def change(m):
        m.stamps[:2] = 0, 20_000_000

    right, _ = one_trial(tmp_path, clock="stamp")
    raw, findings = one_trial(tmp_path, change, clock="stamp")
    assert len(raw.time) == len(right.time) - 2
    np.testing.assert_allclose(raw.time[-1], right.time[-1], atol=0.05)
    assert any(line.startswith("stamps of 2 messages are a day or more from the others") for line in findings.repairs)


@pytest.mark.parametrize("times", [2, 4])
def test_poses_that_are_published_several_times_count_once(tmp_path, times):
    def again(m):
        repeats = {key: np.repeat(getattr(m, key), times, axis=0) for key in PER_FRAME}
        later = np.tile(np.arange(times), len(m.stamps)) * (8_333_333 // times)
        return replace(m, **repeats | {key: repeats[key] + later for key in ("stamps", "logged")})

    right, _ = one_trial(tmp_path, clock="stamp")
    raw, findings = one_trial(tmp_path, again, clock="stamp")
    np.testing.assert_allclose(raw.time, right.time, atol=1e-9)
    (line,) = [line for line in findings.repairs if "repeat the one before to the last bit, under new stamps" in line]
    assert re.search(r"poses are new at 1(19|20)(\.\d+)? Hz", line)
    assert not any("lost" in line for line in findings.repairs)


def test_frames_that_a_recorder_logged_in_bursts_lose_nothing(tmp_path):
    """Its clock alone dates them, and it stalls three times; frame numbers tell which is which."""

    def stall(m):
        for begin in (30, 90, 150):
            m.logged[begin : begin + 12] = m.logged[begin + 12] + 20_000 * (np.arange(12) - 12)

    right, _ = one_trial(tmp_path)
    raw, findings = one_trial(tmp_path, stall, clock="log")
    assert len(raw.time) == len(right.time)
    np.testing.assert_allclose(raw.time, right.time, atol=2e-3)
    assert any("log times are up to" in line and "by frame numbers" in line for line in findings.repairs)
    assert not any("lost" in line for line in findings.repairs)


def test_frames_slightly_out_of_order_are_sorted_and_said(tmp_path):
    def swap(m):
        m.stamps[:] = m.stamps[0] + np.round(m.frames * 1e9 / 120).astype(np.int64)
        for values in (m.stamps, m.positions, m.quaternions, m.frames):
            values[[100, 101]] = values[[101, 100]]
        m.stamps[200] = m.stamps[199]

    raw, findings = one_trial(tmp_path, swap, clock="stamp")
    assert findings.repairs == [
        "1 frames out of order sorted by their stamps",
        "1 frames with a stamp that was there already dropped",
    ]
    assert np.all(np.diff(raw.time) > 0)


def test_zero_stamps_need_another_clock(tmp_path):
    def zero(m):
        m.stamps[:] = 0

    refused(one_trial(tmp_path, zero), "/rigid_bodies: all stamps are zero, expected `clock: log`")
    assert len(one_trial(tmp_path, zero, clock="log")[0].time) > 250


def real_releases(folder):
    """Thirteen releases of a hose with three discs; y is up, and the mount is known to a few millimetres."""
    names = sorted(path.name for path in REAL.glob("*.mcap"))
    for name in names:
        (folder / name).symlink_to(REAL / name)
    lines = "".join(f"  - {{file: {name}, experiment: release, split: identify}}\n" for name in names)
    head = "frame: {up: [0, 1, 0]}\nbase: {position: [0.1015, 0.0, 0.105]}\n"
    (folder / "session.yaml").write_text(head + "trials:\n" + lines)


@with_recordings
def test_real_recordings_without_orientations_or_base_body(tmp_path):
    real_releases(tmp_path)
    raw_trials = [raw for raw, _ in taken(tmp_path)]
    assert len(raw_trials) == 13
    for raw in raw_trials:
        assert raw.markers == ("1", "2", "3")
        trial, _ = filter_raw_trial(raw, FILTER)
        assert trial.quaternions is None
        np.testing.assert_allclose(trial.gravity, [0, 0, -9.80665], atol=1e-9)
        rest = trial.positions[-1] - [[0, 0, -0.106], [0, 0, -0.203], [0, 0, -0.322]]
        assert np.abs(rest).max() < 0.04, "the hose hangs along -z again"
        assert 0 <= trial.start < 1.5


def test_a_mount_is_stated_from_one_point_of_it(tmp_path):
    """Wherever the point is: poses in the base frame are those of a mount that is stated in the cameras' frame."""
    raw, _ = one_trial(tmp_path)
    place, turn = np.nanmedian(raw.base_positions, axis=0), raw.base_quaternions[0].tolist()
    point = [0.01, -0.02, 0.03]
    origins = []
    names = {"markers": {name: name for name in raw.markers}}  # else the base would be one
    for base, more in (({"position": (place + point).tolist()}, names), ({"position": point, "body": "base"}, {})):
        content = yaml.safe_load((tmp_path / "session.yaml").read_text())
        path = tmp_path / "session.yaml"
        path.write_text(yaml.safe_dump(content | more | {"base": base | {"quaternion": turn}}))
        ((stated, _),) = taken(tmp_path)
        assert stated.markers == raw.markers, "the point is no marker of the arm"
        origins.append(stated.positions - stated.base_positions[:, None])
    np.testing.assert_allclose(origins[0], origins[1], atol=1e-9)
    path.write_text(path.read_text().replace("body: base", "body: bse"))
    refused(taken(tmp_path)[0], "release_a.mcap: base.body: found 'bse', expected one of base, unit_")


def test_zeros_are_unseen_wherever_positions_are_counted_from(tmp_path):
    """A driver that puts a body that it does not see in the origin, which is within reach of the arm."""
    places = []

    def lose(m):
        positions = m.positions - np.nanmedian(m.positions[:, 0], axis=0) + [0.3, 0.2, 0.1]
        positions[50:250:10, 2] = 0.0
        places.append(positions)
        return replace(m, positions=positions)

    one_trial(tmp_path, lose)
    path = tmp_path / "session.yaml"
    content = yaml.safe_load(path.read_text())
    base = {"position": [0.0, 0.0, 0.0], "body": "base", "quaternion": [1.0, 0.0, 0.0, 0.0]}
    path.write_text(yaml.safe_dump(content | {"base": base}))
    ((raw, findings),) = taken(tmp_path)
    assert not isinstance(raw, InputError), str(raw)
    assert np.isnan(raw.positions[50:250:10, 1, 0]).all()
    assert any("20 " in line for line in findings.repairs)
