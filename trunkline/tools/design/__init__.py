"""What to record next, by its expected information: `trunkline suggest`."""

from trunkline.compute.numerics import hold_arithmetic

hold_arithmetic()  # also so that the stages and this share what Numba has compiled
