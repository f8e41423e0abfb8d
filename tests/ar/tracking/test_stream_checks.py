"""A stream that stalls or lies is named in one line, and its poses go; noise, gaps and outliers are no fault."""

import re
from dataclasses import replace

import numpy as np
import pytest

from trunkline.ar.session.arm_cameras import expected_bodies
from trunkline.ar.tracking.stream_checks import LASTS, LOOKS, StreamChecks, StreamLimits, along_arm
from trunkline.ar.tracking.tracker import CameraFrame, ExpectedBodies
from trunkline.errors import InputError
from trunkline.recordings.cleaning.usual_distances import usual_distances

STEP, AHEAD = 1 / 120, 1000.0  # s from frame to frame, and that the cameras' clock is ahead
NAMES = ("base", *(f"marker_{number}" for number in range(1, 7)))
BEGINS = 150  # frame from which on a stream lies
SPACING = np.array([0.0, 0.07, 0.13, 0.18, 0.22, 0.25, 0.27])  # m along the arm


def places(time):
    """Of an arm that swings, (7, 3) m, away from the cameras' origin."""
    angle = 0.6 * np.sin(2 * np.pi * 0.5 * time) * SPACING / SPACING[-1]
    return np.array([0.4, 1.1, -0.3]) + SPACING[:, None] * np.stack([np.sin(angle), -np.cos(angle), 0 * angle], axis=1)


USUAL = usual_distances([np.array([places(time) for time in np.arange(0, 4, STEP)])])
EXPECTED = ExpectedBodies(NAMES, True, None, USUAL)


def frames(count=300, seed=0):
    rng = np.random.default_rng(seed)
    for number in range(count):
        quaternions = np.array([[1.0, 0, 0, 0]]) + 0.003 * rng.standard_normal((7, 4))
        quaternions /= np.linalg.norm(quaternions, axis=1, keepdims=True)
        positions = places(number * STEP) + 3e-4 * rng.standard_normal((7, 3))
        stamp = AHEAD + number * STEP
        yield CameraFrame(number, stamp, stamp + 0.004, np.ones(7, bool), positions, quaternions)


def run(lie, expected=EXPECTED, count=300, until=10**9, late=0.0):
    """The checks after a stream that lies from BEGINS on, and what they gave, by frame."""
    checks, taken, before = StreamChecks(expected, StreamLimits()), [], []
    for frame in frames(count):
        now = 5.0 + frame.number * STEP
        if BEGINS <= frame.number < until:
            now += late * (frame.number - BEGINS) * STEP
            frame = lie(frame, before)
        before.append(frame)
        taken.append(checks.take(now, frame))
    return checks, taken


def with_body(frame, body, position=None, quaternion=None):
    positions, quaternions = frame.positions.copy(), frame.quaternions.copy()
    if position is not None:
        positions[body] = position
    if quaternion is not None:
        quaternions[body] = quaternion
    return replace(frame, positions=positions, quaternions=quaternions)


def swapped(frame, _):
    order = [0, 1, 2, 4, 3, 5, 6]
    return replace(frame, positions=frame.positions[order], quaternions=frame.quaternions[order])


def off(frame, _):
    return with_body(frame, 3, frame.positions[3] + [0.0, 0.0, 0.5])


LIES = {  # what the stream does, which bodies lose their poses at last, what is said
    "nan": (lambda f, _: with_body(f, 3, np.nan), [3], "'marker_3': found a position that is not finite"),
    "no rotation": (lambda f, _: with_body(f, 2, None, 0.0), [2], "'marker_2': found a NaN, zero or unnorm"),
    "half a meter off": (off, [3], "'marker_3' is .* mm from 'marker_"),
    "labels": (swapped, [3, 4], "'marker_3': found the labels 'marker_3' and 'marker_4' taken for each other"),
    "a frozen body": (
        lambda f, b: with_body(f, 6, b[BEGINS - 1].positions[6], b[BEGINS - 1].quaternions[6]),
        [6],
        "'marker_6': found poses that only repeat the one before",
    ),
    "all frozen": (
        lambda f, b: replace(f, positions=b[BEGINS - 1].positions, quaternions=b[BEGINS - 1].quaternions),
        None,
        "'base': found poses that only repeat the one before",
    ),
    "millimeters": (lambda f, _: replace(f, positions=1e3 * f.positions), None, "'base' is .* mm from"),
    "clock stands": (lambda f, b: replace(f, stamp=b[BEGINS - 1].stamp), None, "found frame .* expected both to grow"),
    "frames again": (lambda f, b: b[f.number - 100], None, "found frame 63, stamped .*, after 149, 1001.242 s"),
    "count stands": (lambda f, _: replace(f, number=149), None, "found frame 149, stamped 1001.358 s, after 149"),
    "no stamp": (lambda f, _: replace(f, stamp=np.nan), None, "found the stamp nan in frame 1"),
    "clock goes back": (
        lambda f, _: replace(f, stamp=f.stamp - 0.7),
        None,
        "found frame 163, stamped 1000.658 s, after",
    ),
}


