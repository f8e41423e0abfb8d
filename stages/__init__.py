"""The stages of dvc.yaml, a file each: read, one call, write."""

from trunkline.loading import say_loading
from trunkline.arithmetic import hold_arithmetic

hold_arithmetic()
say_loading("stages")
