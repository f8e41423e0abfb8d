"""The unit of positions: how far apart the bodies are tells which it may be."""

import numpy as np

METRES_PER = {"m": 1.0, "mm": 1e-3, "cm": 1e-2, "inch": 0.0254}  # by the units that session.yaml may name
LARGEST_ARM = 20.0  # m; bodies farther apart than this are no arm in metres, nor one in mm below 20 mm
SMALLEST_ARM = 0.02  # m
USUAL = (0.1, 3.0)  # m, of most arms


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
    """The unit by the bodies' distances in logs' positions (T, B, 3), as of an arm that is `USUAL`; else by one that
    could be at all; None where there is none."""
    size = _usual_extent(positions)
    if SMALLEST_ARM <= size <= LARGEST_ARM:
        return "m"
    for low, high in (USUAL, (SMALLEST_ARM, LARGEST_ARM)):
        for unit in ("mm", "cm"):
            if low <= METRES_PER[unit] * size <= high and size > LARGEST_ARM:
                return unit
    return None


def other_units(positions: list[np.ndarray], unit: str) -> str:
    """How long the arm is in every unit that could be, as words; empty where metres are taken, and likely."""
    size = _usual_extent(positions)
    if unit == "m" and SMALLEST_ARM <= size <= LARGEST_ARM:
        return ""
    lengths = {other: metres * size for other, metres in METRES_PER.items()}
    likely = {other: length for other, length in lengths.items() if SMALLEST_ARM <= length <= LARGEST_ARM}
    return ", ".join(f"{other} for an arm of {1e3 * length:.3g} mm" for other, length in likely.items())


def _usual_extent(positions: list[np.ndarray]) -> float:
    sizes = [extent(some) for some in positions]
    return float(np.median([size for size in sizes if size > 0] or [0.0]))
