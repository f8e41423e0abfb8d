"""Batches in which a simulation that diverges is counted, not printed: where many candidates are tried, some do.

MuJoCo would say so on the terminal and in MUJOCO_LOG.TXT, in the middle of a run that is in order. The counts are in
`Batch.warning`, and who moves a batch asks for them. Whatever else MuJoCo says is heard.
"""

import sys
import threading
from collections.abc import Callable, Iterator
from contextlib import contextmanager
from typing import Any

import mujoco
import numpy as np
from mujoco.batch import Batch

DIVERGED = "Nan, Inf or huge value in "  # so begins what MuJoCo says of a state that is no number, or a huge one

_lock = threading.Lock()
_running = 0  # batches that are being moved, on as many threads
_before: Callable[[str], Any] | None = None  # who listens outside of them


class CountingBatch(Batch):
    """As `Batch`, but for what it prints."""

    def step(self, *args: Any, **kwargs: Any) -> None:
        with divergence_counted():
            super().step(*args, **kwargs)

    def forward(self, *args: Any, **kwargs: Any) -> None:
        with divergence_counted():
            super().forward(*args, **kwargs)

    def rollout(self, *args: Any, **kwargs: Any) -> dict[Any, np.ndarray]:
        with divergence_counted():
            return super().rollout(*args, **kwargs)


@contextmanager
def divergence_counted() -> Iterator[None]:
    """Meanwhile MuJoCo prints nothing about a simulation that diverges, in the whole process."""
    global _running, _before
    with _lock:
        if not _running:
            _before = mujoco.get_mju_user_warning()
            mujoco.set_mju_user_warning(_hear)
        _running += 1
    try:
        yield
    finally:
        with _lock:
            _running -= 1
            if not _running:
                mujoco.set_mju_user_warning(_before)


def _hear(message: str) -> None:
    if message.startswith(DIVERGED):
        return
    if _before is not None:
        _before(message)
    else:
        print(f"WARNING: {message}", file=sys.stderr)
