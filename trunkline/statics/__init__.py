"""Statics of a compiled model: its chain, and the equilibria that it rests in."""

import hashlib
import os
from pathlib import Path

import numba

# numba renews a cached kernel when its own file changes, not when a kernel it calls does in another file;
# so the cache is named after the text of all of them.
_HERE = Path(__file__).parent
_STAMP = hashlib.sha256(b"".join(file.read_bytes() for file in sorted(_HERE.glob("*.py")))).hexdigest()[:12]
if not os.environ.get("NUMBA_CACHE_DIR") and os.access(_HERE, os.W_OK):
    numba.config.CACHE_DIR = str(_HERE / "__pycache__" / f"kernels-{_STAMP}")
