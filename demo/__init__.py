"""The stand-in lab."""

from trunkline.processor import hold_arithmetic

hold_arithmetic()
