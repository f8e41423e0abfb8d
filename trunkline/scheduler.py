"""Where work is done: on this machine, or on the workers of a Dask scheduler. An environment matter, never a tracked
parameter: results are the same bits.

`TRUNKLINE_SCHEDULER` names the scheduler's address; nothing, the default, is this machine. Work comes in pieces of
which none depends on another. docs/cluster.md says how to start scheduler and workers.
"""

import functools
import os
import pickle
import queue
import threading
from collections.abc import Callable, Iterator
from typing import Any

from trunkline.errors import InputError
from trunkline.likeness import Likeness, likeness, unlike

VARIABLE = "TRUNKLINE_SCHEDULER"
PIECES = 4  # handed out to each worker's thread, so that one with the slow pieces does not end last
CONNECTING = 10.0  # s until a scheduler that does not answer counts as none
NO_WORKERS = 60.0  # s without any worker until work ends: a killed one comes back sooner
LOOK = 1.0  # s between looks at whether the scheduler and its workers are still there


def places() -> int:
    """How many pieces are worked on at once: 1 on this machine, where a piece has all threads; else one for each
    thread of the workers.

    Raises:
        InputError: as `arriving`.
    """
    cluster = _cluster()
    return 1 if cluster is None else cluster.threads()


def spread(work: Callable, pieces: list, given: Any = None) -> list:
    """`work(given, piece)` of every piece, in their order.

    Args:
        given: what all pieces need; sent to a worker once, not with each piece.

    Raises:
        InputError: as `arriving`.
    """
    found = [None] * len(pieces)
    for index, result in arriving(work, pieces, given):
        found[index] = result
    return found


def arriving(work: Callable, pieces: list, given: Any = None) -> Iterator[tuple[int, Any]]:
    """As `spread`, each piece's number and its result as it comes. A piece whose worker was killed is done again.

    Raises:
        InputError: if there is no such scheduler, it goes away, it has no workers, workers die of a piece, or one of
            them has other libraries or other code. Nothing that has come is lost.
    """
    cluster = _cluster()
    if cluster is None:
        for index, piece in enumerate(pieces):
            yield index, work(given, piece)
    else:
        yield from cluster.arriving(work, pieces, given)


def elsewhere() -> bool:
    """Whether work is done by workers of a scheduler."""
    return bool(_address())


_on_worker = threading.local()  # `yes`: this thread is at a piece, whose own work is done right here


def _address() -> str:
    return "" if getattr(_on_worker, "yes", False) else os.environ.get(VARIABLE, "").strip()


def _cluster() -> "_Cluster | None":
    address = _address()
    return _connected(address) if address else None


@functools.lru_cache(maxsize=1)
def _connected(address: str) -> "_Cluster":
    return _Cluster(address)


class _Given:
    """What all pieces need, as bytes until a thread of a worker asks: each has its own, as batches are no two
    threads' at once."""

    def __init__(self, packed: bytes) -> None:
        self._packed, self._own = packed, threading.local()

    def __reduce__(self):
        return _Given, (self._packed,)

    def unpacked(self) -> Any:
        if not hasattr(self._own, "value"):
            self._own.value = pickle.loads(self._packed)
        return self._own.value


def _do(work: Callable, expected: Likeness, given: _Given, piece: bytes) -> bytes:
    """What a worker, which has to be as `expected`, does with a piece.

    Piece and result are packed here: Dask would look for tasks of its own in the one, and may hand over arrays that
    cannot be written to.
    """
    if told := unlike(likeness(expected), expected):
        import distributed

        raise InputError(f"{VARIABLE}: worker {distributed.get_worker().address}: {told}")
    from threadpoolctl import threadpool_limits

    os.environ.setdefault("TRUNKLINE_THREADS", "1")  # workers are as many as the machine has cores
    value, _on_worker.yes = given.unpacked(), True
    try:
        with threadpool_limits(1, user_api="blas"):  # as run_stage
            return pickle.dumps(work(value, pickle.loads(piece)))
    finally:
        _on_worker.yes = False


