"""What a session can identify, before hours of fits: `trunkline check`."""

from trunkline.compute.numerics import hold_arithmetic

hold_arithmetic()  # also so that the stages and this share what Numba has compiled
