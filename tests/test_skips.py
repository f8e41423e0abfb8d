"""What the plugin of tests/support/skips.py makes of skips: inner runs of pytest on small files."""

import os
import subprocess
import sys

import pytest

from tests.support.skips import Row, Skips, read_rows

TABLE = [Row("no such library", {"no module": "no_such_library"}, ["test_one.py::test_of_a_library*"])]
SKIP = """
import pytest

@pytest.mark.parametrize("way", ["a[1]", "b"])
def test_of_a_library(way):
    pytest.skip("no such library")

def test_sound():
    pass
"""
OTHERWISE = "\n\n@pytest.mark.skip(reason='{reason}')\ndef test_{name}():\n    pass\n"


@pytest.fixture
def run_skips(tmp_path, monkeypatch, capsys):
    """A run of one file, as `make test` runs all: its exit code and what it printed."""
    monkeypatch.chdir(tmp_path)
    (tmp_path / "pytest.ini").write_text("[pytest]\ntestpaths = .\nmarkers = realtime\n")

    def run(text, rows=TABLE, *options):
        (tmp_path / "test_one.py").write_text(text)
        sys.modules.pop("test_one", None)
        code = pytest.main(["-q", "-p", "no:cacheprovider", "-p", "no:xdist", *options], plugins=[Skips(rows)])
        return code, capsys.readouterr().out

    return run


def test_allowed_skips_are_counted_by_reason(run_skips):
    code, out = run_skips(SKIP)
    assert code == 0
    assert "\nskipped 2: no such library\n" in out


@pytest.mark.parametrize(
    ("reason", "name"), [("too busy", "of_a_library_now"), ("no such library", "of_another")], ids=["reason", "test"]
)
def test_any_other_skip_fails_the_run_in_a_line(run_skips, reason, name):
    """For another reason, or of another test; also where the run is of a part."""
    text = SKIP + OTHERWISE.format(reason=reason, name=name)
    for options in ((), ("-k", name)):
        code, out = run_skips(text, TABLE, *options)
        assert code == 1
        expected = f"FAILED test_one.py::test_{name} - skipped, and tests/skips.yaml does not allow it: {reason}"
        assert [line for line in out.splitlines() if line.startswith("FAILED")] == [expected]


@pytest.mark.parametrize(
    "text",
    [
        "import pytest\n\npytest.skip('all', allow_module_level=True)\n",
        "import pytest\n\n@pytest.mark.xfail(reason='some day')\ndef test_xfail():\n    assert False\n",
        "import pytest\n\n@pytest.fixture\ndef made():\n    pytest.skip('none')\n\ndef test_fixture(made):\n    pass\n",
    ],
    ids=["module", "expected failure", "fixture"],
)
def test_a_module_a_fixture_and_an_expected_failure_skip_too(run_skips, text):
    code, out = run_skips(text, [])
    assert code == 1
    assert "FAILED test_one.py" in out


def test_a_reason_that_does_not_hold_here_is_none(run_skips):
    code, out = run_skips(SKIP, [Row("no such library", {"no module": "pytest"}, TABLE[0].tests)])
    assert code == 1
    assert out.count("FAILED test_one.py::test_of_a_library[") == 2


def test_a_row_of_no_use_fails_a_run_of_all_tests_alone(run_skips):
    gone = Row("gone", {"no path": "nowhere"}, ["test_one.py::test_gone"])
    unused = Row("unused", {"no path": "nowhere"}, ["test_one.py::test_sound"])
    elsewhere = Row("elsewhere", {"no module": "pytest"}, ["test_one.py::test_sound"])
    rows = [*TABLE, gone, unused, elsewhere]
    for mark in ((), ("-m", "not realtime")):
        code, out = run_skips(SKIP, rows, *mark)
        assert code == 1
        assert [line for line in out.splitlines() if line.startswith("FAILED")] == [
            "FAILED tests/skips.yaml: no test has an id like test_one.py::test_gone",
            "FAILED tests/skips.yaml: no test is skipped for 'unused', though it may be here",
        ]
    for part in (("test_one.py",), ("-k", "library"), ("-m", "not other")):
        assert run_skips(SKIP, rows, *part)[0] == 0


def test_a_row_of_tests_of_the_other_run_is_of_use(run_skips):
    marked = SKIP + "\n\n@pytest.mark.realtime\ndef test_marked():\n    pytest.skip('busy')\n"
    rows = [*TABLE, Row("busy", {"no path": "nowhere"}, ["test_one.py::test_marked"])]
    for mark in ("realtime", "not realtime"):
        assert run_skips(marked, rows, "-m", mark)[0] == 0


def test_with_several_workers_it_is_the_same(tmp_path):
    (tmp_path / "pytest.ini").write_text("[pytest]\ntestpaths = .\n")
    (tmp_path / "conftest.py").write_text(
        "from tests.support.skips import Row, Skips\n\n"
        "def pytest_configure(config):\n"
        f"    rows = {TABLE!r} + [Row('gone', {{'no path': 'nowhere'}}, ['test_gone'])]\n"
        "    config.pluginmanager.register(Skips(rows))\n"
    )
    (tmp_path / "test_one.py").write_text(SKIP)
    (tmp_path / "test_two.py").write_text("import pytest\n\npytest.skip('all of it', allow_module_level=True)\n")
    clean = {name: value for name, value in os.environ.items() if not name.startswith("PYTEST_")}
    alone = clean | {"PYTEST_DISABLE_PLUGIN_AUTOLOAD": "1"}
    command = [sys.executable, "-m", "pytest", "-q", "-p", "xdist", "-n", "2"]
    done = subprocess.run(command, cwd=tmp_path, env=alone, capture_output=True, text=True, check=False)
    assert done.returncode == 1, done.stdout + done.stderr
    assert "\nskipped 2: no such library\n" in done.stdout
    assert [line for line in done.stdout.splitlines() if line.startswith("FAILED")] == [
        "FAILED test_two.py - skipped, and tests/skips.yaml does not allow it: all of it",
        "FAILED tests/skips.yaml: no test has an id like test_gone",
    ]


def test_the_project_s_table_is_read(request):
    rows = read_rows(request.config.rootpath / "tests/skips.yaml")
    assert len({row.reason for row in rows}) == len(rows) > 5
    assert all(row.holds in (True, False) and row.where and row.tests for row in rows)
