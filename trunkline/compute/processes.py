"""Processes that are made by others."""

import multiprocessing
import os
import signal
import threading


def parent_pid() -> int:
    """Of the process that made this one, even if it is gone already."""
    parent = multiprocessing.parent_process()
    assert parent is not None
    assert parent.pid is not None
    return parent.pid


def leave_signals_to_parent() -> None:
    """What a terminal sends to all of its processes, by Ctrl-C or as it is closed, is the parent's to hear."""
    for number in (signal.SIGINT, signal.SIGHUP):
        signal.signal(number, signal.SIG_IGN)


def end_with_parent() -> None:
    """From now on this process ends with the one that made it: one whose parent was killed would wait for ever."""
    threading.Thread(target=_wait, daemon=True).start()


def _wait() -> None:
    parent = multiprocessing.parent_process()
    assert parent is not None
    parent.join()
    os._exit(1)
