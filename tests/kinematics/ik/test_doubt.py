"""From which foreseen miss on an answer is doubted: before it misses by 1 %, and of what can be reached seldom."""

from types import SimpleNamespace

import numpy as np
import pytest
import torch

from trunkline.kinematics.ik.as_controls import SHARE
from trunkline.kinematics.ik.learn import FALSE_ALARMS, doubt_beyond

LENGTH, COUNT = 0.5, 2000


def foreseen(misses: np.ndarray) -> float:
    """From where on a network doubts that foresees tips so far from targets that can be reached, m (N,)."""
    targets = np.tile([0.0, 0.1, 0.0, -0.4, 1, 0, 0, 0], (len(misses), 1))
    tips = torch.tensor(targets[:, 1:4] + misses[:, None] * np.array([0.6, 0.0, 0.8]))
    return doubt_beyond(lambda _: SimpleNamespace(tip=tips), targets, LENGTH)  # type: ignore[arg-type]


@pytest.mark.parametrize("miss", [0.0, 1e-4, 1e-3])
def test_a_network_that_foresees_well_doubts_before_a_miss_of_one_percent(miss):
    """And not so early that what is foreseen would have to be exact."""
    assert 0.5 * SHARE * LENGTH < foreseen(np.full(COUNT, miss)) < SHARE * LENGTH


@pytest.mark.parametrize("worst", [0.006, 0.02, 0.1])
def test_a_network_that_foresees_badly_doubts_few_of_what_can_be_reached(worst):
    misses = np.random.default_rng(0).uniform(0, worst, COUNT)
    beyond = foreseen(misses)
    assert (misses > beyond).mean() <= FALSE_ALARMS + 1 / COUNT
    if beyond > SHARE * LENGTH:  # no later than it has to
        assert (misses > beyond).mean() > 0.9 * FALSE_ALARMS
