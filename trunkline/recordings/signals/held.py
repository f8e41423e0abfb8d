"""What commands say between two messages: motors hold the last, unless the messages are samples of a ramp."""

from typing import Literal

import numpy as np

Between = Literal["hold", "line"]

SLOWEST = 0.1  # s between samples of a ramp, at most; what is sent more seldom is sent one by one
ALIKE = 2.0  # factor within which neighbouring intervals of a ramp last
LEAST = 0.05  # share of an interval's change that a neighbour of a ramp has, the same way
CORNER = 1e-6  # s, of the jump from what was held to what is sent
AWAY = 3  # messages of the other publisher in a row, at most,
SOON = 0.15  # s, in which the first one is back
BACK = 0.2  # share of the way by which commands are off the way back
SMOOTH = 0.2  # share of a jump by which commands go the same way just before: then it is no jump
OFTEN = 5  # times, from which on it is no chance


def with_corners(
    time: np.ndarray, commands: np.ndarray, between: Between | None = None
) -> tuple[np.ndarray, np.ndarray]:
    """Times (T',) s and commands (T', K), straight lines through which are what was sent at times (T,) s.

    Args: between: None: held, but for ramps that are sampled evenly, as their samples show.
    """
    if between == "line" or len(time) < 2:
        return time, commands
    change = np.diff(commands, axis=0)
    ramp = np.zeros_like(change, bool) if between == "hold" else _ramps(np.diff(time), change)
    jumps = np.flatnonzero((~ramp & (change != 0)).any(axis=1))
    before = np.where(ramp[jumps], commands[jumps + 1], commands[jumps])
    corner = np.maximum(time[jumps + 1] - CORNER, time[jumps])
    return np.insert(time, jumps + 1, corner), np.insert(commands, jumps + 1, before, axis=0)


def _ramps(steps: np.ndarray, change: np.ndarray) -> np.ndarray:
    """Which changes (T - 1, K) within steps (T - 1,) s go on before or after in the same way. Shape (T - 1, K)."""
    ratio = steps[1:] / np.maximum(steps[:-1], 1e-12)
    even = (ratio < ALIKE) & (ratio > 1 / ALIKE) & (np.maximum(steps[1:], steps[:-1]) <= SLOWEST)
    same = even[:, None] & (change[1:] * change[:-1] > 0)
    sizes = np.abs(change)
    ramp = np.zeros_like(change, bool)
    ramp[:-1] |= same & (sizes[1:] >= LEAST * sizes[:-1])
    ramp[1:] |= same & (sizes[:-1] >= LEAST * sizes[1:])
    return ramp


def to_and_fro(time: np.ndarray, commands: np.ndarray, far: float) -> list[tuple[int, int, float]]:
    """Where commands (T, K) at times (T,) s leave their way by more than `far` for a few messages and are back on it:
    (the message before, the first one back, by how much).

    So do the messages of two publishers that do not agree, and no motor could follow.
    """
    places, back = [], 0
    for at in np.flatnonzero(np.abs(np.diff(commands, axis=0)).max(axis=1, initial=0) > far):
        out, before = commands[at + 1] - commands[at], commands[at] - commands[max(at - 1, 0)]
        if before @ out > SMOOTH * (out @ out):  # on its way there before
            continue
        for ahead in range(2, min(AWAY + 2, len(time) - at)):
            if at < back or time[at + ahead] - time[at] > SOON:
                break
            away = np.abs(commands[at + 1 : at + ahead] - commands[at]).max(axis=1)
            off = float(np.abs(commands[at + ahead] - commands[at]).max())
            if away.min() > far and off < BACK * away.min():
                places.append((int(at), int(at + ahead), float(away.max())))
                back = at + ahead - 1
                break
    return places
