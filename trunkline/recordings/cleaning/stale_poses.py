"""Stale poses: those that a driver repeats while it sees nothing. They are dropped."""

import numpy as np

from trunkline.recordings.cleaning.checks import Findings
from trunkline.recordings.signals.repeats import stale_samples


def drop_stale_poses(
    positions: np.ndarray, quaternions: np.ndarray | None, names: list[str], findings: Findings
) -> None:
    """Make NaN of the poses that only repeat the one before."""
    still = stale_samples(positions)
    findings.dropped(still, "that only repeat the one before, to the last bit,", names)
    positions[still] = np.nan
    if quaternions is not None:
        quaternions[still] = np.nan
