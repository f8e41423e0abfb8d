"""How the kernels of this package are compiled, kept on disk and spread over threads."""

import hashlib
import os
from collections.abc import Callable
from concurrent.futures import ThreadPoolExecutor
from pathlib import Path

import numba
from numba.core import config

from trunkline.compute.threads import thread_count

PIECES = 8  # handed out to each thread, so that one with the slow rows does not end last

# numba renews a cached kernel when its own file changes, not when a kernel it calls does in another file;
# so the folder is named after the text of all of them.
_HERE = Path(__file__).parent
_STAMP = hashlib.sha256(b"".join(file.read_bytes() for file in sorted(_HERE.glob("*.py")))).hexdigest()[:12]


def kernel(function: Callable) -> Callable:
    """Compile `function` at its first call, without Python's lock, and keep it on disk for the next process.

    Divisions by zero give infinities, as in numpy. numba reads its cache folder at this moment, so the setting is
    put back at once; one given by NUMBA_CACHE_DIR is left as it is.
    """
    settings = config.__dict__  # made from the environment, so that no name in it is declared
    before = settings["CACHE_DIR"]
    if not before and os.access(_HERE, os.W_OK):
        settings["CACHE_DIR"] = str(_HERE / "__pycache__" / f"kernels-{_STAMP}")
    try:
        return numba.njit(cache=True, nogil=True, error_model="numpy")(function)
    finally:
        settings["CACHE_DIR"] = before


def over_rows(rows: Callable, count: int, *arguments) -> None:
    """Call `rows(first, last, *arguments)` until all of range(count) is done, on `thread_count` threads.

    What a row computes must depend on no other row; then it does not depend on the number of threads either.
    """
    threads = min(thread_count(), count)
    pieces = min(count, PIECES * threads)
    edges = [count * piece // pieces for piece in range(pieces + 1)] if pieces else []
    with ThreadPoolExecutor(max(1, threads)) as pool:
        edged = zip(edges[:-1], edges[1:], strict=True)
        running = [pool.submit(rows, first, last, *arguments) for first, last in edged]
        for piece in running:
            piece.result()
