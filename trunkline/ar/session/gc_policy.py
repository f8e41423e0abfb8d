"""Python's collection of garbage, kept away from a robot that moves.

A collection of all objects of a long session takes longer than a robot goes on without a permit (`DEAD_MAN`): 0.1 s
and more. So while the robot moves only young objects are collected.
"""

import gc

NEVER = 2**31 - 1  # collections of young objects before one of all


class GCPolicy:
    """Of the server's process."""

    def __init__(self) -> None:
        self._usual, self._moving = gc.get_threshold(), False

    def tell(self, moving: bool) -> None:
        """Whether the robot is `moving`."""
        if moving != self._moving:
            self._moving = moving
            first, second, third = self._usual
            gc.set_threshold(first, second, NEVER if moving else third)
