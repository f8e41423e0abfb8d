"""The paper's experiments rehearsed, on a stand-in for the physical robot that is not the twin."""

from trunkline.compute.numerics import hold_arithmetic

hold_arithmetic()
