"""The pipeline for many arms or sessions, and one table and picture over all of them: `trunkline batch`."""

from trunkline.compute.numerics import hold_arithmetic

hold_arithmetic()  # also so that the stages and this share what Numba has compiled
