"""Tests run against mutants: each in a process of its own, forked from one that has the large libraries already.

There the file's module is loaded from the mutant's text; on the disk nothing is changed. What runs in other processes
that do not come from this one by a fork does not see it, so tests that need those kill nothing.
"""

import contextlib
import importlib
import json
import os
import shutil
import signal
import sys
import tempfile
import time
from collections.abc import Callable, Iterable, Iterator
from dataclasses import dataclass
from importlib.machinery import SourceFileLoader
from pathlib import Path

import pytest

from tests.mutants.operators import Mutant

# Before the first fork, so that no mutant waits for them; nothing of this repository, which is to be loaded after it.
LIBRARIES = (
    "aiohttp", "can", "cryptography.x509", "cryptography.hazmat.primitives.asymmetric.ec", "daqp", "hydra", "hypothesis",
    "hypothesis.extra.numpy", "mink", "mujoco", "numba", "numpy", "omegaconf", "onnxruntime", "pandas", "pyarrow",
    "pydantic.dataclasses", "rich.console", "ruckig", "scipy.ndimage", "scipy.optimize", "scipy.signal",
    "scipy.spatial.transform", "scipy.stats", "skimage.measure", "threadpoolctl", "trimesh", "xml.etree.ElementTree",
    "yaml",
)  # fmt: skip
KILLED, BROKEN, LATE, SURVIVED = "killed", "cannot be imported", "timeout", "survived"
WRONG = "no result"  # of the tests: nothing can be said
PLUGINS = ("cacheprovider", "faulthandler", "xdist", "looponfail", "junitxml", "pastebin", "anyio")
SOONEST = 10.0  # s more than its tests take, and five times that, a mutant has
POLL = 0.01  # s


@dataclass(frozen=True)
class Outcome:
    """`kind` as above. `by`: the test that failed first, or what went wrong. `seconds`: that it took."""

    kind: str
    by: str
    seconds: float


@dataclass(frozen=True)
class Job:
    """`text`: of the file at `path`, in place of what is on the disk; unchanged where it is None."""

    path: str
    text: str | None
    tests: tuple[str, ...]
    limit: float


def load_libraries() -> None:
    for name in LIBRARIES:
        with contextlib.suppress(ImportError):
            importlib.import_module(name)


def outcomes(jobs: Iterable[Job], workers: int, tell: Callable[[Job, Outcome], None]) -> list[Outcome]:
    """Of each job, in their order, `workers` at a time. `tell`: called with each as it comes."""
    waiting, results = list(enumerate(jobs)), {}
    running: dict[int, _Process] = {}
    try:
        while waiting or running:
            while waiting and len(running) < workers:
                number, job = waiting.pop(0)
                running[number] = _Process(job)
            for number, process in list(running.items()):
                if outcome := process.outcome():
                    results[number] = outcome
                    tell(running.pop(number).job, outcome)
            time.sleep(POLL)
    finally:
        for process in running.values():
            process.end()
    return [results[number] for number in sorted(results)]


class _Process:
    """Of one job."""

    def __init__(self, job: Job) -> None:
        self.job, self.begun = job, time.monotonic()
        self._folder = Path(tempfile.mkdtemp(prefix="mutant-"))
        sys.stdout.flush()
        sys.stderr.flush()
        self._pid = os.fork()
        if not self._pid:
            _run(job, self._folder)

    def outcome(self) -> Outcome | None:
        """None while it goes on."""
        seconds = time.monotonic() - self.begun
        if not os.waitpid(self._pid, os.WNOHANG)[0]:
            if seconds < self.job.limit:
                return None
            self.end()
            return Outcome(LATE, f"more than {self.job.limit:.0f} s", seconds)
        self._end_group()
        try:
            kind, by = json.loads((self._folder / "outcome").read_text())
        except FileNotFoundError:
            kind, by = KILLED if self.job.text else WRONG, "the process of the tests ended"
        if kind == WRONG:
            sys.stderr.write((self._folder / "output").read_text(errors="replace")[-3000:])
        shutil.rmtree(self._folder, ignore_errors=True)
        return Outcome(kind, by, seconds)

    def end(self) -> None:
        self._end_group()
        os.waitpid(self._pid, 0)
        shutil.rmtree(self._folder, ignore_errors=True)

    def _end_group(self) -> None:
        with contextlib.suppress(ProcessLookupError):
            os.killpg(self._pid, signal.SIGKILL)


