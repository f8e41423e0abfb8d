"""The stages of dvc.yaml, a file each: read, one call, write."""

from trunkline.compute.numerics import hold_arithmetic
from trunkline.startup_notice import say_loading

hold_arithmetic()
say_loading("stages")
