"""The stand-in lab."""

from trunkline.compute.numerics import hold_arithmetic
from trunkline.startup_notice import say_loading

hold_arithmetic()
say_loading("demo")
