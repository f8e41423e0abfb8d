"""Tests run against mutants: each in a process of its own, forked from one that has collected the tests.

There the functions of the file get the mutant's code. What shows only as a module is imported (a constant, a default)
has its tests collected anew, with the module made from the mutant's text. On the disk nothing is changed: what runs in
other processes that do not come from this one by a fork does not see the mutant, so tests that need those kill nothing.
"""

import contextlib
import functools
import gc
import importlib
import json
import math
import os
import resource
import shutil
import signal
import sys
import tempfile
import time
from collections.abc import Callable, Iterator
from dataclasses import dataclass, replace
from importlib.machinery import SourceFileLoader
from pathlib import Path
from types import CodeType, FunctionType
from typing import NoReturn

import pytest

from tests.mutants.operators import Mutant

# Before the first fork, so that no group of tests waits for them; nothing of this repository.
LIBRARIES = (
    "aiohttp", "can", "cryptography.x509", "daqp", "hydra", "hypothesis.extra.numpy", "mink", "mujoco", "numba",
    "omegaconf", "onnxruntime", "pandas", "pyarrow", "pydantic.dataclasses", "rich.console", "ruckig", "scipy.optimize",
    "scipy.ndimage", "scipy.signal", "scipy.spatial.transform", "scipy.stats", "skimage.measure", "threadpoolctl",
    "trimesh", "yaml",
)  # fmt: skip
KILLED, BROKEN, LATE, SURVIVED = "killed", "cannot be imported", "timeout", "survived"
WRONG = "no result"  # the tests say nothing
UNSEEN = "shows at import"
PLUGINS = ("cacheprovider", "faulthandler", "xdist", "looponfail", "junitxml", "pastebin")
SOONEST, LONGEST = 10.0, 60.0  # s that a mutant has beside five times what the original takes; without having tried it
PATIENCE = 10.0  # times as long as that by the clock: limits are of a processor's time, which others' work leaves alone
POLL = 0.02  # s

Tests = tuple[str, ...]


@dataclass(frozen=True)
class Outcome:
    """`kind` as above. `by`: the test that failed first, or what went wrong. `seconds`: of a processor."""

    kind: str
    by: str
    seconds: float = 0.0


Pairs = list[tuple[Mutant, Outcome]]


def outcomes(mutants: list[Mutant], workers: int, tell: Callable[[Mutant, Outcome], None], tried: bool = True) -> Pairs:
    """Of each, in their order. `tell`: called with each as it comes. tried: whether the tests have to pass with the
    original first; else its word is taken that they do."""
    _load_libraries()
    groups: dict[Tests, list[Mutant]] = {}
    for mutant in mutants:
        groups.setdefault(mutant.tests, []).append(mutant)
    jobs, results = [_Group(group, tried) for group in groups.values()], {}
    running: list[_Group] = []
    try:
        while jobs or running:
            while jobs and len(running) < workers:
                running.append(jobs.pop(0).begin())
            for group in list(running):
                for mutant, outcome in group.news():
                    if outcome.kind == UNSEEN:
                        jobs.insert(0, _Group([mutant], tried=False, anew=True))
                    else:
                        results[mutant.key] = outcome
                        tell(mutant, outcome)
                if group.ended:
                    running.remove(group)
            time.sleep(POLL)
    finally:
        for group in running:
            group.end()
    return [(mutant, results[mutant.key]) for mutant in mutants]


def _load_libraries() -> None:
    """Those that are there."""
    for name in LIBRARIES:
        with contextlib.suppress(ImportError):
            importlib.import_module(name)


