"""How the kernels of this room are compiled and kept on disk."""

import hashlib
import inspect
import os
from collections.abc import Callable
from pathlib import Path

import numba
from numba.core import config

import demo.plants.stranger_kernel
import trunkline.model.statics.vectors

# numba renews a cached kernel when its own file changes, not when a kernel it calls does in another file;
# so the folder is named after the text of all of them.
_HERE = Path(__file__).parent
_OWN = [_HERE / f"{name}.py" for name in ("contact", "flange", "kernel", "rigid_object", "shapes", "touching")]
_CALLED = [Path(inspect.getfile(module)) for module in (demo.plants.stranger_kernel, trunkline.model.statics.vectors)]
_STAMP = hashlib.sha256(b"".join(file.read_bytes() for file in (*_OWN, *_CALLED))).hexdigest()[:12]


def kernel(function: Callable) -> Callable:
    """Compile `function` at its first call, without Python's lock, and keep it on disk for the next process.

    Divisions by zero give infinities, as in numpy. numba reads its cache folder at this moment, so the setting is
    put back at once; one given by NUMBA_CACHE_DIR is left as it is.
    """
    settings = config.__dict__
    before = settings["CACHE_DIR"]
    if not before and os.access(_HERE, os.W_OK):
        settings["CACHE_DIR"] = str(_HERE / "__pycache__" / f"kernels-{_STAMP}")
    try:
        return numba.njit(cache=True, nogil=True, error_model="numpy")(function)
    finally:
        settings["CACHE_DIR"] = before
