"""The stages of dvc.yaml, a file each: read, one call, write."""

from trunkline.arithmetic import hold_arithmetic
from trunkline.loading import say_loading

hold_arithmetic()
say_loading("stages")
