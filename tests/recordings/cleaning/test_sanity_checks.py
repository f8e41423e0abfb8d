"""Data that read well and are wrong: each fault is named, with trial and body or key; sound sessions are left alone."""

import re
from dataclasses import replace

import numpy as np
import pytest

from tests.recordings.cleaning.test_loading import real_releases
from tests.support.folders import with_recordings
from tests.support.sessions import (
    LIMITS,
    MARKERS,
    PLAUSIBLE,
    TENDONS,
    curl_truth,
    instruments,
    motion_truth,
    pull_truth,
    record,
    release_truth,
    static_truth,
)
from trunkline.errors import InputError
from trunkline.recordings.cleaning.checks import Findings
from trunkline.recordings.cleaning.loading import load_raw_trials
from trunkline.recordings.cleaning.sanity_checks import check_sanity
from trunkline.recordings.cleaning.session_checks import check_session
from trunkline.recordings.session.session import read_session

NO_TEST = "splits: no trial of the split test: no error is of trials that nothing was decided on"


def truths():
    """Each experiment in both splits."""
    return [
        static_truth(0.0),
        static_truth(60.0, "validate"),
        replace(static_truth(30.0), name="tilt_30"),
        release_truth(),
        replace(release_truth("validate"), name="release_b"),
        curl_truth(40.0, "identify"),
        curl_truth(60.0),
        pull_truth((40.0, -20.0, -20.0)),
        pull_truth((20.0, -10.0, -10.0), "validate", load=0.05),
        motion_truth(),
        motion_truth("validate", 30.0),
    ]


@pytest.fixture(scope="module")
def folder(tmp_path_factory):
    folder = tmp_path_factory.mktemp("sound")
    record(folder, truths(), instruments())
    return folder


@pytest.fixture(scope="module")
def sound(folder):
    """What `load_raw_trials` gives of a sound session; by trial."""
    loaded = load_raw_trials(folder, read_session(folder), LIMITS)
    return {trial.name: (trial, raw, findings) for trial, raw, findings in loaded}


def judged(sound, base="base", **changed):
    """(what is said of each trial, of the session) after `changed` takes, by trial."""
    raw_trials = [changed.get(name, raw) for name, (_, raw, _) in sound.items()]
    findings = [Findings() for _ in raw_trials]
    session = check_sanity(raw_trials, findings, base, PLAUSIBLE)
    faults = {raw.name: f.faults for raw, f in zip(raw_trials, findings, strict=True) if f.faults}
    return faults, session


def raw_trial_of(sound, name):
    return sound[name][1]


def every(sound, change):
    return {name: change(raw) for name, (_, raw, _) in sound.items()}


def moved(raw, body, offset):
    positions = raw.positions.copy()
    positions[:, body] += offset
    return replace(raw, positions=positions)


def test_a_sound_session_has_no_fault_and_no_warning(folder, sound):
    assert judged(sound) == ({}, [])
    checked = check_session(sound.values(), read_session(folder), PLAUSIBLE, "stop", "sound")
    assert [remarks.repairs + remarks.warnings for remarks in checked.findings] == [[NO_TEST]] * len(sound)


@with_recordings
def test_real_recordings_have_no_fault(tmp_path):
    real_releases(tmp_path)
    session = read_session(tmp_path)
    checked = check_session(load_raw_trials(tmp_path, session, LIMITS), session, PLAUSIBLE, "stop", "real")
    assert len(checked.raw_trials) == 13
    for remarks in checked.findings:
        no_validate, no_test, no_others = remarks.warnings
        assert no_validate == "splits: no trial of the split validate: no error is of trials that were not fitted"
        assert no_test == NO_TEST
        assert no_others.startswith("experiments: no static_tilt, curl, static_pull, motion in the session: data/raw")


@pytest.mark.parametrize("name", ["tilt_30", "release_a", "release_b", "curl_60"])
@pytest.mark.parametrize("body", range(4))
def test_a_body_that_is_off_is_named(sound, name, body):
    trials, session = judged(sound, **{name: moved(raw_trial_of(sound, name), body, [0.0, 0.3, 0.4])})
    assert list(trials) == [name]
    (fault,) = [fault for fault in trials[name] if "expected neighbours at distances" in fault]
    assert fault.startswith(f"{MARKERS[body]!r} is ")
    assert session == []


