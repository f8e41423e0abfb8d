"""What an adapter's end of the line is for: nobody else has it, and what it tells last is known."""

import os
from contextlib import suppress

import pytest

from tests.ar.drivers.test_driver_client import BEGUN, READY, clock, driver, ready  # noqa: F401


def test_nobody_else_has_the_driver_process_end(driver):  # noqa: F811
    """Or its end would not show, as long as somebody still has it."""
    number, adapters = int(driver.process.command[-1]), os.fstat(driver.process.socket.fileno())
    with suppress(OSError):  # it is closed
        assert os.fstat(number).st_ino != adapters.st_ino


@pytest.mark.parametrize("fault", ["", "reflex"])
def test_where_it_was_last_is_known_also_of_a_driver_process_with_a_fault(ready, fault):  # noqa: F811
    ready.process.tell(BEGUN, READY + 0.01, READY + 0.01, fault)
    ready.turn(BEGUN)
    assert ready.measured.tolist() == (READY + 0.01).tolist()
    assert ready.fault == fault
