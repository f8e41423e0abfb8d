"""The tendons' motors against simulated ones, in real time on python-can's virtual bus, as a table.

    python -m trunkline.ar.drivers.self_test

It moves nothing real. Pulls are compared with what the simulated cables did, zero with where their tension is the
pretension.
"""

import math
import sys
import time
from collections.abc import Callable
from dataclasses import replace

import can
import numpy as np

from trunkline.ar.drivers.gm6020 import COUNTS, RATE
from trunkline.ar.drivers.motors import MotorSettings
from trunkline.ar.drivers.on_bus import BusMotors, SimulatedMotorsThread
from trunkline.ar.drivers.settings import read_execution_config
from trunkline.ar.drivers.simulated_motors import MotorParameters
from trunkline.errors import InputError, in_one_line

DEPTH, SECONDS = 0.09, 2.0  # m and s of a pull
LOST = 0.01
Row = tuple[str, str, str, bool]


class MotorTrial:
    """Motors and simulated ones, joined by a bus, and the driver's loop."""

    def __init__(self, settings: MotorSettings, plants: list[MotorParameters]) -> None:
        name = f"check {id(self)}"
        self.simulated = SimulatedMotorsThread(plants, can.Bus(interface="virtual", channel=name))
        self.driver = BusMotors(settings, can.Bus(interface="virtual", channel=name))
        self.turns: list[float] = []

    def until(self, ended: Callable[[], bool], way: Callable[[float], tuple[float, float]], seconds: float) -> None:
        """Turn RATE times a second, all cables on their `way`, pull and speed, until it has `ended`."""
        due, end = time.monotonic(), time.monotonic() + seconds
        while not ended() and due < end:
            time.sleep(max(due - time.monotonic(), 0.0))
            now = time.monotonic()
            pull, speed = way(now)
            count = len(self.simulated.simulated.motors)
            self.driver.turn([pull] * count, [speed] * count)
            self.turns.append(now)
            due = max(due + 1 / RATE, now - 0.02)

    def close(self) -> None:
        """Off the bus."""
        self.driver.close()
        self.simulated.close()


def rest(now: float) -> tuple[float, float]:
    """At zero."""
    return 0.0, 0.0


def cosine(begun: float) -> Callable[[float], tuple[float, float]]:
    """In by DEPTH in SECONDS, and out again."""

    def way(now: float) -> tuple[float, float]:
        phase = math.pi * min(max(now - begun, 0.0), 2 * SECONDS) / SECONDS
        return DEPTH / 2 * (1 - math.cos(phase)), DEPTH / 2 * math.pi / SECONDS * math.sin(phase)

    return way


def errors(trial: MotorTrial, zeros: np.ndarray) -> tuple[float, float]:
    """Root mean square and largest, m, of a pull and its release, the worst cable's, in true pull.

    Raises:
        InputError: it did not come to its end.
    """
    begun = time.monotonic()
    way, first = cosine(begun), len(trial.simulated.reeled)
    trial.until(lambda: bool(trial.driver.fault), way, 2 * SECONDS)
    if trial.driver.fault:
        raise InputError(f"motors: {trial.driver.fault} (is this machine too busy for a loop in real time?)")
    rows = trial.simulated.reeled[first:]
    off = np.array([reeled for _, reeled in rows]) - zeros - np.array([[way(t)[0]] for t, _ in rows])
    return float(np.sqrt((off**2).mean(axis=0)).max()), float(np.abs(off).max())


