"""How many threads a stage may use. An environment matter, never a tracked parameter."""

import os

from trunkline.errors import InputError


def thread_count() -> int:
    """Threads to use: `TRUNKLINE_THREADS` if set, else every core this process may run on.

    Raises:
        InputError: if `TRUNKLINE_THREADS` is not a whole number of at least 1.
    """
    setting = os.environ.get("TRUNKLINE_THREADS", "").strip()
    if not setting:
        return len(os.sched_getaffinity(0)) if hasattr(os, "sched_getaffinity") else os.cpu_count() or 1
    if not setting.isascii() or not setting.isdigit() or int(setting) < 1:
        raise InputError(f"TRUNKLINE_THREADS: found {setting!r}, expected a whole number of at least 1")
    return int(setting)
