"""The invented arm's session: an arm on a mount that is turned sideways, its tendons in pairs on three motors."""

from itertools import pairwise

import numpy as np
import pytest
from scipy.spatial.transform import Rotation

from examples.pairs import session as made
from trunkline.recordings.cleaning.checks import TrialLimits
from trunkline.recordings.cleaning.loading import load_raw_trials
from trunkline.recordings.session.session import read_session

LIMITS = TrialLimits(0.5, 0.3, 0.1, 1.0)


@pytest.fixture(scope="module")
def raw_trials(tmp_path_factory):
    folder = tmp_path_factory.mktemp("pairs") / "session"
    with pytest.MonkeyPatch.context() as patched:
        patched.setattr(made, "SECONDS", 3.0)
        patched.setattr(made, "FADE", 0.5)
        assert made.make_session(folder) == len(made.SPLITS)
    return [raw for _, raw, _ in load_raw_trials(folder, read_session(folder), LIMITS)]


def test_a_motor_pays_out_what_it_winds_in(raw_trials):
    for raw in raw_trials:
        assert raw.tendons == tuple(f"tendon_{number}" for number in range(1, 7))
        np.testing.assert_allclose(raw.commands[:, ::2], -raw.commands[:, 1::2], atol=1e-12)
        assert np.abs(raw.commands).max() == pytest.approx(made.LARGEST, rel=1e-3)


def test_the_arm_sticks_out_sideways_and_sags(raw_trials):
    for raw in raw_trials:
        base = Rotation.from_quat(np.nanmedian(raw.base_quaternions, axis=0), scalar_first=True)
        along = base.apply([0, 0, -1])
        assert np.degrees(np.arccos(-along @ raw.up)) == pytest.approx(85, abs=1)
        first = np.nanmedian(raw.positions[:100], axis=0) - np.nanmedian(raw.base_positions, axis=0)
        straight = np.outer([0.120, 0.240], along)
        assert np.all((first - straight) @ raw.up < -1e-3)


def test_trials_differ_and_belong_to_every_split(raw_trials):
    assert [raw.split for raw in raw_trials] == list(made.SPLITS)
    assert all(np.abs(a.commands - b.commands).max() > 1e-3 for a, b in pairwise(raw_trials))
