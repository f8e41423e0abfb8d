"""Tendons in the logs: whose they are, by which clock, and that a curl is refused without them."""

import re
from dataclasses import replace

import numpy as np
import pytest

from tests.recordings.cleaning.test_loading import edit_session, one_trial, taken
from tests.support.sessions import curl_truth
from trunkline.errors import InputError


def curl(folder, change=lambda m: None):
    return one_trial(folder, change, curl_truth())


def refused_curl(folder, message):
    error = taken(folder)[0][0]
    assert isinstance(error, InputError), f"expected a refusal, found {error}"
    assert "curl_40.mcap: trial curl_40: " in str(error)
    assert "\n" not in str(error)
    assert re.search(message, str(error)), str(error)


@pytest.mark.parametrize("key", ["commands: /tendon_commands", "tendon_positions: /tendon_states"])
def test_curl_with_a_named_topic_that_no_log_has_is_refused(tmp_path, key):
    curl(tmp_path)
    edit_session(tmp_path, key, key + "_")
    refused_curl(tmp_path, r"found '/tendon_\w+_', which no log has, expected .*: /tendon_commands, /tendon_states")


def test_curl_without_any_tendon_is_refused(tmp_path):
    def silence(m):
        return replace(m, **{key: getattr(m, key)[:0] for key in ("command_logged", "command_stamps", "commands")})

    def silence_both(m):
        keys = ("tendon_logged", "tendon_stamps", "tendon_positions")
        return replace(silence(m), **{key: getattr(m, key)[:0] for key in keys})

    curl(tmp_path, silence_both)
    edit_session(tmp_path, ", commands: /tendon_commands, tendon_positions: /tendon_states", "")
    refused_curl(tmp_path, "found no command topic and no tendon position topic among: none .*, expected commands")
    raw, _ = curl(tmp_path, silence)
    assert isinstance(raw, InputError), "session.yaml names a command topic that no log has"
    edit_session(tmp_path, "commands: /tendon_commands, ", "")
    assert len(taken(tmp_path)[0][0].tendon_time) > 400, "tendon positions alone will do"


def test_curl_whose_motor_clock_is_too_far_off_is_refused(tmp_path):
    def ahead(m):
        m.command_stamps[:] += 60_000_000_000
        m.tendon_stamps[:] -= 60_000_000_000

    curl(tmp_path, ahead)
    expected = "expected commands or tendon positions within 1 s of the poses"
    far = r"[56]\d\.\d+ s"
    refused_curl(
        tmp_path,
        rf"found \d+ messages on /tendon_commands, {far} after the poses and \d+ messages on /tendon_states, "
        rf"{far} before the poses, {expected}",
    )


@pytest.mark.parametrize("clock", ["log", "frame"])
def test_motors_without_stamps_are_dated_by_the_recorder(tmp_path, clock):
    def zero(m):
        m.command_stamps[:] = m.tendon_stamps[:] = 0

    curl(tmp_path, zero)
    edit_session(tmp_path, "clock: frame", f"clock: {clock}")
    raw, findings = taken(tmp_path)[0]
    assert len(raw.command_time) > 100
    assert len(raw.tendon_time) > 400
    repairs = [repair for repair in findings.repairs if "dated by the recorder's clock" in repair]
    assert len(repairs) == (0 if clock == "log" else 2)


def test_tendons_take_the_names_of_the_session(tmp_path):
    def rename(m):
        return replace(m, tendons=("motor_1", "motor_2", "motor_3"))

    plain, _ = curl(tmp_path)
    curl(tmp_path, rename)
    edit_session(
        tmp_path, "base: base", "base: base\ntendons: {motor_3: tendon_3, motor_1: tendon_1, motor_2: tendon_2}"
    )
    raw, _ = taken(tmp_path)[0]
    assert raw.tendons == ("tendon_3", "tendon_1", "tendon_2")
    np.testing.assert_array_equal(raw.commands, plain.commands[:, [2, 0, 1]])
    np.testing.assert_array_equal(raw.tendon_positions, plain.tendon_positions[:, [2, 0, 1]])
    edit_session(tmp_path, "motor_3:", "motor_4:")
    edit_session(tmp_path, "tendon_3", "tendon_4")
    refused_curl(tmp_path, "command topic: found motor_1, motor_2, motor_3, expected 'motor_4' as in session.yaml")


def test_a_motor_may_wind_several_tendons_by_degrees_of_its_drum(tmp_path):
    plain, _ = curl(tmp_path)
    curl(tmp_path, lambda m: replace(m, tendons=("m1", "m2", "m3")))
    pair = "m1: {unit: deg, spool_radius: 0.02, tendons: {tendon_1: 1, tendon_2: -1}}"
    edit_session(
        tmp_path, "base: base", f"base: base\nmotors: {{m2: {{unit: mm, tendons: {{tendon_3: 0.5}}}}, {pair}}}"
    )
    raw, _ = taken(tmp_path)[0]
    turned = np.pi / 180 * 0.02 * plain.commands[:, 0]
    assert raw.tendons == ("tendon_3", "tendon_1", "tendon_2")
    np.testing.assert_allclose(
        raw.commands, np.stack([5e-4 * plain.commands[:, 1], turned, -turned], axis=1), atol=1e-15
    )
    edit_session(tmp_path, "m2:", "m4:")
    refused_curl(tmp_path, "command topic: found m1, m2, m3, expected 'm4' as in session.yaml")


def test_commands_an_hour_off_are_refused_though_positions_are_there(tmp_path):
    def ahead(m):
        m.command_stamps[:] += 3_600_000_000_000

    curl(tmp_path, ahead)
    refused_curl(
        tmp_path,
        r"found \d+ messages on /tendon_commands, 3597.\d+ s after the poses and \d+ messages on /tendon_states, "
        "expected commands and tendon positions within 1 s of the poses",
    )
