"""The stages of dvc.yaml, a file each: read, one call, write."""

import sys

from trunkline.processor import hold_arithmetic

hold_arithmetic()

# MuJoCo, torch and the rest take seconds to load. Python runs this before the stage's own file; `sys.argv[0]` is "-m"
# while it looks for the module that the command names.
if sys.argv[0] == "-m" and sys.orig_argv[-1].startswith("stages."):
    print(f"{sys.orig_argv[-1].removeprefix('stages.')}: loading", flush=True)
