"""Skipped tests: those that a table allows are counted, by reason; any other fails the run.

The table, tests/skips.yaml, has a row a reason: `reason`, as the test gives it; `where`, what must be so on this
machine for it; `tests`, patterns of test ids. In a run of every test a row must be of use: each of its patterns names a
test, and where its condition holds some test is skipped for it.
"""

import os
from collections import Counter
from dataclasses import dataclass
from fnmatch import fnmatchcase
from importlib.util import find_spec
from pathlib import Path

import pytest
import yaml

from tests.support.folders import ROOT

WHERE = {
    "no module": lambda name: find_spec(name) is None,
    "no path": lambda name: not (ROOT / name).exists(),
    "no variable": lambda name: not os.environ.get(name),
    "variable": lambda setting: setting in (f"{name}={value}" for name, value in os.environ.items()),
}
ENDED = (pytest.ExitCode.OK, pytest.ExitCode.NO_TESTS_COLLECTED)  # with which a run ends that nothing failed in
WHOLE = ("", "realtime", "not realtime")  # marks by which the two runs of `make test` share all tests


@dataclass(frozen=True)
class Row:
    """reason: as the test gives it. where: conditions of `WHERE`, by name, all of which must hold. tests: patterns."""

    reason: str
    where: dict[str, str]
    tests: list[str]

    @property
    def holds(self) -> bool:
        return all(WHERE[name](value) for name, value in self.where.items())

    def names(self, test: str) -> bool:
        return any(fnmatchcase(test, _literal(pattern)) for pattern in self.tests)


def _literal(pattern: str) -> str:
    """Of the characters that fnmatch reads, the star alone: ids of tests have brackets."""
    return pattern.replace("[", "[[]")


def read_rows(path: Path) -> list[Row]:
    return [Row(**row) for row in yaml.safe_load(path.read_text())] if path.is_file() else []


class Skips:
    """Plugin of pytest, with pytest-xdist and without. rows: what is allowed."""

    def __init__(self, rows: list[Row]):
        self.rows, self.skipped, self.selected, self.unmatched = rows, {}, set(), set()

    @pytest.hookimpl(tryfirst=True)
    def pytest_collection_modifyitems(self, config, items):
        """Before tests are deselected."""
        patterns = {pattern for row in self.rows for pattern in row.tests}
        ids = [item.nodeid for item in items]
        self.unmatched = {p for p in patterns if not any(fnmatchcase(test, _literal(p)) for test in ids)}
        if hasattr(config, "workeroutput"):
            config.workeroutput["unmatched"] = sorted(self.unmatched)

    def pytest_collection_finish(self, session):
        self.selected |= {item.nodeid for item in session.items}

    @pytest.hookimpl(optionalhook=True)
    def pytest_xdist_node_collection_finished(self, node, ids):
        self.selected |= set(ids)

    @pytest.hookimpl(optionalhook=True)
    def pytest_testnodedown(self, node, error):
        self.unmatched |= set(getattr(node, "workeroutput", {}).get("unmatched", ()))

    def pytest_runtest_logreport(self, report):
        if report.skipped:
            self.skipped[report.nodeid] = _reason(report)

    def pytest_collectreport(self, report):
        if report.skipped:
            self.skipped[report.nodeid] = _reason(report)

    def pytest_sessionfinish(self, session, exitstatus):
        if hasattr(session.config, "workerinput"):
            return
        stopped = session.shouldfail or session.shouldstop
        if exitstatus in ENDED and self.faults(_is_whole(session.config) and not stopped):
            session.exitstatus = pytest.ExitCode.TESTS_FAILED

    def pytest_terminal_summary(self, terminalreporter, exitstatus, config):
        for reason, count in Counter(self.skipped.values()).most_common():
            terminalreporter.write_line(f"skipped {count}: {reason}")
        stopped = exitstatus not in (pytest.ExitCode.OK, pytest.ExitCode.TESTS_FAILED)
        for fault in self.faults(_is_whole(config) and not stopped):
            terminalreporter.write_line(f"FAILED {fault}", red=True)

    def faults(self, whole: bool) -> list[str]:
        """What is wrong with the skips, a line each. whole: whether every test was there to be run."""
        lines = [
            f"{test} - skipped, and tests/skips.yaml does not allow it: {reason}"
            for test, reason in sorted(self.skipped.items())
            if not any(row.reason == reason and row.holds and row.names(test) for row in self.rows)
        ]
        if whole:
            ran = self.selected - set(self.skipped)
            lines += [f"tests/skips.yaml: no test has an id like {pattern}" for pattern in sorted(self.unmatched)]
            lines += [
                f"tests/skips.yaml: no test is skipped for {row.reason!r}, though it may be here"
                for row in self.rows
                if row.reason not in self.skipped.values() and row.holds and any(map(row.names, ran))
            ]
        return lines


def _reason(report) -> str:
    if hasattr(report, "wasxfail"):
        return f"expected to fail: {report.wasxfail}"
    return report.longrepr[2].removeprefix("Skipped: ")


def _is_whole(config) -> bool:
    """Whether nothing but the marks of `WHOLE` chooses tests."""
    asked = config.args_source == config.ArgsSource.TESTPATHS and config.option.markexpr in WHOLE
    chosen = (config.option.keyword, config.getoption("deselect"), config.getoption("lf", False), config.option.maxfail)
    return asked and not any(chosen)