def _run(job: Job, folder: Path) -> None:
    """In the new process, which ends with it."""
    try:
        os.setsid()
        output = os.open(folder / "output", os.O_CREAT | os.O_WRONLY)
        for stream in (1, 2):
            os.dup2(output, stream)
        os.dup2(os.open(os.devnull, os.O_RDONLY), 0)
        tempfile.tempdir = str(folder)
        os.environ["TMPDIR"] = str(folder)
        loaded = _load_instead(job) if job.text is not None else lambda: True
        watcher = _Watcher()
        arguments = ["-x", "-q", "-p", "no:" + " -p no:".join(PLUGINS), "--basetemp", str(folder / "pytest")]
        arguments = [part for argument in arguments for part in argument.split(" ")]
        code = pytest.main([*arguments, *job.tests], plugins=[watcher])
        (folder / "outcome").write_text(json.dumps(_judge(code, watcher, loaded())))
    finally:
        os._exit(0)


def _judge(code: int, watcher: "_Watcher", loaded: bool) -> tuple[str, str]:
    if not loaded and code == pytest.ExitCode.OK:
        return WRONG, "the tests do not import the file"
    if watcher.uncollected or code in (pytest.ExitCode.INTERRUPTED, pytest.ExitCode.INTERNAL_ERROR):
        return BROKEN if loaded else WRONG, watcher.uncollected
    if code == pytest.ExitCode.TESTS_FAILED:
        return KILLED, watcher.failed
    if code == pytest.ExitCode.OK and watcher.passed:
        return SURVIVED, f"{watcher.passed} tests passed"
    return WRONG, f"pytest ended with {code!r}, {watcher.passed} tests passed"


def _load_instead(job: Job) -> Callable[[], bool]:
    """From now on the module of the file comes from the text. Returns what says whether it was loaded."""
    path, original, loads = os.path.realpath(job.path), SourceFileLoader.get_code, []

    def get_code(loader: SourceFileLoader, name: str):
        if os.path.realpath(loader.path) != path:
            return original(loader, name)
        loads.append(name)
        return compile(job.text or "", loader.path, "exec", dont_inherit=True)

    SourceFileLoader.get_code = get_code
    return lambda: bool(loads)


class _Watcher:
    """Of pytest: what passed, what failed first, what could not be collected. No failure is made smaller by Hypothesis,
    and none is kept."""

    def __init__(self) -> None:
        self.passed, self.failed, self.uncollected = 0, "", ""

    def pytest_configure(self, config) -> None:
        from hypothesis import Phase, settings

        settings.register_profile("mutants", database=None, derandomize=True, phases=[Phase.explicit, Phase.generate])
        settings.load_profile("mutants")

    def pytest_runtest_logreport(self, report) -> None:
        self.passed += report.when == "call" and report.passed
        if report.failed:
            self.failed = self.failed or report.nodeid

    def pytest_collectreport(self, report) -> None:
        if report.failed:
            self.uncollected = self.uncollected or report.nodeid or "collection"


def limits(targets: Iterable[tuple[str, ...]], workers: int) -> Iterator[tuple[tuple[str, ...], float | str]]:
    """Of each group of tests how long a mutant may take, s; in words why its tests say nothing, where they do not."""
    groups = list(dict.fromkeys(targets))
    jobs = [Job("", None, tests, 600.0) for tests in groups]
    for tests, outcome in zip(groups, outcomes(jobs, workers, lambda job, outcome: None), strict=True):
        good = outcome.kind == SURVIVED
        yield tests, SOONEST + 5 * outcome.seconds if good else f"{outcome.kind}: {outcome.by}"


def of(mutant: Mutant, limit: float) -> Job:
    return Job(mutant.path, mutant.text, mutant.tests, limit)