def test_a_body_that_is_off_by_little_is_left(sound):
    assert judged(sound, release_a=moved(raw_trial_of(sound, "release_a"), 2, [0.0, 0.01, 0.0])) == ({}, [])


def test_a_body_that_stands_still_beside_the_arm_is_named(sound):
    def stands(raw):
        positions = raw.positions.copy()
        positions[:, 2] = raw.base_positions + [0.0, -0.25, 0.0]
        return replace(raw, positions=positions)

    _, session = judged(sound, **every(sound, stands))
    assert any(fault.startswith("'unit_06' ") and fault.endswith("is it on the arm?") for fault in session), session


@pytest.mark.parametrize("factor", [1e3, 1e-3])
def test_one_log_in_another_unit_is_named(sound, factor):
    raw = raw_trial_of(sound, "release_b")
    other = replace(raw, positions=factor * raw.positions, base_positions=factor * raw.base_positions)
    trials, _ = judged(sound, release_b=other)
    assert list(trials) == ["release_b"]
    match = re.match(r"unit: bodies are ([\d.]+) times as far apart as", trials["release_b"][0])
    assert match
    assert float(match[1]) == pytest.approx(factor, rel=0.05)


@pytest.mark.parametrize("order", [(1, 0, 2, 3), (0, 2, 1, 3), (0, 1, 3, 2), (2, 1, 0, 3)])
def test_exchanged_markers_of_the_whole_session_are_named(sound, order):
    names = tuple(MARKERS[place] for place in order)
    trials, session = judged(sound, **every(sound, lambda raw: replace(raw, markers=names)))
    assert trials == {}
    assert len(session) == 1
    assert "check `markers` in session.yaml" in session[0]
    for marker, name in zip(MARKERS, names, strict=True):
        assert (marker == name) or repr(name) in session[0]


@pytest.mark.parametrize("names", [MARKERS[::-1], ("root", "a", "b", "tip"), ("7", "b8", "c9", "1")])
def test_markers_named_from_the_tip_or_without_numbers_are_left(sound, names):
    assert judged(sound, **every(sound, lambda raw: replace(raw, markers=names))) == ({}, [])


def test_a_base_that_moves_while_a_marker_rests_is_named(sound):
    def exchange(raw):
        positions, quaternions = raw.positions.copy(), raw.quaternions.copy()
        positions[:, 0], quaternions[:, 0] = raw.base_positions, raw.base_quaternions
        changed = {"base_positions": raw.positions[:, 0], "base_quaternions": raw.quaternions[:, 0]}
        names = ("base", *raw.markers[1:])
        return replace(raw, positions=positions, quaternions=quaternions, markers=names, **changed)

    _, session = judged(sound, base="unit_02", **every(sound, exchange))
    assert session[-1].startswith("base: 'unit_02' moves by ")
    assert "while 'base' moves by" in session[-1]


@pytest.mark.parametrize(
    ("name", "experiment", "level", "message"),
    [
        ("release_a", "static_tilt", 0.0, r"expected at most 2 % in a static_tilt: is it another experiment \(release"),
        ("curl_40", "static_tilt", 0.0, "expected at most 2 % in a static_tilt"),
        ("tilt_00", "release", None, "expected more than 2 % in a release: is it another experiment"),
        ("curl_40", "release", None, "commands: 'tendon_1' is wound by 40 mm, expected a release without actuation"),
        ("tilt_00", "curl", 40.0, "expected more than 2 % in a curl"),
        ("curl_40", "static_pull", None, "expected at most 2 % in a static_pull: is it another experiment"),
        ("motion_identify", "static_pull", None, "commands: 'tendon_1' is wound by .* expected a static_pull to hold"),
        ("pull_40_-20_-20", "motion", None, "expected more than 2 % in a motion"),
        (
            "pull_40_-20_-20",
            "static_tilt",
            0.0,
            "experiment: commands: 'tendon_1' is drawn in by 40 mm, expected a static_tilt without actuation",
        ),
        ("motion_identify", "release", None, "commands: 'tendon_1' is wound by"),
    ],
)
def test_a_trial_labelled_as_another_experiment_is_named(sound, name, experiment, level, message):
    trials, _ = judged(sound, **{name: replace(raw_trial_of(sound, name), experiment=experiment, level=level)})
    assert list(trials) == [name]
    assert any(re.search(message, fault) for fault in trials[name]), trials


