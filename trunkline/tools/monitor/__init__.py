"""Whether an arm has changed since its model was identified: `trunkline monitor`."""

from trunkline.compute.numerics import hold_arithmetic

hold_arithmetic()  # also so that the stages and this share what Numba has compiled
