"""The command line of what is measured on a package: what is kept, and what is one line."""

from contextlib import contextmanager
from pathlib import Path

import pytest

from qualification import command
from qualification.command import qualify
from trunkline.errors import InputError


@pytest.fixture
def records(monkeypatch):
    """Of each run its result's name and whether it is kept."""
    runs = []

    @contextmanager
    def recorded(name, keep):
        runs.append((name, keep))
        yield

    monkeypatch.setattr(command, "recorded", recorded)
    return runs


@pytest.mark.parametrize(
    ("options", "times", "is_kept"), [([], 5, True), (["--times", "6"], 6, True), (["--times", "4"], 4, False)]
)
def test_a_run_of_fewer_than_the_default_is_not_kept(options, times, is_kept, monkeypatch, records):
    calls = []
    monkeypatch.setattr("sys.argv", ["faults", "twin.tgz", *options])
    assert qualify("faults", __doc__, lambda package, times: calls.append((package, times)), times=5) == 0
    assert calls == [(Path("twin.tgz").resolve(), times)]
    assert records == [("faults", is_kept)]


def test_what_cannot_be_measured_is_one_line(monkeypatch, records, capsys):
    def refuse(package):
        raise InputError("client: does not control")

    monkeypatch.setattr("sys.argv", ["hostile", "twin.tgz"])
    assert qualify("hostile", __doc__, refuse) == 1
    assert capsys.readouterr().err == "error: client: does not control\n"
