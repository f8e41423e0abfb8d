"""Shares of trials, and how sure they are."""

from scipy.stats import binomtest

LEVEL = 0.95


def wilson(successes: int, count: int) -> tuple[float, float]:
    """Interval of a share at LEVEL (E. B. Wilson, "Probable inference, the law of succession, and statistical
    inference", Journal of the American Statistical Association, 1927)."""
    interval = binomtest(successes, count).proportion_ci(LEVEL, method="wilson")
    return float(interval.low), float(interval.high)
