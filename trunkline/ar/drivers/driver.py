"""What the Panda and the tendons' motors have in common, however they are reached."""

from typing import Protocol

import numpy as np

TICK = 0.001  # s from one turn to the next, and from one setpoint
CONNECTING = 20.0  # s that a robot has to be there


class Driver(Protocol):
    """Axes, (n,), in rad or m, that are sent where they shall be. None of its calls waits but `close`.

    Attributes:
        fault: what ended it, "" while it goes; it lasts.
    """

    @property
    def fault(self) -> str: ...

    @property
    def ready(self) -> bool:
        """Whether it is under control, and has told where it is."""
        ...

    @property
    def sent(self) -> np.ndarray:
        """Where its axes were sent last, (n,); where they are, before they were sent anywhere."""
        ...

    @property
    def measured(self) -> np.ndarray:
        """Where its axes are, (n,)."""
        ...

    def send(self, due: float, axes: np.ndarray) -> None:
        """Where the axes, (n,), shall be at `due`, s. For one that is ready."""
        ...

    def turn(self, now: float) -> None:
        """What it has to do every TICK s, at `now`, s."""
        ...

    def close(self) -> None:
        """Give it back."""
        ...
