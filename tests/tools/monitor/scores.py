"""Made-up scores: what trials of kinds with offsets of their own say of two parameters."""

import numpy as np

from trunkline.tools.monitor.scores import Score

OFFSETS = {"static_tilt": (0.03, -0.01), "release": (-0.02, 0.2), "curl": (0.1, 0.1), "motion": (0.0, 0.0)}
SPREADS = {"static_tilt": (0.002, 0.004), "release": (0.004, 0.01), "curl": (0.03, 0.05), "motion": (0.01, 0.01)}
SLANT = 0.5  # by which a change of the first parameter shows as one of the second, at information that is alike


def drawn(kind: str, rng: np.random.Generator, change=(0.0, 0.0), level: float | None = None, name="trial") -> Score:
    """A trial of an arm that has changed by `change`; its estimates scatter as s / √I, I of its own."""
    information = rng.uniform(0.05, 0.2, 2)
    across = SLANT * np.sqrt(information.prod())
    curvature = np.array([[information[0], across], [across, information[1]]])
    chance = np.array(SPREADS[kind]) * rng.normal(size=2) / np.sqrt(information)
    estimates = np.array(OFFSETS[kind]) + chance + curvature @ np.array(change) / information
    return Score(name, kind, level, 0.0, -information * estimates, curvature)
