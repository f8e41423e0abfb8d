"""Metres or millimetres: how far apart the bodies are tells which."""

import numpy as np

LARGEST_ARM = 20.0  # m; bodies farther apart than this are no arm in metres, nor one in mm below 20 mm
SMALLEST_ARM = 0.02  # m


def extent(positions: np.ndarray) -> float:
    """The largest median distance of a body from the first that is seen, of positions (T, B, 3) with NaN."""
    middle = np.full(positions.shape[1:], np.nan)
    for body in range(positions.shape[1]):
        good = np.isfinite(positions[:, body]).all(axis=1)
        if good.any():
            middle[body] = np.median(positions[good, body], axis=0)
    middle = middle[np.isfinite(middle[:, 0])]
    return float(np.linalg.norm(middle - middle[:1], axis=1).max(initial=0.0))


def likely_unit(positions: list[np.ndarray]) -> str | None:
    """"m" or "mm" by the bodies' distances in logs' positions (T, B, 3); None where they could be neither.

    An arm of 20 mm to 20 m is 20 to 20000 in millimetres: where both would do, it is metres only below 20.
    """
    sizes = [extent(some) for some in positions]
    size = float(np.median([size for size in sizes if size > 0] or [0.0]))
    if SMALLEST_ARM <= size <= LARGEST_ARM:
        return "m"
    return "mm" if LARGEST_ARM < size <= 1e3 * LARGEST_ARM else None
