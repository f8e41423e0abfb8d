"""A model against a session, without a fit: `trunkline evaluate`."""

from trunkline.compute.numerics import hold_arithmetic

hold_arithmetic()  # also so that the stages and this share what Numba has compiled
