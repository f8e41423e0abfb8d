"""CAD values: against integrals over the solid, closed forms, and the paper's scaling along the spiral."""

import numpy as np
import pytest

from trunkline.model.arm.material import TPU_95A_DENSITY, TPU_95A_MODULUS, unit_properties, wedge_fill
from trunkline.model.arm.spiral import spiral_chain

CHAIN = spiral_chain(0.507, 0.080, 0.012, 24)
CORE, ZETA = 0.24, 0.1
SCALING = CHAIN.ratio ** np.arange(CHAIN.units)
UNITS = unit_properties(CHAIN, TPU_95A_MODULUS, TPU_95A_DENSITY, CORE, ZETA)


def test_the_fill_is_the_mean_height_left_by_the_wedges():
    radius, length, angle = CHAIN.widths[0] / 2, CHAIN.lengths[0], CHAIN.joint_range[0]
    r = (np.arange(20000) + 0.5) / 20000 * radius
    material = np.average(1 - r * angle / length, weights=r)  # a ring's area grows with r
    assert wedge_fill(CHAIN)[0] == pytest.approx(material, rel=1e-6)
    assert ((wedge_fill(CHAIN) > 0) & (wedge_fill(CHAIN) < 1)).all()


def test_masses_are_those_of_the_notched_cylinders():
    cylinders = np.pi / 4 * CHAIN.widths**2 * CHAIN.lengths * TPU_95A_DENSITY
    np.testing.assert_allclose(UNITS.masses, cylinders * wedge_fill(CHAIN)[0])  # similar units: one fill
    total = cylinders[0] * wedge_fill(CHAIN)[0] * (1 - CHAIN.ratio**72) / (1 - CHAIN.ratio**3)
    assert UNITS.masses.sum() == pytest.approx(total)


def test_inertia_is_that_of_a_cylinder_about_its_centre():
    radius, length, mass = CHAIN.widths / 2, CHAIN.lengths, UNITS.masses
    np.testing.assert_allclose(UNITS.axial_inertia, mass * radius**2 / 2)
    np.testing.assert_allclose(UNITS.transverse_inertia, mass * (3 * radius**2 + length**2) / 12)


def test_stiffness_is_ei_over_l_and_falls_with_the_cube_of_the_ratio():
    core_radius = CORE * CHAIN.widths[0] / 2
    assert UNITS.stiffness[0] == pytest.approx(
        TPU_95A_MODULUS * np.pi / 4 * core_radius**4 / CHAIN.lengths[0]
    )
    np.testing.assert_allclose(UNITS.stiffness, UNITS.stiffness[0] * SCALING**3)


def test_damping_falls_with_the_cube_of_the_ratio_and_grows_with_zeta():
    np.testing.assert_allclose(UNITS.damping, UNITS.damping[0] * SCALING**3)
    twice = unit_properties(CHAIN, TPU_95A_MODULUS, TPU_95A_DENSITY, CORE, 2 * ZETA)
    np.testing.assert_allclose(twice.damping, 2 * UNITS.damping)
    assert UNITS.damping[0] == pytest.approx(
        2 * ZETA * np.sqrt(UNITS.stiffness[0] * UNITS.masses[0]) * CHAIN.lengths[0]
    )
