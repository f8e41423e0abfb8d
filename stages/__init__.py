"""The stages of dvc.yaml, a file each: read, one call, write."""

import os

from trunkline.startup_notice import say_loading

os.environ.setdefault("OMP_WAIT_POLICY", "PASSIVE")  # PyTorch's threads sleep while they wait, on a busy machine too
say_loading("stages")