def with_tendons(raw, commands_mm, positions_mm):
    """The raw trial beside motors that log these pulls of the three tendons throughout; nothing where None."""
    time = np.arange(-0.5, raw.time[-1] + 0.5, 0.01)
    rows = [
        np.empty((0, 3)) if pulls is None else 1e-3 * np.tile(pulls, (len(time), 1))
        for pulls in (commands_mm, positions_mm)
    ]
    times = {"command_time": time[: len(rows[0])], "tendon_time": time[: len(rows[1])]}
    return replace(raw, tendons=TENDONS, commands=rows[0], tendon_positions=rows[1], **times)


SLACK, PULLED = (-300.0, -300.0, -300.0), (-300.0, 40.0, -300.0)


@pytest.mark.parametrize("name", ["tilt_30", "release_a"])
@pytest.mark.parametrize(
    ("commands", "positions", "key"),
    [
        (PULLED, None, "commands"),
        (PULLED, PULLED, "commands"),
        (PULLED, SLACK, "commands"),
        (None, PULLED, "tendon positions"),
        (SLACK, PULLED, "tendon positions"),
    ],
)
def test_a_pull_that_is_held_where_nothing_is_to_pull_is_named(sound, name, commands, positions, key):
    trials, _ = judged(sound, **{name: with_tendons(raw_trial_of(sound, name), commands, positions)})
    assert list(trials) == [name]
    (fault,) = trials[name]
    pattern = rf"experiment: {key}: 'tendon_2' is drawn in by 40\.?\d* mm, expected a \w+ without actuation"
    assert re.fullmatch(pattern, fault), fault


@pytest.mark.parametrize("name", ["tilt_30", "release_a"])
@pytest.mark.parametrize("commands", [None, (0.0, 0.0, 0.0), (2.0, -1.0, -1.0), SLACK])
def test_loose_tendons_where_nothing_is_to_pull_are_left(sound, name, commands):
    assert judged(sound, **{name: with_tendons(raw_trial_of(sound, name), commands, SLACK)}) == ({}, [])
    assert judged(sound, **{name: with_tendons(raw_trial_of(sound, name), commands, None)}) == ({}, [])


def test_loose_tendons_of_encoders_that_start_anywhere_are_left(sound):
    def shifted(name, millimetres):
        raw = raw_trial_of(sound, name)
        return replace(raw, tendon_positions=raw.tendon_positions + 1e-3 * millimetres)

    driven = [name for name in sound if name.startswith(("curl", "pull", "motion"))]
    loose = with_tendons(raw_trial_of(sound, "tilt_30"), SLACK, (200.0, 200.0, 200.0))
    same = {name: shifted(name, 500.0) for name in driven}  # slack is 200 mm then
    assert judged(sound, tilt_30=loose, **same) == ({}, [])
    anywhere = {name: shifted(name, 100.0 * index) for index, name in enumerate(driven)}
    assert judged(sound, tilt_30=loose, **anywhere) == ({}, [])
    drawn_in = with_tendons(raw_trial_of(sound, "tilt_30"), SLACK, (200.0, 540.0, 200.0))
    (fault,) = judged(sound, tilt_30=drawn_in, **same)[0]["tilt_30"]
    assert fault.startswith("experiment: tendon positions: 'tendon_2' is drawn in by 40")


def test_a_static_tilt_in_which_the_arm_swings_is_named(sound):
    raw = raw_trial_of(sound, "tilt_30")
    swing = np.sin(2 * np.pi * 1.5 * raw.time)[:, None, None] * [[0.01], [0.02], [0.03], [0.035]] * [1.0, 0.0, 0.0]
    trials, _ = judged(sound, tilt_30=replace(raw, positions=raw.positions + swing))
    assert list(trials) == ["tilt_30"]
    assert "experiment: 'unit_08' moves by 6" in trials["tilt_30"][-1] or "moves by 7" in trials["tilt_30"][-1]


def pulls(raw, commands, positions):
    return replace(raw, commands=commands(raw.commands), tendon_positions=positions(raw.tendon_positions))


def same(values):
    return values


