"""Numbers and a line of text from one process to another, the newest only, written whole."""

import ctypes
from multiprocessing.context import SpawnContext

import numpy as np

TEXT = 400  # bytes of the line
TRIES = 1000  # of a reader, until what it reads was not written meanwhile


class PoseChannel:
    """Shared memory for `size` numbers and a line. One process writes, with a count that is odd meanwhile."""

    def __init__(self, context: SpawnContext, size: int) -> None:
        self._numbers, self._count = context.RawArray(ctypes.c_double, size), context.RawValue(ctypes.c_uint64, 0)
        self._line = context.RawArray(ctypes.c_char, TEXT)

    def tell(self, numbers: np.ndarray, line: str = "") -> None:
        """Shape (size,)."""
        self._count.value += 1
        np.ctypeslib.as_array(self._numbers)[:] = numbers
        self._line.value = line.encode(errors="replace")[: TEXT - 1]
        self._count.value += 1

    def hear(self) -> tuple[np.ndarray, str]:
        """The newest that was written whole, (size,); zeros before any was."""
        for _ in range(TRIES):
            before = self._count.value
            numbers, line = np.ctypeslib.as_array(self._numbers).copy(), self._line.value
            if before % 2 == 0 and self._count.value == before:
                break
        return numbers, line.decode(errors="ignore")  # after TRIES its writer was killed within, and the times are old