class _Group:
    """Mutants with the same tests, run one after the other by one process. anew: one, from its import on."""

    def __init__(self, mutants: list[Mutant], tried: bool, anew: bool = False) -> None:
        self.anew, self.ended, self._tried, self._left = anew, False, tried, list(mutants)

    def begin(self) -> "_Group":
        self._folder = Path(tempfile.mkdtemp(prefix="mutants-"))
        self._begun, (self._results, results) = time.monotonic(), os.pipe()
        os.set_blocking(self._results, False)
        self._pid, self._text = _forked(), b""
        if not self._pid:
            _collect(self._left, self._tried, self.anew, self._folder, results)
        os.close(results)
        return self

    def news(self) -> Iterator[tuple[Mutant, Outcome]]:
        """What has come since; what was not said when the process ended goes by why it ended."""
        over, status, _ = os.wait4(self._pid, os.WNOHANG)
        with contextlib.suppress(BlockingIOError):
            while part := os.read(self._results, 1 << 16):
                self._text += part
        *lines, self._text = self._text.split(b"\n")
        for line in lines:
            yield self._left.pop(0), Outcome(*json.loads(line))
        if over or (self.anew and time.monotonic() - self._begun > PATIENCE * LONGEST):
            if not over:
                self.end()
            why = _why(status if over else None) if self.anew else Outcome(WRONG, "all ended")
            yield from ((mutant, why) for mutant in self._left)
            self._left.clear()
            self._close()

    def end(self) -> None:
        _kill(self._pid)
        os.waitpid(self._pid, 0)
        self._close()

    def _close(self) -> None:
        if not self.ended:
            os.close(self._results)
            shutil.rmtree(self._folder, ignore_errors=True)
        self.ended = True


def _forked() -> int:
    sys.stdout.flush()
    sys.stderr.flush()
    return os.fork()


def _kill(pid: int) -> None:
    with contextlib.suppress(ProcessLookupError):
        os.killpg(pid, signal.SIGKILL)


def _why(status: int | None) -> Outcome:
    """Why a process ended that said nothing; None where it did not end."""
    late = status is None or (os.WIFSIGNALED(status) and os.WTERMSIG(status) == signal.SIGXCPU)
    return Outcome(LATE, "the tests do not end") if late else Outcome(KILLED, "the process ended")


def _limit(seconds: float) -> None:
    """Of a processor's time that this process has from here on."""
    most = resource.getrlimit(resource.RLIMIT_CPU)[1]
    resource.setrlimit(resource.RLIMIT_CPU, (math.ceil(time.process_time() + seconds), most))


def _collect(mutants: list[Mutant], tried: bool, anew: bool, folder: Path, results: int) -> NoReturn:
    """The process of a group, and of each of its mutants."""
    try:
        os.setsid()
        for stream in (1, 2):
            os.dup2(os.open(folder / "output", os.O_CREAT | os.O_WRONLY | os.O_APPEND), stream)
        os.dup2(os.open(os.devnull, os.O_RDONLY), 0)
        tempfile.tempdir = os.environ["TMPDIR"] = str(folder)
        loaded = _loaded_from(mutants[0]) if anew else lambda: True
        if anew:
            _limit(LONGEST)
        runner = _Runner([] if anew else mutants, tried, results)
        tests = [f"--basetemp={folder / 'pytest'}", *mutants[0].tests]
        code = pytest.main(
            ["-xq", "--tb=no", "-mnot realtime", *(f"-pno:{name}" for name in PLUGINS), *tests], plugins=[runner]
        )
        if runner.alone or anew:
            _tell(results, _verdict(code, runner, anew, loaded()))
        elif runner.uncollected:
            for _ in mutants:
                _tell(results, Outcome(WRONG, f"{runner.uncollected}: cannot be collected"))
    finally:
        os._exit(0)


def _tell(results: int, outcome: Outcome) -> None:
    os.write(results, json.dumps([outcome.kind, outcome.by, outcome.seconds]).encode() + b"\n")


def _verdict(code: int, runner: "_Runner", anew: bool, loaded: bool) -> Outcome:
    """Of the one run that a process was for."""
    seconds = time.process_time()
    if not loaded:
        return Outcome(WRONG, "its tests do not import the file", seconds)
    if runner.uncollected:
        return Outcome(BROKEN if anew else WRONG, runner.uncollected, seconds)
    if code == pytest.ExitCode.TESTS_FAILED:
        return Outcome(KILLED, runner.failed, seconds)
    if code == pytest.ExitCode.OK and runner.passed:
        return Outcome(SURVIVED, f"{runner.passed} tests passed", seconds)
    return Outcome(WRONG, f"pytest ended with {code!r}, {runner.passed} tests passed", seconds)


