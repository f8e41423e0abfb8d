"""The tool itself, on a module of its own: what is killed, what survives, what never ends, and what each is called."""

import os
import subprocess
import sys
from pathlib import Path

import pytest
import yaml

from tests.mutants.operators import mutants
from tests.mutants.targets import drawn, read_reasons, read_targets

JUDGE = """
LONGEST = 3


def arrived(distance, limit):
    if distance < 0:
        raise ValueError("negative")
    return distance <= limit


def left(count):
    while count > 0:
        count -= LONGEST
    return count
"""
TESTS = """
import pytest
import judge


def test_arrived():
    assert judge.arrived(0.5, 2)
    assert not judge.arrived(3, 2)
    with pytest.raises(ValueError):
        judge.arrived(-1, 2)


def test_left():
    assert judge.left(3) == 0
    assert judge.left(4) == -2
"""
SURVIVES = ["if distance < 0 -> if distance <= 0", "return distance <= limit -> return distance < limit"]
RUN = """
import sys
from pathlib import Path
from tests.mutants import __main__, running

running.LIBRARIES, running.SOONEST = ("hypothesis",), 1.0
sys.exit(__main__.main(sys.argv[1:], Path("."), Path(".")))
"""


@pytest.fixture
def judged(tmp_path):
    """A folder with a judge, its tests and the tables of a run."""
    (tmp_path / "judge.py").write_text(JUDGE)
    (tmp_path / "test_judge.py").write_text(TESTS)
    group = {"of": ["arrived", "left", "LONGEST"], "tests": ["test_judge.py"]}
    write(tmp_path, [group], {"nothing is promised of the border": [f"judge.py::arrived: {name}" for name in SURVIVES]})
    return tmp_path


def write(folder: Path, groups: list, reasons: dict, edits: list | None = None) -> None:
    (folder / "targets.yaml").write_text(yaml.safe_dump({"judge.py": groups}))
    (folder / "edits.yaml").write_text(yaml.safe_dump(edits or []))
    (folder / "equivalent.yaml").write_text(yaml.safe_dump(reasons))


def run(folder: Path, *arguments: str) -> tuple[int, str]:
    environment = {**os.environ, "PYTHONPATH": os.pathsep.join([str(Path.cwd()), str(folder)])}
    done = subprocess.run([sys.executable, "-c", RUN, *arguments], cwd=folder, env=environment, text=True,
                          capture_output=True, check=False)  # fmt: skip
    return done.returncode, done.stdout + done.stderr


def test_what_survives_is_named_what_never_ends_is_killed_and_the_tree_stays_as_it_was(judged):
    code, printed = run(judged, "--each", "--workers", "2")
    names = [mutant.name for mutant in mutants("judge.py", JUDGE)]
    assert len(printed.splitlines()) == len(names) + 2  # each, what fails, and the sum
    for name in names:
        verdict = next(line for line in printed.splitlines() if f": {name} [" in line).split()[1]
        assert verdict == ("survived" if name in SURVIVES else "timeout" if "count += " in name else "killed"), name
    assert code == 1  # two of so few are more than a tenth
    assert "% killed, expected at least 90 %" in printed
    assert (judged / "judge.py").read_text() == JUDGE
    assert f"- `judge.py::arrived: {SURVIVES[0]}`" in (judged / "table.md").read_text()
    assert "nothing is promised of the border" in (judged / "table.md").read_text()


def test_a_sample_is_of_those_that_have_to_be_killed(judged):
    code, printed = run(judged, "--sample", "3", "--seed", "2026-1")
    assert code == 0, printed
    assert "100.0 % killed" in printed


@pytest.mark.parametrize(
    ("reasons", "expected"),
    [
        ({}, f"survives without a reason: judge.py::arrived: {SURVIVES[0]}"),
        ({"why": ["judge.py::arrived: gone"]}, "no such mutant: judge.py::arrived: gone"),
        ({"why": ["judge.py::arrived: if distance < 0 -> if True"]}, "is killed: judge.py::arrived: if distance < 0"),
    ],
)
def test_reasons_are_of_what_survives_and_of_all_of_it(judged, reasons, expected):
    write(judged, [{"of": ["arrived"], "tests": ["test_judge.py"]}], reasons)
    code, printed = run(judged, "--like", "arrived: if distance < 0")
    assert code == 1
    assert expected in printed


@pytest.mark.parametrize(
    ("tests", "expected"),
    [
        ("import nothing\n", "judge.py: test_judge.py: cannot be collected"),
        ("def test():\n    assert False\n", "judge.py: test_judge.py::test, unchanged"),
        ("import pytest\n\n\ndef test():\n    pytest.skip()\n", "0 tests passed, unchanged"),
        ("def test():\n    pass\n", "its tests do not import the file"),
    ],
)
def test_tests_that_say_nothing_kill_nothing(judged, tests, expected):
    (judged / "test_judge.py").write_text(tests)
    write(judged, [{"of": ["LONGEST"], "tests": ["test_judge.py"]}], {})
    code, printed = run(judged)
    assert code == 1
    assert expected in printed
    assert " killed)" not in printed