@pytest.mark.parametrize(
    ("commands", "positions", "message"),
    [
        (lambda c: 1e3 * c, same, r"commands: found pulls from -20 to 40 m, expected about 0.04 m.*are they in mm?"),
        (lambda c: 1e3 * c, lambda p: 1e3 * p, "are they in mm?"),
        (lambda c: -c, same, "commands: found pulls from -0.04 to 0.02 m, .*: is the sign reversed?"),
        (lambda c: -c, lambda p: -p, "is the sign reversed?"),
        (lambda c: 0 * c, same, "commands: found pulls from -?0 to 0 m"),
        (same, lambda p: -p, "tendon positions: .* is the sign reversed?"),
        (same, lambda p: p / 10, "tendon positions: found pulls from -0.002.* to 0.004"),
        (same, lambda p: p[:, [1, 0, 2]], "tendons: 'tendon_1' moves against its commands"),
        (
            lambda c: c * [1, 0, 0],
            lambda p: p[:, [1, 0, 2]] * [0, 1, 0],
            "'tendon_2' follows the commands of 'tendon_1",
        ),
    ],
)
def test_tendons_that_cannot_be_are_named(sound, commands, positions, message):
    raw = raw_trial_of(sound, "curl_40")
    raw = replace(raw, commands=raw.commands - raw.commands[0])
    trials, _ = judged(sound, curl_40=pulls(raw, commands, positions))
    assert list(trials) == ["curl_40"]
    assert any(re.search(message, fault) for fault in trials["curl_40"]), trials


def test_pulls_from_an_encoder_that_starts_anywhere_are_left(sound):
    raw = raw_trial_of(sound, "curl_40")
    assert judged(sound, curl_40=replace(raw, tendon_positions=raw.tendon_positions + 1.7)) == ({}, [])
    half = len(raw.command_time) // 2
    wound = raw.tendon_time > raw.command_time[half]
    later = {"command_time": raw.command_time[half:], "commands": raw.commands[half:]}
    later |= {"tendon_time": raw.tendon_time[wound], "tendon_positions": raw.tendon_positions[wound]}
    assert judged(sound, curl_40=replace(raw, **later)) == ({}, []), "a window that begins with the arm curled"


@pytest.mark.parametrize("name", ["pull_40_-20_-20", "motion_identify"])
def test_pulls_without_a_level_that_are_in_mm_are_named(sound, name):
    raw = raw_trial_of(sound, name)
    trials, _ = judged(sound, **{name: replace(raw, commands=1e3 * raw.commands)})
    assert list(trials) == [name]
    (fault,) = trials[name]
    pattern = r"commands: found pulls up to \d+.* m, expected less than the arm's length of 0\.\d+ m: are they in mm"
    assert re.match(pattern, fault)
    both = pulls(raw, lambda c: 1e3 * c, lambda p: 1e3 * p)
    if name.startswith("motion"):
        assert any("tendon positions: found pulls up to" in fault for fault in judged(sound, **{name: both})[0][name])


def test_a_static_pull_whose_window_touches_the_way_to_the_next_is_left(sound):
    raw = raw_trial_of(sound, "pull_40_-20_-20")
    next_time = raw.command_time[-1] + np.arange(1, 80) / 100
    ramp = raw.commands[-1] + np.linspace(0, 0.02, 79)[:, None]
    commanded = np.concatenate([raw.command_time, next_time]), np.concatenate([raw.commands, ramp])
    measured = np.concatenate([raw.tendon_time, next_time]), np.concatenate([raw.tendon_positions, ramp])
    for ahead in (0.0, 0.5):  # s, of the motors' clock
        later = {"command_time": commanded[0] - ahead, "tendon_time": measured[0] - ahead}
        later = replace(raw, commands=commanded[1], tendon_positions=measured[1], **later)
        assert judged(sound, **{raw.name: later}) == ({}, [])


def test_static_pulls_have_no_say_in_the_clocks(tmp_path):
    """A ramp beside the window would fit any offset at which it is not seen."""
    truth = pull_truth()
    commands = truth.commands.copy()
    truth.commands = commands * np.clip(np.arange(len(commands)) / 40, 0, 1)[:, None]
    truth.tendon_positions = truth.tendon_positions * np.clip(np.arange(len(truth.time)) / 200, 0, 1)[:, None]
    record(tmp_path, [truth], instruments())
    ((_, _, findings),) = load_raw_trials(tmp_path, read_session(tmp_path), LIMITS)
    assert findings.by_motion is None