@pytest.mark.parametrize("name", LIES)
def test_a_stream_that_lies_is_named_in_one_line_and_for_good(name):
    lie, bodies, sentence = LIES[name]
    checks, taken = run(lie, count=200)
    assert re.match(sentence, checks.fault), checks.fault
    assert "expected" in checks.fault
    assert "\n" not in checks.fault
    if bodies is not None:
        assert np.flatnonzero(np.isnan(taken[-1].positions[:, 0])).tolist() == bodies
    healed, _ = run(lie, until=BEGINS + 40, count=220)
    assert healed.fault == checks.fault


@pytest.mark.parametrize("name", ["nan", "no rotation", "half a meter off", "labels"])
def test_a_lie_is_no_fault_before_it_has_lasted_and_its_pose_goes_at_once(name):
    lie, bodies, _ = LIES[name]
    lasts = round(LASTS / STEP)
    checks, taken = run(lie, until=BEGINS + lasts - 1, count=BEGINS + lasts + 20)
    assert checks.fault == ""
    looked = 1 + round(LOOKS / STEP) if name == "labels" else 0
    for frame in taken[BEGINS + looked : BEGINS + lasts - 1]:
        assert np.flatnonzero(np.isnan(frame.positions[:, 0])).tolist() == bodies
        assert np.flatnonzero(np.isnan(frame.quaternions[:, 0])).tolist() == bodies
    assert np.isfinite(taken[-1].positions).all()


