"""The workers of a Dask scheduler: that they are as this process, what they are sent, what can go wrong with them."""

import functools
import logging
import os
import pickle
import queue
import threading
import time
from collections.abc import Callable, Iterator
from contextlib import contextmanager
from typing import Any

from trunkline.compute.environment import Fingerprint, difference_from, fingerprint, fingerprint_for
from trunkline.errors import InputError

VARIABLE = "TRUNKLINE_SCHEDULER"
CONNECTING = 10.0  # s until a scheduler that does not answer counts as none
NO_WORKERS = 60.0  # s without any worker until work ends: a killed one comes back sooner
LOOK = 1.0  # s between looks at whether the scheduler and its workers are still there
KEPT = 8  # things that all pieces need, until workers may forget the oldest

_thread = threading.local()  # `at_a_piece`: it does one for a scheduler


def at_a_piece() -> bool:
    """Whether this thread of a worker is at a piece, whose own work is done right here."""
    return getattr(_thread, "at_a_piece", False)


class Cluster:
    """The workers of the scheduler at `address`.

    Raises:
        InputError: if there is no scheduler, no worker, or no library to ask them.
    """

    def __init__(self, address: str) -> None:
        try:
            import distributed
        except ImportError:
            raise InputError(
                f"{VARIABLE}: found {address} but no library distributed, expected trunkline[cluster]"
            ) from None
        for name in [name for name in logging.root.manager.loggerDict if name.partition(".")[0] == "distributed"]:
            logging.getLogger(name).setLevel(logging.CRITICAL)  # what goes wrong is told in one line here
        self._address, self._dask = address, distributed
        self._shared: dict[int, tuple[Any, Any]] = {}
        self._alike: set[tuple[str, str]] = set()
        try:
            self._client: Any = distributed.Client(address, timeout=CONNECTING, set_as_default=False)
        except ValueError:
            raise InputError(f"{VARIABLE}: found {address!r}, expected an address such as tcp://host:8786") from None
        except OSError as error:  # a TimeoutError is one
            raise InputError(f"{VARIABLE}: found no scheduler at {address}, expected one that answers") from error
        try:
            self._client.wait_for_workers(1, timeout=CONNECTING)
        except OSError as error:
            self._client.close(timeout=1)
            raise InputError(f"{VARIABLE}: found no workers at {address}, expected at least one") from error

    def answers(self) -> bool:
        return self._client.status == "running"

    def threads(self) -> int:
        """Of all workers."""
        with self._failing():
            return sum(self._client.nthreads().values())

    def arriving(self, work: Callable, parts: list, shared: Any) -> Iterator[tuple[int, Any]]:
        """As `trunkline.compute.scheduler.arriving`."""
        expected, futures = fingerprint_for(work), []
        with self._failing():
            try:
                self._check(expected)
                do, packed = functools.partial(_do, work, expected), [pickle.dumps(part) for part in parts]
                futures = self._client.map(do, [self._send(shared)] * len(parts), packed, pure=False)
                for index in self._done(futures):
                    yield index, pickle.loads(futures[index].result())
                    futures[index].release()
            finally:
                if futures and self.answers():
                    self._client.cancel(futures)

    @contextmanager
    def _failing(self) -> Iterator[None]:
        """What Dask's errors mean, in one line; the work's own stay as they are."""
        cancelled = self._dask.client.FutureCancelledError
        try:
            yield
        except self._dask.KilledWorker as error:
            raise InputError(
                f"{VARIABLE}: several workers of {self._address} died of the same piece of work, expected them to have "
                "the memory for it"
            ) from error
        except (cancelled, OSError, RuntimeError) as error:
            if self.answers() and not isinstance(error, cancelled):
                raise
            raise self._gone() from error

    def _gone(self) -> InputError:
        return InputError(f"{VARIABLE}: the scheduler at {self._address} went away, expected it to stay until the end")

    def _done(self, futures: list) -> Iterator[int]:
        """The number of each future as it is done."""
        done: queue.SimpleQueue = queue.SimpleQueue()
        for index, future in enumerate(futures):
            future.add_done_callback(lambda _, index=index: done.put(index))
        left, last_progress = len(futures), time.monotonic()
        while left:
            try:
                index = done.get(timeout=LOOK)
            except queue.Empty:
                if not self.answers():
                    raise self._gone() from None
                if self._client.scheduler_info()["workers"]:
                    last_progress = time.monotonic()
                elif time.monotonic() - last_progress > NO_WORKERS:
                    raise InputError(
                        f"{VARIABLE}: found no workers at {self._address} for {NO_WORKERS:.0f} s, expected one"
                    ) from None
                continue
            yield index
            left, last_progress = left - 1, time.monotonic()

    def _send(self, shared: Any) -> Any:
        """`shared` as a separate task, which the scheduler does again if the workers that had it were killed."""
        if id(shared) not in self._shared:
            if len(self._shared) == KEPT:
                self._shared.pop(next(iter(self._shared)))
            packed = _SharedValue(pickle.dumps(shared))
            self._shared[id(shared)] = shared, self._client.submit(_itself, packed, pure=False)
        return self._shared[id(shared)][1]

    def _check(self, expected: Fingerprint) -> None:
        """Refuse workers that are not as this process, before they have any work; those that come later refuse it."""
        there = self._client.scheduler_info(n_workers=-1)["workers"]
        new = [address for address in there if (address, expected.code_of) not in self._alike]
        answers = self._client.run(fingerprint, expected.code_of, workers=new, on_error="return") if new else {}
        for address, answer in answers.items():
            if mismatch := difference_from(answer, expected):
                raise InputError(f"{VARIABLE}: worker {address}: {mismatch}")
            self._alike.add((address, expected.code_of))


class _SharedValue:
    """What all pieces need, as bytes until a thread of a worker asks: each has its own, as batches are no two
    threads' at once."""

    def __init__(self, packed: bytes) -> None:
        self._packed, self._local = packed, threading.local()

    def __reduce__(self):
        return _SharedValue, (self._packed,)

    def unpacked(self) -> Any:
        if not hasattr(self._local, "value"):
            self._local.value = pickle.loads(self._packed)
        return self._local.value


def _itself(packed: _SharedValue) -> _SharedValue:
    return packed


def _do(work: Callable, expected: Fingerprint, packed: _SharedValue, part: bytes) -> bytes:
    """What a worker, which has to be as `expected`, does with a piece.

    Part and result are packed here: Dask would look for tasks of its own in the one, and may hand over arrays that
    cannot be written to.
    """
    if mismatch := difference_from(fingerprint(expected.code_of), expected):
        import distributed

        raise InputError(f"{VARIABLE}: worker {distributed.get_worker().address}: {mismatch}")
    from threadpoolctl import threadpool_limits

    os.environ.setdefault("TRUNKLINE_THREADS", "1")  # workers are as many as the machine has cores
    value, _thread.at_a_piece = packed.unpacked(), True
    try:
        with threadpool_limits(1, user_api="blas"):  # as run_stage
            return pickle.dumps(work(value, pickle.loads(part)))
    finally:
        _thread.at_a_piece = False
