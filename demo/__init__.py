"""The stand-in lab."""

from trunkline.arithmetic import hold_arithmetic
from trunkline.loading import say_loading

hold_arithmetic()
say_loading("demo")