def test_noise_gaps_outliers_and_lost_frames_are_no_fault():
    def lab(frame, _):
        frame = replace(frame, tracked=np.arange(7) != frame.number // 20 % 7)
        if frame.number % 25 == 3:
            frame = with_body(frame, 4, frame.positions[4] + [0.04, 0.0, 0.0])
        if frame.number % 25 == 9:
            frame = off(frame, None)
        if frame.number % 25 == 14:
            frame = replace(frame, positions=np.full((7, 3), 7.0), tracked=np.zeros(7, bool))
        return frame

    checks, taken = run(lab, count=450)
    assert checks.fault == ""
    assert np.isnan(taken[-1].positions[449 // 20 % 7]).all()
    np.testing.assert_allclose(np.linalg.norm(taken[140].quaternions, axis=1), 1.0)


def test_without_usual_distances_what_positions_alone_show_is_still_noticed():
    unknown = ExpectedBodies(NAMES, True)
    for position, sentence in (
        (0.0, "'marker_3': found poses exactly at the origin"),
        (2e6, "'marker_3': found poses with a position beyond 1e\\+06 m"),
    ):
        checks, taken = run(lambda frame, _, position=position: with_body(frame, 3, position), unknown)
        assert re.match(sentence, checks.fault), checks.fault
    checks, _ = run(lambda frame, _: with_body(frame, 3, frame.positions[5]), unknown)
    assert checks.fault.startswith("'marker_3': found poses exactly at the place of another body")
    assert run(off, unknown)[0].fault == ""


def test_where_only_neighbors_distances_are_known_the_arm_reaches_as_far_as_all_of_them():
    """The tip jumps by more than twice the way to the next body, and by less than twice the arm's length."""
    beside = np.abs(np.subtract.outer(np.arange(7), np.arange(7))) == 1
    np.testing.assert_allclose(along_arm(np.where(beside, USUAL, np.nan))[0], np.cumsum([0, *np.diagonal(USUAL, 1)]))
    expected = replace(EXPECTED, distances=np.where(beside, USUAL, np.nan))

    def away(metres):
        return lambda frame, _: replace(frame, positions=frame.positions + [metres, 0.0, 0.0])

    assert run(away(0.3), expected)[0].fault == ""
    assert "farther away than the arm reaches" in run(away(1.0), expected)[0].fault


@pytest.mark.parametrize("order", [[0, 1, 2, 4, 3, 5, 6], [0, 1, 3, 4, 2, 5, 6]])
@pytest.mark.parametrize("gap", [0, 1, 3])
@pytest.mark.parametrize("hides", [slice(None), slice(1)])
def test_labels_that_are_exchanged_are_named_where_no_distances_are_known(order, gap, hides):
    """Also after a short gap, of all of them or of a single one; those that are put right within LASTS are none."""
    wrong, unknown = np.flatnonzero(np.array(order) != np.arange(7)), ExpectedBodies(NAMES, True)

    def exchanged(frame, _):
        tracked = np.ones(7, bool) if frame.number >= BEGINS + gap else ~np.isin(np.arange(7), wrong[hides])
        return replace(frame, positions=frame.positions[order], quaternions=frame.quaternions[order], tracked=tracked)

    checks, taken = run(exchanged, unknown)
    words = " and ".join(f"'marker_{body}'" for body in wrong)
    assert checks.fault == (
        f"'marker_{wrong[0]}': found the labels {words} taken for each other, expected measured poses"
    )
    assert np.flatnonzero(np.isnan(taken[BEGINS + gap].positions[:, 0])).tolist() == wrong.tolist()
    checks, taken = run(exchanged, unknown, until=BEGINS + gap + round(LASTS / STEP) - 1)
    assert checks.fault == ""
    assert np.isfinite(taken[-1].positions).all()


def test_a_stream_of_a_single_body_has_no_distances_and_no_fault():
    checks = StreamChecks(expected_bodies(NAMES[-1:], np.empty(0)), StreamLimits())
    for frame in frames():
        parts = {name: getattr(frame, name)[6:] for name in ("tracked", "positions", "quaternions")}
        taken = checks.take(frame.number * STEP, replace(frame, **parts))
    assert (checks.fault, bool(np.isfinite(taken.positions).all())) == ("", True)


@pytest.mark.parametrize("every", [2, 40])
def test_good_frames_in_between_do_not_end_a_second_stream_of_earlier_stamps(every):
    """Now and then such a frame is no fault."""
    checks = StreamChecks(EXPECTED, StreamLimits())
    for frame in frames():
        now = 5.0 + frame.number * STEP
        checks.take(now, frame)
        if frame.number % every == 1:
            checks.take(now + STEP / 2, replace(frame, stamp=frame.stamp - 0.3))
    assert ("expected both to grow" in checks.fault) == (every == 2), checks.fault


def test_where_no_body_marks_the_base_distances_count_from_the_mount():
    mount, usual = places(0.0)[0], USUAL
    expected = ExpectedBodies(NAMES[1:], False, mount, usual)
    checks = StreamChecks(expected, StreamLimits())
    for frame in frames():
        part = replace(
            frame, tracked=frame.tracked[1:], positions=frame.positions[1:], quaternions=frame.quaternions[1:]
        )
        if frame.number >= BEGINS:
            part = with_body(part, 2, part.positions[2] + [0.0, 0.0, 0.5])
        taken = checks.take(frame.number * STEP, part)
    assert checks.fault.startswith("'marker_3' is")
    assert np.flatnonzero(np.isnan(taken.positions[:, 0])).tolist() == [2]


def test_a_stream_that_repeats_from_its_first_frame_is_named_once_a_window_is_full():
    first, checks = next(frames()), StreamChecks(EXPECTED, StreamLimits())
    for frame in frames():
        checks.take(frame.number * STEP, replace(frame, positions=first.positions))
        assert checks.fault == "" or frame.number >= 119
    assert checks.fault.startswith("found the same poses of all bodies in 120 frames")


def test_frames_that_come_later_and_later_are_named_and_their_age_is_stated():
    checks, taken = run(lambda frame, _: frame, late=0.5)
    ages = [frame.age for frame in taken]
    np.testing.assert_allclose(ages[:BEGINS], 0.004, atol=1e-3)  # from the exposure until it was sent
    assert ages[-1] == pytest.approx(0.004 + 0.5 * 149 * STEP, abs=2e-3)
    assert re.match("found poses that are 0.1\\d s old when they come, expected at most 0.1 s$", checks.fault)


def test_silence_is_named():
    checks, taken = run(lambda frame, _: frame)
    last = taken[-1].stamp + taken[-1].age
    checks.wait(last + 0.14)
    assert checks.fault == ""
    checks.wait(last + 0.16)
    assert checks.fault == "found no frame for 0.16 s, expected one within 0.15 s"


def late_stream(late, then=lambda frame: frame, seconds=4.5):
    """Faults of a stream by the times at which frames come, s from frame BEGINS on; from there on one waits for `late`
    s of its time, and those behind it as long as it does. `then` spoils a frame."""
    checks, faults, times = StreamChecks(EXPECTED, StreamLimits()), [], [-np.inf]
    for frame in frames(BEGINS + round(seconds / STEP)):
        since = (frame.number - BEGINS) * STEP
        times.append(max(times[-1], since + (late(since) if since >= 0 else 0.0)))
        checks.take(7.0 + times[-1], then(frame))
        faults.append(checks.fault)
    return np.array(faults[BEGINS:]), np.array(times[1 + BEGINS :])


def busy(since):
    """For 0.3 s, and 0.6 s later for one frame."""
    return 0.2 if since < 0.3 or abs(since - 0.9) < STEP / 2 else 0.0


def test_a_stream_that_was_late_is_sound_again_once_it_has_been_on_time_for_a_while():
    faults, times = late_stream(busy)
    ill = np.char.startswith(faults, "found poses that are 0.20 s old when they come")
    assert not ill[times < 0.2 + LASTS - STEP].any()
    assert ill[(times > 0.2 + LASTS + STEP) & (times < 3.09)].all()  # 2 s after the last frame that was late
    assert not (faults[times > 3.12] != "").any()


def test_a_stream_that_is_late_again_and_again_stays_a_fault():
    faults, times = late_stream(lambda since: 0.2 if since < 0.3 or since % 1.9 < STEP else 0.0, seconds=6.0)
    assert (faults[times > 0.4] != "").all()


def test_a_late_stream_that_lies_as_well_does_not_recover():
    def nan(frame):
        return with_body(frame, 3, np.nan) if BEGINS + 12 < frame.number < BEGINS + 36 else frame

    faults, times = late_stream(busy, nan)
    assert np.char.startswith(faults[times > 3.0], "'marker_3': found a position that is not finite").all()


@pytest.mark.parametrize("waits", [True, False])
def test_a_silent_stream_is_sound_again_once_frames_have_come_for_a_while(waits):
    checks, faults = StreamChecks(EXPECTED, StreamLimits(recovers=1.0)), []
    for frame in frames(BEGINS + 260):
        now = 5.0 + frame.number * STEP
        if frame.number == BEGINS:
            checks._late = "found no frame"  # as of a gap before
        if BEGINS <= frame.number < BEGINS + 60:  # 0.5 s
            if waits:
                checks.wait(now)
            continue
        checks.take(now, frame)
        faults.append(checks.fault)
    again = np.array(faults[BEGINS:])
    assert (again[: round(0.99 / STEP)] != "").all()
    assert (again[round(1.02 / STEP) :] == "").all()


def test_before_the_first_frame_there_is_no_silence():
    checks = StreamChecks(EXPECTED, StreamLimits())
    checks.wait(100.0)
    assert checks.fault == ""


def test_messages_that_are_no_frames_are_named_if_only_such_come():
    checks = StreamChecks(EXPECTED, StreamLimits())
    for frame in frames(60):
        checks.unreadable(frame.number * STEP, "found 3 bytes, expected 38")
        checks.take(frame.number * STEP, frame)
    assert checks.fault == ""
    for turn in range(13):
        assert checks.fault == ""
        checks.unreadable(1.0 + turn * STEP, "found 3 bytes, expected 38")
    assert checks.fault == "found 3 bytes, expected 38"


def test_a_frame_that_comes_after_a_later_one_is_left_out():
    checks, order = StreamChecks(EXPECTED, StreamLimits()), [0, 1, 3, 2, 4]
    all_frames = list(frames(5))
    taken = [checks.take(turn * STEP, all_frames[number]) for turn, number in enumerate(order)]
    assert [frame is None for frame in taken] == [False, False, False, True, False]
    assert checks.fault == ""


def test_rate_and_loss_are_those_of_the_last_second():
    checks = StreamChecks(EXPECTED, StreamLimits())
    for frame in frames(480):
        if frame.number < 240 or frame.number % 4:
            taken = checks.take(frame.number * STEP, frame)
        if frame.number == 239:
            assert (taken.rate, taken.loss) == (pytest.approx(120), 0.0)
    assert taken.rate == pytest.approx(90, abs=1)
    assert taken.loss == pytest.approx(0.25, abs=0.01)


def test_a_clock_that_drifts_as_quartz_does_makes_no_poses_old():
    checks = StreamChecks(EXPECTED, StreamLimits(age=0.02))
    for frame in frames(1200):
        taken = checks.take(frame.number * STEP * (1 + 1e-4), frame)
    assert taken.age == pytest.approx(0.004, abs=3e-4)
    assert checks.fault == ""


@pytest.mark.parametrize(
    ("build", "message"),
    [
        (lambda: ExpectedBodies(("a", "a"), True), "bodies: found 'a' twice, expected each name once"),
        (
            lambda: ExpectedBodies(("a", "b"), True, None, np.zeros((3, 3))),
            "distances: found shape (3, 3), expected (2, 2), the base first",
        ),
        (
            lambda: ExpectedBodies(("a", "b"), False, None, np.zeros((3, 3))),
            "mount: missing, expected the base's position, as no body marks it",
        ),
    ],
)
def test_expected_bodies_that_do_not_fit_are_refused(build, message):
    with pytest.raises(InputError) as error:
        build()
    assert str(error.value) == message
