"""The study of certificates: its table counts what lies inside."""

import numpy as np

from studies.certificate import told_lines
from trunkline.report.certificate.budget import Budget


def test_the_table_counts_the_tips_inside():
    tips = np.array([[0.0, 0, 0], [0, 0, 0.02], [0, 0.005, 0], [0, 0, 0.001]])
    found = Budget(np.zeros((4, 3)), [], np.zeros(4), np.full(4, 0.01))
    loose, back = np.array([False, False, False, True]), np.array([False, True, False, False])
    lines = told_lines(tips, found, loose, back)
    assert lines[2].startswith("| all | 75.0 % | 4 | 10.0 mm |")
    assert lines[3].startswith("| pulled, from straight | 100.0 % | 2 |")
    assert lines[4].startswith("| pulled, from beyond | 0.0 % | 1 |")
    assert lines[4].endswith("| 2.0 |")
