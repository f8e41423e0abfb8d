"""A session over the network: page and robot on either side of a server that decides everything."""

from trunkline.compute.numerics import hold_arithmetic

hold_arithmetic()  # also so that the stages and this share what Numba has compiled
