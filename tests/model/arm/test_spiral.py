"""The spiral: the dimensions asked for come out, by the paper's numbers and by the curve's own definition."""

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st
from scipy.integrate import quad

from trunkline.errors import InputError
from trunkline.model.arm.geometry import ChainGeometry
from trunkline.model.arm.spiral import growth_rate, spiral_chain

LENGTH, BASE, TIP, UNITS = 0.507, 0.080, 0.012, 24


def test_the_default_arm_has_the_known_numbers():
    chain = spiral_chain(LENGTH, BASE, TIP, UNITS)
    assert growth_rate(LENGTH, BASE, TIP) == pytest.approx(0.152, abs=5e-4)
    assert np.degrees(chain.joint_range) == pytest.approx(29.7, abs=0.05)
    assert chain.ratio == pytest.approx(0.924, abs=5e-4)


@given(
    base=st.floats(0.03, 0.2),
    taper=st.floats(0.1, 0.8),
    slenderness=st.floats(4, 12),
    units=st.integers(3, 40),
)
def test_units_add_up_and_shrink_by_one_ratio(base, taper, slenderness, units):
    length, tip = slenderness * base, taper * base
    chain = spiral_chain(length, base, tip, units)
    assert (chain.units, chain.widths[0]) == (units, base)
    assert chain.length == pytest.approx(length)
    np.testing.assert_allclose(chain.lengths[1:] / chain.lengths[:-1], chain.ratio)
    np.testing.assert_allclose(chain.widths[1:] / chain.widths[:-1], chain.ratio)
    assert chain.widths[-1] * chain.ratio == pytest.approx(
        tip
    )  # the tip's width is the last unit's distal one


def test_the_length_is_that_of_the_spiral_s_centre_line():
    """Arc length of the line half-way between ρ = a e^{bθ} and its next turn, from tip width to base width."""
    b = growth_rate(LENGTH, BASE, TIP)

    def width(theta, a):  # between a turn and the next
        return a * np.exp(b * theta) * (np.exp(2 * np.pi * b) - 1)

    a = TIP / (np.exp(2 * np.pi * b) - 1)
    last = np.log(BASE / TIP) / b
    assert width(last, a) == pytest.approx(BASE)
    middle = a * (np.exp(2 * np.pi * b) + 1) / 2  # of ρ(θ) and ρ(θ + 2π)
    arc, _ = quad(lambda theta: middle * np.sqrt(1 + b**2) * np.exp(b * theta), 0, last)
    assert arc == pytest.approx(LENGTH, rel=1e-6)


def test_fully_bent_the_units_cover_the_spiral_s_angle():
    chain = spiral_chain(LENGTH, BASE, TIP, UNITS)
    assert chain.joint_range.sum() == pytest.approx(np.log(BASE / TIP) / growth_rate(LENGTH, BASE, TIP))


@pytest.mark.parametrize(
    ("length", "base", "tip", "message"),
    [
        (0.507, 0.08, 0.08, "arm.tip_width: found 0.08 m, expected less than arm.base_width"),
        (0.507, 0.08, 0.09, "arm.tip_width: found 0.09 m"),
        (0.001, 0.08, 0.012, "arm.length: found 0.001 m, expected between"),
        (1e6, 0.08, 0.012, "arm.length: found 1000000.0 m, expected between"),
    ],
)
def test_dimensions_of_no_spiral_are_refused(length, base, tip, message):
    with pytest.raises(InputError, match=message):
        spiral_chain(length, base, tip, UNITS)


def test_a_chain_of_equal_units_needs_no_spiral():
    chain = ChainGeometry(np.full(5, 0.02), np.full(5, 0.03), np.full(5, 0.4), 1.0)
    assert (chain.units, chain.length) == (5, pytest.approx(0.1))