class _Runner:
    """Of pytest: forks once the tests are collected. `alone`: in the process of one mutant, or of the original. No
    failure is made smaller by Hypothesis, and none is kept."""

    def __init__(self, mutants: list[Mutant], tried: bool, results: int) -> None:
        self.alone, self.passed, self.failed, self.uncollected = False, 0, "", ""
        self._mutants, self._tried, self._results = mutants, tried, results

    def pytest_configure(self, config) -> None:
        from hypothesis import Phase, settings

        settings.register_profile("mutants", database=None, derandomize=True, phases=[Phase.explicit, Phase.generate])
        settings.load_profile("mutants")

    def pytest_collectreport(self, report) -> None:
        if report.failed:
            self.uncollected = self.uncollected or report.nodeid or "the tests"

    def pytest_runtest_logreport(self, report) -> None:
        self.passed += report.when == "call" and report.passed
        if report.failed:
            self.failed = self.failed or report.nodeid

    @pytest.hookimpl(tryfirst=True)
    def pytest_runtestloop(self, session) -> bool | None:
        """True where all is done; None lets pytest run the tests."""
        if not self._mutants or self.uncollected:
            return None
        for path in {mutant.path for mutant in self._mutants}:
            _functions(os.path.realpath(path))  # before they are frozen: the collector lists none of those
        gc.freeze()  # else it writes to all memory that the processes share
        limit = LONGEST
        if self._tried:
            original = self._outcome(None, 10 * LONGEST)
            if self.alone:
                return None
            if original.kind != SURVIVED:
                wrong = Outcome(WRONG, f"{original.by}, unchanged")
                for _ in self._mutants:
                    _tell(self._results, wrong)
                return True
            limit = SOONEST + 5 * original.seconds
        for mutant in self._mutants:
            outcome = self._outcome(mutant, limit)
            if self.alone:
                return None
            _tell(self._results, outcome)
        return True

    def _outcome(self, mutant: Mutant | None, limit: float) -> Outcome:
        """Of its run in a process of its own, in which this one is `alone` from here on."""
        exchanged = [] if mutant is None else list(_exchanged(mutant))
        if mutant is not None and not exchanged:
            return Outcome(UNSEEN, "no function differs")
        results, own = os.pipe()
        pid, begun = _forked(), time.monotonic()
        if not pid:
            os.setsid()
            _limit(limit)
            self.alone = True
            os.dup2(own, self._results)
            for function, code in exchanged:
                function.__code__ = code
            return Outcome(WRONG, "")
        os.close(own)
        while not (ended := os.wait4(pid, os.WNOHANG))[0] and time.monotonic() - begun < PATIENCE * limit:
            time.sleep(POLL)
        _kill(pid)
        over, status, usage = ended if ended[0] else (0, None, os.wait4(pid, 0)[2])
        with os.fdopen(results) as file:
            text = file.read() if over else ""
        outcome = Outcome(*json.loads(text)) if text else _why(status)
        return replace(outcome, seconds=usage.ru_utime + usage.ru_stime)


def _exchanged(mutant: Mutant) -> Iterator[tuple[FunctionType, CodeType]]:
    """The functions of the file whose code differs in the mutant, with that."""
    codes = {
        (code.co_qualname, code.co_firstlineno): code for code in _codes(compile(mutant.text, mutant.path, "exec"))
    }
    for function in _functions(os.path.realpath(mutant.path)):
        old = function.__code__
        new = codes.get((old.co_qualname, old.co_firstlineno))
        if new is not None and new.co_freevars == old.co_freevars and new.replace(co_filename=old.co_filename) != old:
            yield function, new


@functools.cache
def _functions(path: str) -> list[FunctionType]:
    """Those that were loaded from the file."""
    names: dict[str, str] = {}
    functions = []
    for function in gc.get_objects():
        if isinstance(function, FunctionType):
            name = function.__code__.co_filename
            if (names.get(name) or names.setdefault(name, os.path.realpath(name))) == path:
                functions.append(function)
    return functions


def _codes(code: CodeType) -> Iterator[CodeType]:
    yield code
    for part in code.co_consts:
        if isinstance(part, CodeType):
            yield from _codes(part)


def _loaded_from(mutant: Mutant) -> Callable[[], bool]:
    """From now on the module of the file comes from the text. Returns what says whether it was loaded."""
    path, original, loads = os.path.realpath(mutant.path), SourceFileLoader.get_code, []

    def get_code(loader: SourceFileLoader, name: str):
        if os.path.realpath(loader.path) != path:
            return original(loader, name)
        loads.append(name)
        return compile(mutant.text, loader.path, "exec", dont_inherit=True)

    SourceFileLoader.get_code = get_code
    return lambda: bool(loads)
