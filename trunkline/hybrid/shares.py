"""Shares of trials, and how sure they are."""

import numpy as np
from scipy.stats import norm


def wilson(found: int, count: int) -> tuple[float, float]:
    """95 % interval of a share (E. B. Wilson, "Probable inference, the law of succession, and statistical inference",
    Journal of the American Statistical Association, 1927)."""
    z, share = norm.ppf(0.975), found / count
    middle, half = share + z**2 / (2 * count), z * np.sqrt(share * (1 - share) / count + z**2 / (4 * count**2))
    return float((middle - half) / (1 + z**2 / count)), float((middle + half) / (1 + z**2 / count))
