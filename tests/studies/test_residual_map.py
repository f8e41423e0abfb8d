"""The study of recorded poses: what its table says of certificates that are right, and of none."""

import numpy as np

from studies.residual_map import row
from trunkline.report.certificate.budget import Budget

MM = 1e-3


def stated(tips: np.ndarray, radius: float) -> Budget:
    return Budget(tips, [], np.zeros(len(tips)), np.full(len(tips), radius))


def test_a_row_has_all_poses_those_within_and_those_in_the_radius():
    """Four tips, 1, 3, 2 and 9 mm off, the last two beyond the session's pulls; then the same by two certificates."""
    tips = MM * np.diag([1.0, 3.0, 2.0, 9.0])[:, :3] + MM * np.array([[0.0] * 3] * 3 + [[9.0, 0, 0]])
    within, nowhere = np.array([True, True, False, False]), np.zeros((4, 3))
    first = row("nothing", tips, [stated(nowhere, 2.5 * MM)], within)
    assert first == "| nothing | 2.5 / 8.1 | 2.0 / 2.9 | 50 % | 2.5 |"
    both = row("sets", tips, [stated(nowhere, 2.5 * MM), stated(tips, 0.5 * MM)], within)
    assert both.startswith("| sets | 0.5 / ")
    assert both.endswith("| 75 % | 1.5 |")
