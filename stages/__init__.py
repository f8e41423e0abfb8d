"""The stages of dvc.yaml, a file each: read, one call, write."""

import os

from trunkline.compute.numerics import hold_arithmetic
from trunkline.startup_notice import say_loading

hold_arithmetic()
os.environ.setdefault("OMP_WAIT_POLICY", "PASSIVE")  # PyTorch's threads sleep while they wait, on a busy machine too
say_loading("stages")