def measures(settings: MotorSettings) -> list[Row]:
    """What was asked, what is wanted, what was found, whether it is so.

    Raises:
        InputError: the motors have a fault before it is wanted.
    """
    winch = settings.reel
    turn = 2 * math.pi * winch.radius
    begins = COUNTS - round(0.5 * DEPTH / turn * COUNTS) % COUNTS  # so that the first wraps within a pull
    plant = MotorParameters(radius=winch.radius, inertia=winch.inertia, stiffness=1.2 * winch.stiffness)
    plants = [replace(plant, begins=begins + 700 * n, slack=0.01 * (n + 1), side=side)
              for n, side in enumerate(settings.sides)]  # fmt: skip
    trial, rows = MotorTrial(settings, plants), []
    try:
        trial.until(lambda: trial.driver.motors.homed or bool(trial.driver.fault), rest, 30.0)
        if trial.driver.fault:
            raise InputError(f"motors: {trial.driver.fault}")
        true = np.array([p.slack + winch.pretension / p.stiffness for p in plants])
        zeros = np.array(trial.simulated.reeled[-1][1]) - np.array(trial.driver.motors.pulls)
        off = float(np.abs(zeros - true).max())
        rows.append(("homing: zero from the pretension's place", "≤ 1 mm", f"{1e3 * off:.2f} mm", off <= 1e-3))

        trial.turns.clear()
        rms, most = errors(trial, zeros)
        what, result = f"{1e3 * DEPTH:.0f} mm pull in {SECONDS:g} s, and its release", format_errors(rms, most)
        rows.append((what, "≤ 0.5 mm rms", result, rms <= 5e-4))
        periods = np.diff(trial.turns)
        rate, late = 1 / periods.mean(), 1e3 * np.quantile(periods, (0.5, 0.99, 1.0))
        result = f"{rate:.0f} Hz; periods {late[0]:.2f} / {late[1]:.2f} / {late[2]:.2f} ms median, 99 %, most"
        rows.append(("loop", "≥ 950 Hz", result, bool(rate >= 950)))
        jump = float(
            np.abs(np.array(trial.simulated.reeled[-1][1]) - zeros - np.array(trial.driver.motors.pulls)).max()
        )
        rows.append(("encoder wrapped: counted pull from the true one", "no jump", f"{1e3 * jump:.2f} mm", jump < 1e-3))

        trial.simulated.lost = LOST
        rms, most = errors(trial, zeros)
        rows.append((f"the same, {LOST:.0%} of frames lost", "≤ 1 mm rms", format_errors(rms, most), rms <= 1e-3))
        trial.simulated.lost = 0.0

        trial.until(lambda: False, rest, 0.2)
        after = silence(trial, lambda: None)
        rows.append(("no command: bank drives no current after", "100 ms", f"{1e3 * after:.0f} ms", 0 < after <= 0.11))
        trial.until(lambda: False, rest, 0.2)
        trial.simulated.simulated.motors[0].silent = True
        after = silence(trial, lambda: trial.until(lambda: False, rest, 0.001))
        result = f"{1e3 * after:.0f} ms; {trial.driver.fault}"
        rows.append(("a motor silent: no motor driven after", "≤ 50 ms", result, 0 < after <= 0.05))
    finally:
        trial.close()
    return rows


def format_errors(rms: float, most: float) -> str:
    """Of errors, m."""
    return f"{1e3 * rms:.2f} mm rms, {1e3 * most:.2f} mm most"


def silence(trial: MotorTrial, each: Callable[[], None]) -> float:
    """s for which any simulated motor still drives a current, `each` being done for half a second; 0 where none did."""
    begun = time.monotonic()
    while time.monotonic() - begun < 0.5:
        each()
        time.sleep(0.0005)
    return max(trial.simulated.driven - begun, 0.0)


def table(rows: list[Row]) -> str:
    """In Markdown."""
    lines = [f"| {what} | {wanted} | {result} | {'yes' if so else 'NO'} |" for what, wanted, result, so in rows]
    return "\n".join(["| asked | wanted | found | |", "|---|---|---|---|", *lines])


@in_one_line
def main(arguments: list[str]) -> int:
    if arguments:
        print((__doc__ or "").strip())
        return 0 if arguments in (["-h"], ["--help"]) else 2
    rows = measures(read_execution_config().motors)
    print(table(rows))
    return 0 if all(so for *_, so in rows) else 1


if __name__ == "__main__":
    sys.exit(main(sys.argv[1:]))
