"""The stand-in lab."""

from trunkline.loading import say_loading
from trunkline.arithmetic import hold_arithmetic

hold_arithmetic()
say_loading("demo")