def test_exchanged_topics_are_named(sound):
    raw = raw_trial_of(sound, "curl_40")
    assert raw.tendons == TENDONS
    time = {"command_time": raw.tendon_time, "tendon_time": raw.command_time}
    noisy = replace(raw, commands=raw.tendon_positions, tendon_positions=raw.commands, **time)
    assert "commands are noisier" in judged(sound, curl_40=noisy)[0]["curl_40"][0]
    early = replace(raw, tendon_time=raw.tendon_time - 0.05)
    (fault,) = judged(sound, curl_40=early)[0]["curl_40"]
    assert fault.startswith("topics: what is measured comes 50 ms before its command: are `commands` and")
    late = replace(raw, tendon_time=raw.tendon_time + 0.05)
    assert judged(sound, curl_40=late) == ({}, [])


def gathered(folder, sound, chosen=lambda raw: True, otherwise="refuse", refused_trials="stop", **changed):
    """The session of the chosen takes, of which some are `changed`, by trial."""
    taken = [(trial, changed.get(name, raw), replace(findings, warnings=[], faults=[]))
             for name, (trial, raw, findings) in sound.items() if chosen(raw)]  # fmt: skip
    return check_session(taken, read_session(folder), replace(PLAUSIBLE, otherwise=otherwise), refused_trials, "here")


def test_what_is_not_plausible_is_refused_left_out_or_said(folder, sound):
    off = moved(raw_trial_of(sound, "release_a"), 2, 0.5)
    with pytest.raises(InputError, match=r"release_a\.mcap: trial release_a: 'unit_06' is "):
        gathered(folder, sound, release_a=off)
    left = gathered(folder, sound, refused_trials="leave_out", release_a=off)
    assert list(left.refused) == ["release_a"]
    assert "'unit_06' is " in left.refused["release_a"]
    assert "release_a" not in [raw.name for raw in left.raw_trials]
    checked = gathered(folder, sound, otherwise="warn", release_a=off)
    names = [raw.name for raw in checked.raw_trials]
    warnings = checked.findings[names.index("release_a")].warnings
    assert warnings[0].startswith("'unit_06' is ")


def test_a_level_that_the_base_contradicts_is_said(folder, sound):
    checked = gathered(folder, sound, tilt_60=replace(raw_trial_of(sound, "tilt_60"), level=10.0))
    warnings = {raw.name: remarks.warnings for raw, remarks in zip(checked.raw_trials, checked.findings, strict=True)}
    assert warnings["tilt_60"][1].startswith("level: found 10, but the base is tilted by 60°")
    assert all(warnings[name] == [NO_TEST] for name in warnings if name != "tilt_60")


@pytest.mark.parametrize(
    ("chosen", "expected"),
    [
        (
            lambda raw: raw.split == "identify",
            ["splits: no trial of the split validate: no error is of trials that were not fitted", NO_TEST],
        ),
        (lambda raw: raw.name != "curl_60", [NO_TEST, "splits: no curl of the split validate, which the session has"]),
        (
            lambda raw: raw.split == "validate",
            ["splits: no trial of the split identify: nothing can be identified", NO_TEST],
        ),
        (
            lambda raw: raw.experiment != "curl",
            [NO_TEST, "experiments: no curl in the session: data/raw/README.md tells which settings do without"],
        ),
        (
            lambda raw: raw.experiment != "motion",
            [
                NO_TEST,
                "experiments: no motion in the session: in params.yaml `experiments: [curl]` under "
                "identify_control: data/raw/README.md",
            ],
        ),
    ],
    ids=["identify alone", "no curl to validate", "validate alone", "no curl", "no motion"],
)
def test_a_split_or_an_experiment_that_the_session_lacks_is_said(folder, sound, chosen, expected):
    for remarks in gathered(folder, sound, chosen).findings:
        assert [warning for warning in remarks.warnings if warning.startswith(("splits:", "experiments:"))] == expected


def test_usual_distances_of_other_splits_are_said(tmp_path):
    record(tmp_path, [release_truth("validate"), static_truth(0.0, "validate")], instruments())
    for _, _, findings in load_raw_trials(tmp_path, read_session(tmp_path), LIMITS):
        assert "no trial of the split identify can be read: the unit and the usual" in findings.warnings[0]
