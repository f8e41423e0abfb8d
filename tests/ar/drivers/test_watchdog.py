"""When a limb counts as without setpoints."""

import math

import pytest

from trunkline.ar.drivers.watchdog import Watchdog


def test_before_the_first_setpoint_none_is_late():
    watchdog = Watchdog()
    assert watchdog.last_setpoint == math.inf
    assert watchdog.late(1e9) == ""


@pytest.mark.parametrize(
    ("silent", "fault"),
    [
        (-1.0, ""),
        (0.0, ""),
        (0.0499, ""),
        (0.051, "heard no setpoint for 51 ms, expected one every 1 ms"),
        (2.0, "heard no setpoint for 2000 ms, expected one every 1 ms"),
    ],
)
def test_a_setpoint_is_late_after_50_ms(silent, fault):
    watchdog = Watchdog()
    watchdog.feed(10.0)
    assert watchdog.late(10.0 + silent) == fault


def test_the_last_setpoint_counts():
    watchdog = Watchdog()
    for now in (10.0, 10.04, 10.08):
        watchdog.feed(now)
    assert watchdog.late(10.12) == ""
    assert watchdog.late(10.14) != ""
