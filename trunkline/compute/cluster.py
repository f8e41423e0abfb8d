"""Work on the workers of a Dask scheduler."""

import functools
import gc
import hashlib
import logging
import os
import pickle
import platform
import re
import threading
import time
from collections.abc import Callable, Iterator
from concurrent.futures import CancelledError
from contextlib import contextmanager
from importlib.metadata import PackageNotFoundError, requires, version
from importlib.util import find_spec
from pathlib import Path
from typing import Any

from trunkline.errors import InputError

VARIABLE = "TRUNKLINE_SCHEDULER"
LIBRARY = "trunkline"
CONNECTING = 10.0  # s until a scheduler that does not answer counts as none
FIRST_WORKER = 10.0  # s until one without workers is an error
NO_WORKERS = 60.0  # s without any worker until work ends: a killed one comes back sooner
FETCHING = 60.0  # s in which a result comes, or it is asked for again
LOOK = 1.0  # s between looks at whether the scheduler and its workers are still there
SHARED = 8  # values that all pieces need, until the oldest is forgotten

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
            logging.getLogger(name).setLevel(logging.CRITICAL)  # what goes wrong is one line here
        self._address, self._dask = address, distributed
        self._shared: dict[int, tuple[Any, Any]] = {}  # value and its future, by the value's id
        self._checked: set[tuple[str, str]] = set()  # workers' addresses, each with a package
        try:
            with _uncollected():
                self._client: Any = distributed.Client(address, timeout=CONNECTING, set_as_default=False)
        except ValueError:
            raise InputError(f"{VARIABLE}: found {address!r}, expected an address such as tcp://host:8786") from None
        except OSError as error:  # a TimeoutError is one
            raise InputError(f"{VARIABLE}: found no scheduler at {address}, expected one that answers") from error
        try:
            self._client.wait_for_workers(1, timeout=FIRST_WORKER)
        except OSError as error:
            with _uncollected():
                self._client.close(timeout=1)
            raise InputError(f"{VARIABLE}: found no workers at {address}, expected at least one") from error

    def answers(self) -> bool:
        return self._client.status == "running"

    def threads(self) -> int:
        """Of all workers."""
        with self._in_one_line():
            return sum(self._client.nthreads().values())

    def arriving(self, work: Callable, parts: list, shared: Any) -> Iterator[tuple[int, Any]]:
        """As `trunkline.compute.scheduler.arriving`."""
        left, package = {}, work.__module__.partition(".")[0]
        # packed: Dask would look for tasks of its own in them, and may hand over arrays that cannot be written to
        packed = [pickle.dumps(part) for part in parts]
        with self._in_one_line():
            try:
                self._check(package)
                do = functools.partial(_do, work, package, environment(package))
                futures = self._client.map(do, [self._send(shared)] * len(parts), packed, pure=False)
                left = dict(zip(futures, range(len(parts)), strict=True))
                del futures  # what is done is released as it leaves `left`
                while left:
                    for future in self._done(list(left)):
                        yield left.pop(future), pickle.loads(self._result(future))
            finally:
                left.clear()  # the scheduler drops what nobody waits for

    @contextmanager
    def _in_one_line(self) -> Iterator[None]:
        """What Dask's errors mean; the work's own stay as they are."""
        try:
            yield
        except self._dask.KilledWorker as error:
            raise InputError(
                f"{VARIABLE}: several workers of {self._address} died of the same piece of work, expected them to have "
                "the memory for it"
            ) from error
        except (CancelledError, OSError, RuntimeError) as error:
            if self.answers() and not isinstance(error, (CancelledError, self._dask.comm.CommClosedError)):
                raise
            raise InputError(
                f"{VARIABLE}: the scheduler at {self._address} went away, expected it to stay until the end"
            ) from error

    def _done(self, futures: list) -> set:
        """Those that are done, at least one of them."""
        last_worker = time.monotonic()
        while True:
            try:
                with self._client.as_current():
                    return self._dask.wait(futures, LOOK, "FIRST_COMPLETED").done
            except TimeoutError:
                if not self.answers():
                    raise
                if self._client.scheduler_info()["workers"]:
                    last_worker = time.monotonic()
                elif time.monotonic() - last_worker > NO_WORKERS:
                    raise InputError(
                        f"{VARIABLE}: found no workers at {self._address} for {NO_WORKERS:.0f} s, expected one"
                    ) from None

    def _result(self, future: Any) -> bytes:
        """Of one that is done. Dask waits for ever for one whose scheduler goes away just then."""
        while True:
            try:
                return future.result(timeout=FETCHING)
            except TimeoutError:
                if future.status == "error" or not self.answers():
                    raise

    def _check(self, package: str) -> None:
        """Refuse workers with another environment before they have any work; those that come later refuse it."""
        new = [a for a in self._client.scheduler_info(n_workers=-1)["workers"] if (a, package) not in self._checked]
        expected = environment(package)
        answers = self._client.run(difference, package, expected, workers=new, on_error="return") if new else {}
        for address, mismatch in answers.items():
            if isinstance(mismatch, Exception):
                mismatch = f"found no {LIBRARY} like this one ({mismatch!r}), expected the same code"
            if mismatch:
                raise InputError(f"{VARIABLE}: worker {address}: {mismatch}")
            self._checked.add((address, package))

    def _send(self, shared: Any) -> Any:
        """`shared` as a task, which the scheduler repeats if the workers that had it were killed; scattered data would
        be lost."""
        if id(shared) not in self._shared:
            if len(self._shared) == SHARED:
                self._shared.pop(next(iter(self._shared)))
            self._shared[id(shared)] = shared, self._client.submit(_itself, pickle.dumps(shared), pure=False)
        return self._shared[id(shared)][1]


