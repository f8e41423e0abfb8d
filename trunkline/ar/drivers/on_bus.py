"""Motors, real or simulated, on a CAN bus. Both are turned from outside, RATE times a second."""

import random
import threading
import time
from collections.abc import Sequence

import can

from trunkline.ar.drivers.gm6020 import FEEDBACK, NUMBERS, RATE, Feedback, command_frames, feedback_of
from trunkline.ar.drivers.motors import MotorGroup, MotorSettings, MotorsOnBus
from trunkline.ar.drivers.simulated_motors import SIMULATED, MotorParameters, SimulatedMotors
from trunkline.errors import InputError

FILTERS: can.typechecking.CanFilters = [
    {"can_id": FEEDBACK + number, "can_mask": 0x7FF, "extended": False} for number in NUMBERS
]


def open_bus(interface: str, channel: str) -> can.BusABC:
    """A bus of python-can at 1 Mbit/s, as its `interface` ("socketcan", "slcan", …) and `channel` ("can0", …) name it.

    A bus of the kernel has its bit rate already: `ip link set can0 up type can bitrate 1000000`.

    Raises:
        InputError: there is none.
    """
    try:
        return can.Bus(channel=channel, interface=interface, bitrate=1_000_000)
    except (can.CanError, OSError, ImportError, ValueError, NotImplementedError) as error:
        raise InputError(f"bus {channel}: found no {interface} bus that opens ({error})") from error


class BusMotors:
    """The tendons' motors on `bus`: what `MotorGroup` finds goes out, what they say comes in.

    Of the frames of one motor that wait, the newest counts: their age is not known, and the cable's speed is made of
    times.
    """

    def __init__(self, settings: MotorSettings, bus: can.BusABC) -> None:
        self.motors, self._bus, self._fault = MotorGroup(settings, time.monotonic()), bus, ""
        self._off = dict.fromkeys(settings.numbers, 0.0)
        bus.set_filters(FILTERS)

    @property
    def fault(self) -> str:
        """What ended it, "" while it goes."""
        return self.motors.fault or self._fault

    def turn(self, pulls: Sequence[float], speeds: Sequence[float]) -> None:
        """Hear, and send the currents with which the cables follow `pulls` (K,), m, and `speeds` (K,), m/s."""
        newest: dict[int, Feedback] = {}
        try:
            while (message := self._bus.recv(0)) is not None:
                feedback = feedback_of(message.arbitration_id, bytes(message.data))
                if feedback is not None and not message.is_error_frame:
                    newest[feedback.number] = feedback
        except (can.CanError, OSError) as error:
            self._fail(error)
        now = time.monotonic()
        for feedback in newest.values():
            self.motors.hear(feedback, now)
        self._send(self._off if self.fault else self.motors.currents(pulls, speeds, now))

    def close(self) -> None:
        """No current, and no bus."""
        self._send(self._off)
        self._bus.shutdown()

    def _send(self, currents: dict[int, float]) -> None:
        """Each frame that the bus takes."""
        for identifier, data in command_frames(currents):
            try:
                self._bus.send(can.Message(arbitration_id=identifier, data=data, is_extended_id=False))
            except (can.CanError, OSError) as error:
                self._fail(error)

    def _fail(self, error: Exception) -> None:
        self._fault = self._fault or f"bus: {error}"


class SimulatedMotorsOnBus:
    """Simulated motors on the other end of `bus`. `lost`: share of frames, either way, that get lost."""

    def __init__(self, plants: Sequence[MotorParameters], bus: can.BusABC, seed: int = 0) -> None:
        self.simulated, self.lost = SimulatedMotors(plants, time.monotonic()), 0.0
        self._bus, self._random = bus, random.Random(seed)

    def turn(self) -> None:
        """Hear, move until now, and say where they are."""
        now = time.monotonic()
        while (message := self._bus.recv(0)) is not None:
            if self._random.random() >= self.lost:
                self.simulated.hear(message.arbitration_id, bytes(message.data), now)
        for identifier, data in self.simulated.advance(now):
            if self._random.random() >= self.lost:
                self._bus.send(can.Message(arbitration_id=identifier, data=data, is_extended_id=False))

    def close(self) -> None:
        """Off the bus."""
        self._bus.shutdown()


class SimulatedBusMotors(BusMotors):
    """The driver's side of a bus with `simulated` motors, which turn when it does: python-can's bus "virtual" is of
    one process only, and two threads of it would wait for each other."""

    def __init__(self, settings: MotorSettings, bus: can.BusABC, simulated: SimulatedMotorsOnBus) -> None:
        super().__init__(settings, bus)
        self._simulated = simulated

    def turn(self, pulls: Sequence[float], speeds: Sequence[float]) -> None:
        self._simulated.turn()
        super().turn(pulls, speeds)

    def close(self) -> None:
        super().close()
        self._simulated.close()


def motors_on(settings: MotorsOnBus) -> BusMotors:
    """The motors that are named.

    Raises:
        InputError: their bus is not there.
    """
    bus = open_bus(settings.interface, settings.bus)
    if settings.bus != SIMULATED:
        return BusMotors(settings.motors, bus)
    simulated = SimulatedMotorsOnBus(motor_parameters(settings.motors), open_bus(settings.interface, settings.bus))
    return SimulatedBusMotors(settings.motors, bus, simulated)


def motor_parameters(settings: MotorSettings) -> list[MotorParameters]:
    """Simulated motors that are as the settings have them."""
    winch = settings.reel
    return [
        MotorParameters(inertia=winch.inertia, radius=winch.radius, stiffness=winch.stiffness, side=side)
        for side in settings.sides
    ]


class SimulatedMotorsThread(SimulatedMotorsOnBus):
    """Simulated motors that turn in a thread. `reeled`: (s, (m, …)) of every turn. `driven`: s of the last turn that
    ended with a motor driven."""

    def __init__(self, plants: Sequence[MotorParameters], bus: can.BusABC, seed: int = 0) -> None:
        super().__init__(plants, bus, seed)
        self.reeled, self.driven, self._ended = [], 0.0, threading.Event()
        self._thread = threading.Thread(target=self._run, daemon=True, name="bank")
        self._thread.start()

    def close(self) -> None:
        self._ended.set()
        self._thread.join()
        super().close()

    def _run(self) -> None:
        due = time.monotonic()
        while not self._ended.wait(max(due - time.monotonic(), 0.0)):
            now = time.monotonic()
            due = max(due + 1 / RATE, now - 0.1)
            self.turn()
            if any(motor.current for motor in self.simulated.motors):
                self.driven = now
            self.reeled.append((now, tuple(motor.reeled for motor in self.simulated.motors)))
