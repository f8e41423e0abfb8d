"""From which foreseen miss on an answer is doubted."""

from types import SimpleNamespace

import numpy as np
import pytest
import torch

from trunkline.ik.learn import doubt_beyond

LENGTH = 0.4  # m


@pytest.mark.parametrize(
    ("misses_mm", "beyond_mm"),
    [
        ([0.0] * 20, 3.0),  # three quarters of a per cent of the length
        ([0.0] * 19 + [9.0], 3.0),
        ([2.0] * 20, 3.0),
        ([5.0] * 20, 5.0),  # where it usually misses by more, that is no reason
        ([0.0] * 10 + [5.0] * 10, 5.0),
    ],
)
def test_a_foreseen_miss_is_doubted_from_three_quarters_of_a_per_cent_on_or_where_it_is_rare(misses_mm, beyond_mm):
    targets = np.tile([0.0, 0.0, 0.0, -0.4, 1.0, 0.0, 0.0, 0.0], (len(misses_mm), 1))
    tips = torch.tensor(targets[:, 1:4] + np.outer(misses_mm, [1e-3, 0.0, 0.0]), dtype=torch.float32)
    assert doubt_beyond(lambda _: SimpleNamespace(tip=tips), targets, LENGTH) == pytest.approx(1e-3 * beyond_mm)
