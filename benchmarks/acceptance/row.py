"""A row of the table."""

from typing import NamedTuple

import numpy as np


class Row(NamedTuple):
    what: str
    found: str
    goal: str


def p95(values: np.ndarray) -> float:
    return float(np.quantile(values, 0.95))
