"""Distances rounded where nobody sees it, as the grids are most of a package and noise does not compress."""

import numpy as np

DIGITS, COARSEST = 6, 2.0**-9  # binary digits that are kept of a distance, and m, the step that is never exceeded
FINEST = 2.0**-24  # m, that of 16-bit floats around 0
ROUNDED = "by at most 1/64 of the distance, and 1/1024 m: to 6 binary digits, or to 1/512 m; no point changes sides"


def rounded(distances: np.ndarray) -> np.ndarray:
    """Signed distances, m, of any shape, as 16-bit floats with few different ones among them."""
    distances = np.asarray(distances, float)
    with np.errstate(divide="ignore"):
        step = 2.0 ** (np.floor(np.log2(np.abs(distances))) + 1 - DIGITS)
    step = np.clip(step, FINEST, COARSEST)
    return (np.round(distances / step) * step).astype(np.float16)
