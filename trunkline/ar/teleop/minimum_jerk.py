"""The motion of least jerk from rest to rest."""

from typing import Any, overload

import numpy as np

PEAK = 15 / 8  # its largest velocity over its mean one


@overload
def minimum_jerk(share: float, way: float = 1.0) -> float: ...
@overload
def minimum_jerk(share: np.ndarray, way: float | np.ndarray = 1.0) -> np.ndarray: ...


def minimum_jerk(share: Any, way: Any = 1.0) -> Any:
    """How much of its `way` Δ a motion has behind it after the `share` τ of its time, from 0 to 1:

        Δ (10 τ³ - 15 τ⁴ + 6 τ⁵).

    Source: T. Flash, N. Hogan, J. Neurosci. 5 (1985) 1688-1703.
    """
    return way * share**3 * (10 - 15 * share + 6 * share**2)