def test_an_edit_by_hand_is_of_one_place(judged):
    def edited(**edit: str) -> list:
        return [{"file": "judge.py", "tests": ["test_judge.py"], "edits": [{"id": "B1", **edit}]}]

    write(judged, [], {}, edited(old="distance", new=""))
    code, printed = run(judged)
    assert (code, printed) == (1, "mutants: error: judge.py: B1: found 3 times, expected once: 'distance'\n")
    write(judged, [], {}, edited(old="distance <= limit", new="True", bug="all arrives"))
    assert run(judged, "--like", "all arrives")[0] == 0


def test_a_mutant_keeps_its_name_whatever_stands_before_it():
    after = "# one line more\n" + JUDGE.replace("def left", "def other(x): return x < 0 or x < 0\n\n\ndef left")
    names = {mutant.key: mutant.line for mutant in mutants("judge.py", JUDGE)}
    moved = {mutant.key: mutant.line for mutant in mutants("judge.py", after)}
    assert names.keys() < moved.keys()
    assert all(moved[key] > line for key, line in names.items())
    assert {"judge.py::other: return x < 0 or x < 0 -> return False or x < 0",
            "judge.py::other: return x < 0 or x < 0 -> return x < 0 or False"} < moved.keys()  # fmt: skip


@pytest.mark.parametrize(
    ("text", "changes"),
    [
        ("a < b", {"a <= b", "a >= b"}),
        ("a == b", {"a != b"}),
        ("a and b.c", {"True and b.c", "a and True"}),
        ("a or not b", {"False or not b", "a or False"}),
        ("a & ~b", {"a | ~b", "a & b"}),
        ("a + 2 * b", {"a - 2 * b", "a + 2 / b", "a + 4 * b"}),
        ("min(a, b)", {"max(a, b)"}),
        ("a.any(axis=1)", {"a.all(axis=1)"}),
        ("isfinite(a)", {"(isfinite(a) | True)"}),
        ("abs(a)", {"(a)"}),
        ("a if b else 0", {"a if False else 0", "a if True else 0", "a if b else 1"}),
        ("[a for a in b if a]", {"[a for a in b if False]", "[a for a in b if True]"}),
        ("''", {'"mutant"'}),
        ("'why'", {'""'}),
        ("f'{a:.2f} of {b + 1}'", {'""'}),
        ("a[0] + a[:, 1:2, -1]", {"a[0] - a[:, 1:2, -1]"}),
        ("a[b + 1]", {"a[b - 1]", "a[b + 2]"}),
        ("'é' + a if b < c else d", {"'é' + a if False else d", "'é' + a if True else d", "'é' + a if b <= c else d"}),
    ],
)
def test_the_changes_of_an_expression(text, changes):
    head = "def f(a, b, c, d):\n    return "
    assert {mutant.text.removeprefix(head) for mutant in mutants("f.py", head + text)} == changes


@pytest.mark.parametrize(
    ("text", "changes"),
    [
        ("if a:\n        raise E(a + 1)", {"if False:\n        raise E(a + 1)", "if True:\n        raise E(a + 1)"}),
        ("self.a = a", {"pass"}),
        ("a = b", set()),
        ("a.stop()", {"pass"}),
        ("a += b", {"a -= b"}),
        ("assert a < 2", set()),
        ("'''Words.'''", set()),
        ("a: Field[0] = b", set()),
    ],
)
def test_the_changes_of_a_statement(text, changes):
    head = "def f(self, a, b):\n    "
    assert {mutant.text.removeprefix(head) for mutant in mutants("f.py", head + text)} == changes


def test_a_name_that_is_not_there_is_an_error():
    with pytest.raises(ValueError, match=r"judge\.py: found no gone, expected a function, a class or a constant"):
        mutants("judge.py", JUDGE, ["gone"])


def test_a_sample_is_the_same_for_a_seed_and_another_for_another():
    every = mutants("judge.py", JUDGE)
    reasons = dict.fromkeys([every[0].key, every[3].key], "why")
    first = drawn(every, reasons, 5, "2026-47")
    assert first == drawn(every, reasons, 5, "2026-47")
    assert first != drawn(every, reasons, 5, "2026-48")
    assert not {mutant.key for mutant in first} & reasons.keys()
    assert len(drawn(every, reasons, 1000, "2026-47")) == len(every) - 2


def test_reasons_are_read_by_mutant(tmp_path):
    write(tmp_path, [], {"why": ["a", "b"], "because": ["c"]})
    assert read_reasons(tmp_path) == {"a": "why", "b": "why", "c": "because"}


def test_every_target_edit_and_reason_that_is_committed_is_of_the_code_as_it_is():
    """Else `make mutants_sample` says so, which `make test` does not run."""
    folder = Path(__file__).parent
    every = {mutant.key for mutant in read_targets(folder, folder.parents[1])}
    assert read_reasons(folder).keys() <= every