@contextmanager
def _uncollected() -> Iterator[None]:
    """No cycle of objects is collected meanwhile. A client of Dask that is collected waits for a lock, which another
    one holds while it begins or ends: where that is in the same thread, for ever."""
    enabled = gc.isenabled()
    gc.collect()
    gc.disable()
    try:
        yield
    finally:
        if enabled:
            gc.enable()


def difference(package: str, expected: dict[str, str]) -> str:
    """The first thing in which this process's environment is not the expected one; empty if in none."""
    here = environment(package)
    for name, value in expected.items():
        if here.get(name) != value:
            return f"found {name} {here.get(name)}, expected {value} as here"
    return ""


@functools.cache
def environment(package: str) -> dict[str, str]:
    """Versions of what the library and its extra `teleop` need, and the code of the library and of `package`, by name.

    Dask's `get_versions` would import each library, and knows nothing of code.
    """
    lines = [line for line in requires(LIBRARY) or [] if "extra ==" not in line or '"teleop"' in line.replace("'", '"')]
    names = [LIBRARY, *sorted(re.split(r"[^\w.-]", line)[0] for line in lines)]
    parts = {"Python": platform.python_version()} | {name: _version(name) for name in names}
    return parts | {f"code of {name}": _digest(name) for name in (LIBRARY, package)}


def _version(name: str) -> str:
    try:
        return version(name)
    except PackageNotFoundError:
        return "none"


def _digest(package: str) -> str:
    """Of all the package's code."""
    spec, total = find_spec(package), hashlib.sha256()
    if spec is None or not spec.submodule_search_locations:
        return "none"
    root = Path(next(iter(spec.submodule_search_locations)))
    for file in sorted(root.rglob("*.py")):
        total.update(file.relative_to(root).as_posix().encode() + b"\0" + file.read_bytes() + b"\0")
    return total.hexdigest()[:12]


def _itself(packed: bytes) -> bytes:
    return packed


@functools.lru_cache(SHARED)
def _unpacked(packed: bytes, thread: int) -> Any:
    """Each thread has its own, as batches are no two threads' at once."""
    return pickle.loads(packed)


def _do(work: Callable, package: str, expected: dict[str, str], shared: bytes, part: bytes) -> bytes:
    """What a worker does with a piece, if its environment is the expected one."""
    if mismatch := difference(package, expected):
        import distributed

        raise InputError(f"{VARIABLE}: worker {distributed.get_worker().address}: {mismatch}")
    from threadpoolctl import threadpool_limits

    os.environ.setdefault("TRUNKLINE_THREADS", "1")  # workers are as many as the machine has cores
    _thread.at_a_piece = True
    try:
        with threadpool_limits(1, user_api="blas"):  # as run_stage
            return pickle.dumps(work(_unpacked(shared, threading.get_ident()), pickle.loads(part)))
    finally:
        _thread.at_a_piece = False
