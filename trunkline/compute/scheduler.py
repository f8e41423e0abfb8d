"""Where work is done: on this machine, or on the workers of a Dask scheduler. An environment matter, never a tracked
parameter: on processors of the same kind, results are the same bits.

`TRUNKLINE_SCHEDULER` names the scheduler's address; nothing, the default, is this machine. Work comes in pieces of
which none depends on another. docs/speed.md says how to start scheduler and workers.

`TRUNKLINE_BATCHES` names what moves large batches of simulations that may be rough: `mujoco`, the default, or `warp`,
MuJoCo Warp on a GPU, whose results are not the same bits.
"""

import functools
import os
from collections.abc import Callable, Iterator
from itertools import pairwise
from typing import Any

import numpy as np

from trunkline.compute.cluster import VARIABLE, Cluster, at_a_piece
from trunkline.errors import InputError, nearest

BATCHES, MUJOCO, WARP = "TRUNKLINE_BATCHES", "mujoco", "warp"
PIECES = 4  # handed out to each worker's thread, so that one with the slow pieces does not end last


def elsewhere() -> bool:
    """Whether work is done by workers of a scheduler."""
    return bool(_address())


def rough_by_warp() -> bool:
    """Whether MuJoCo Warp moves large batches that may be rough. Never those of a piece of work that a scheduler
    sent: how large they are depends on how it was cut.

    Raises:
        InputError: there is no such name, or workers are to share the work.
    """
    library = os.environ.get(BATCHES, "").strip() or MUJOCO
    if library not in (MUJOCO, WARP):
        names = [MUJOCO, WARP]
        raise InputError(f"{BATCHES}: found {library!r}, expected one of {', '.join(names)}{nearest(library, names)}")
    if library == WARP and elsewhere():
        raise InputError(f"{BATCHES}: found {WARP} beside {VARIABLE}, expected one of them: a GPU is of this machine")
    return library == WARP and not at_a_piece()


def pieces(most: int) -> int:
    """Into how many pieces to cut work that can be cut into at most `most`: 1 on this machine, where a piece has all
    threads.

    Raises:
        InputError: as `arriving`.
    """
    cluster = _cluster()
    threads = 1 if cluster is None else cluster.threads()
    return max(1, min(PIECES * threads, most)) if threads > 1 else 1


def cuts(count: int, parts: int) -> list[slice]:
    """`count` rows, cut into so many parts of about the same size."""
    return [slice(*edges) for edges in pairwise(count * i // parts for i in range(parts + 1))]


def spread_rows(
    work: Callable, rows: tuple[np.ndarray, ...], shared: Any = None, least: int = 1
) -> tuple[np.ndarray, ...]:
    """`work(shared, rows)`, each row of whose results is of one of `rows` alone: some of them at a time where there are
    workers.

    Args:
        rows: arrays of the same length N; so are the results, or each of a multiple of N.
        least: rows that are worth being sent to a worker.

    Raises:
        InputError: as `arriving`.
    """
    count = len(rows[0])
    parts = [tuple(values[cut] for values in rows) for cut in cuts(count, pieces(count // least))]
    results = spread(work, parts, shared)
    return results[0] if len(results) == 1 else tuple(np.concatenate(values) for values in zip(*results, strict=True))


def spread(work: Callable, parts: list, shared: Any = None) -> list:
    """`work(shared, part)` of every part, in their order.

    Args:
        shared: what all of them need, not to be changed; sent to a worker once, not with each piece.

    Raises:
        InputError: as `arriving`.
    """
    results = [None] * len(parts)
    for index, result in arriving(work, parts, shared):
        results[index] = result
    return results


def arriving(work: Callable, parts: list, shared: Any = None) -> Iterator[tuple[int, Any]]:
    """As `spread`, each part's number and its result as it comes. A part whose worker was killed is done again.

    Raises:
        InputError: if there is no such scheduler, it goes away, it has no workers, workers die of a part, or one of
            them has other libraries or other code. Nothing that has come is lost.
    """
    cluster = _cluster()
    if cluster is None:
        yield from ((index, work(shared, part)) for index, part in enumerate(parts))
    else:
        yield from cluster.arriving(work, parts, shared)


def _address() -> str:
    return "" if at_a_piece() else os.environ.get(VARIABLE, "").strip()


def _cluster() -> Cluster | None:
    address = _address()
    if not address:
        return None
    if not _connected(address).answers():  # it went away, and may be there again
        _connected.cache_clear()
    return _connected(address)


@functools.cache
def _connected(address: str) -> Cluster:
    return Cluster(address)