class _Cluster:
    """The workers of the scheduler at `address`."""

    def __init__(self, address: str) -> None:
        try:
            import distributed
        except ImportError:
            raise InputError(
                f"{VARIABLE}: found {address} but no library distributed, expected trunkline[cluster]"
            ) from None
        import logging

        for name in [name for name in logging.root.manager.loggerDict if name.partition(".")[0] == "distributed"]:
            logging.getLogger(name).setLevel(logging.CRITICAL)  # what goes wrong is told in one line here
        self._address, self._dask = address, distributed
        self._given: dict[int, tuple[Any, Any]] = {}
        self._alike: set[tuple[str, str]] = set()
        try:
            self._client: Any = distributed.Client(address, timeout=CONNECTING, set_as_default=False)
            self._client.wait_for_workers(1, timeout=CONNECTING)
        except ValueError:
            raise InputError(f"{VARIABLE}: found {address!r}, expected an address such as tcp://host:8786") from None
        except TimeoutError as error:
            if not hasattr(self, "_client"):
                raise self._none() from error
            self._client.close(timeout=1)
            raise InputError(f"{VARIABLE}: found no workers at {address}, expected at least one") from error
        except OSError as error:
            raise self._none() from error

    def _none(self) -> InputError:
        return InputError(f"{VARIABLE}: found no scheduler at {self._address}, expected one that answers")

    def _gone(self) -> InputError:
        _connected.cache_clear()  # another call may find it again
        return InputError(f"{VARIABLE}: the scheduler at {self._address} went away, expected it to stay until the end")

    def threads(self) -> int:
        return max(1, sum(self._client.nthreads().values())) if self._client.status == "running" else 1

    def arriving(self, work: Callable, pieces: list, given: Any) -> Iterator[tuple[int, Any]]:
        expected = likeness(for_work=work)
        futures: list = []
        try:
            self._check(expected)
            packed = [pickle.dumps(piece) for piece in pieces]
            do = functools.partial(_do, work, expected)
            futures = self._client.map(do, [self._send(given)] * len(pieces), packed, pure=False)
            yield from self._gathered(futures)
        except self._dask.KilledWorker as error:
            raise InputError(
                f"{VARIABLE}: several workers of {self._address} died of the same piece of work, expected them to have "
                "the memory for it"
            ) from error
        except (self._dask.client.FutureCancelledError, OSError, RuntimeError) as error:
            if self._client.status == "running" and not isinstance(error, self._dask.client.FutureCancelledError):
                raise  # the work's own
            raise self._gone() from error
        finally:
            if futures and self._client.status == "running":
                self._client.cancel(futures)

    def _gathered(self, futures: list) -> Iterator[tuple[int, Any]]:
        done: queue.SimpleQueue = queue.SimpleQueue()
        for index, future in enumerate(futures):
            future.add_done_callback(functools.partial(lambda index, _: done.put(index), index))
        lonely = 0.0
        for _ in futures:
            while True:
                try:
                    index = done.get(timeout=LOOK)
                    break
                except queue.Empty:
                    if self._client.status != "running":
                        raise self._gone() from None
                    lonely = 0.0 if self._client.scheduler_info()["workers"] else lonely + LOOK
                    if lonely >= NO_WORKERS:
                        raise InputError(
                            f"{VARIABLE}: found no workers at {self._address} for {NO_WORKERS:.0f} s, expected one"
                        ) from None
            yield index, pickle.loads(futures[index].result())
            futures[index].release()

    def _send(self, given: Any):
        """`given` as a task of its own, which the scheduler does again if the workers that had it were killed."""
        kept = self._given.get(id(given))
        if kept is None or kept[0] is not given:
            if len(self._given) >= 8:
                self._given.pop(next(iter(self._given)))
            packed = _Given(pickle.dumps(given))
            self._given[id(given)] = kept = (given, self._client.submit(_itself, packed, pure=False))
        return kept[1]

    def _check(self, expected: Likeness) -> None:
        """Refuse workers that are not as this process, before they have any work."""
        if self._client.status != "running":
            raise self._gone()
        there = self._client.scheduler_info(n_workers=-1)["workers"]
        new = [address for address in there if (address, expected.code_of) not in self._alike]
        answers = self._client.run(likeness, expected, workers=new, on_error="return") if new else {}
        for address, found in answers.items():
            if told := unlike(found, expected):
                raise InputError(f"{VARIABLE}: worker {address}: {told}")
            self._alike.add((address, expected.code_of))


def _itself(value: Any) -> Any:
    return value
