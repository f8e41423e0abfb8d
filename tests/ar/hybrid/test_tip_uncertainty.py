"""By how far a tip may be elsewhere: each source by itself, of which the radius is known."""

from dataclasses import replace

import numpy as np
import pytest
from scipy.spatial.transform import Rotation

from trunkline.ar.hybrid.tip_uncertainty import BaseAlignment, Hanging, TipUncertainty
from trunkline.twin.discrepancy import Discrepancy

DRAWS = 20_000
NONE, ALIGNED = Discrepancy(np.zeros((1, 3)), 16), BaseAlignment(0.0, 0.0)
MOUNT, TIP = np.array([0.5, 0.1, 0.4]), np.array([0.6, 0.1, 0.0])


def offsets(discrepancy=NONE, ways=(0.0, 0.0), friction=(0.0, 0.0, 0.0), alignment=ALIGNED, hanging=None):
    made = TipUncertainty(discrepancy, np.array(ways), np.array(friction), alignment, np.eye(3), hanging)
    return made.offsets(MOUNT, TIP, DRAWS, np.random.default_rng(0))


def rms(drawn: np.ndarray) -> float:
    return float(np.sqrt((drawn**2).sum(axis=1).mean()))


def test_where_all_is_known_the_tip_is_where_the_twin_has_it():
    np.testing.assert_array_equal(offsets(), 0.0)


def test_friction_holds_it_anywhere_between_both_ends_of_its_band():
    drawn = offsets(friction=(0.006, 0.0, -0.002))
    np.testing.assert_allclose(drawn[:, 0], -3 * drawn[:, 2], atol=1e-12)
    quartiles = np.quantile(drawn[:, 0], [0.0, 0.25, 0.75, 1.0])
    np.testing.assert_allclose(quartiles, [-0.006, -0.003, 0.003, 0.006], atol=1e-4)


def test_what_the_model_lacks_is_across_the_arm():
    drawn = offsets(Discrepancy(np.array([[0.003, 0.0, 0.1]]), 16), ways=(0.0, 0.04))
    assert rms(drawn) == pytest.approx(0.005, rel=0.02)
    np.testing.assert_allclose(drawn @ (TIP - MOUNT), 0.0, atol=1e-12)


@pytest.mark.parametrize("unknown", [0.0, 0.3, 1.0])
def test_of_what_poses_tell_only_what_they_leave_is_lacking(unknown):
    """Of the variance a share is the twin's, friction's with it, and the rest what is left where poses tell all."""
    twin, left = (Discrepancy(np.array([[scale, 0.0, 0.0]]), 16) for scale in (0.005, 0.012))
    made = TipUncertainty(twin, np.zeros(2), np.zeros(3), ALIGNED, np.eye(3), unknown=unknown, left=left)
    expected = np.sqrt(unknown * 0.005**2 + (1 - unknown) * 0.012**2)
    assert rms(made.offsets(MOUNT, TIP, DRAWS, np.random.default_rng(0))) == pytest.approx(expected, rel=0.02)
    rubs = replace(made, discrepancy=NONE, left=NONE, friction=np.array([0.006, 0.0, 0.0]))
    drawn = rubs.offsets(MOUNT, TIP, DRAWS, np.random.default_rng(0))
    assert np.abs(drawn[:, 0]).max() == pytest.approx(0.006 * np.sqrt(unknown), rel=0.01)


@pytest.mark.parametrize(("shift", "turn_deg", "expected"), [
    (0.003, 0.0, 0.003), (0.0, 0.5, np.radians(0.5) * np.linalg.norm(TIP) * np.sqrt(2 / 3)),
])  # fmt: skip
def test_a_frame_beside_the_robots_base_moves_what_is_seen(shift, turn_deg, expected):
    assert rms(offsets(alignment=BaseAlignment(shift, turn_deg))) == pytest.approx(expected, rel=0.02)


@pytest.mark.parametrize("turn_deg", [0.0, 0.5])
def test_a_straight_arm_is_where_it_was_seen_in_a_frame_beside_the_base_but_for_its_length(turn_deg):
    """It hangs straight below where it was seen, so that only what is along it is left."""
    hanging = Hanging(TIP - MOUNT, MOUNT, np.eye(3))
    drawn = offsets(alignment=BaseAlignment(0.003, turn_deg), hanging=hanging)
    along = (TIP - MOUNT) / np.linalg.norm(TIP - MOUNT)
    np.testing.assert_allclose(drawn, (drawn @ along)[:, None] * along, atol=1e-12)
    turned = np.radians(turn_deg) * np.linalg.norm(np.cross(TIP, along))
    assert rms(drawn) == pytest.approx(np.hypot(0.003, turned) / np.sqrt(3), rel=0.02)


def test_where_the_arm_is_turned_half_round_since_the_shift_counts_twice():
    half = Rotation.from_rotvec([0.0, 0.0, np.pi]).as_matrix()
    tip = np.array([0.0, 0.0, -0.4])
    alignment, hanging = BaseAlignment(0.003, 0.0), Hanging(tip, MOUNT, np.eye(3))
    made = TipUncertainty(NONE, np.zeros(2), np.zeros(3), alignment, half, hanging)
    drawn = made.offsets(MOUNT, MOUNT + tip, DRAWS, np.random.default_rng(0))
    assert rms(drawn[:, :2]) == pytest.approx(2 * 0.003 * np.sqrt(2 / 3), rel=0.02)


def test_draws_are_the_same_for_the_same_generator():
    alignment, hanging = BaseAlignment(0.003, 0.5), Hanging(TIP - MOUNT, MOUNT, np.eye(3))
    arguments = {"friction": (0.006, 0.0, 0.0), "alignment": alignment, "hanging": hanging}
    np.testing.assert_array_equal(offsets(**arguments), offsets(**arguments))
