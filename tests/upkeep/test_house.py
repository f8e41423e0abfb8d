"""What `make house` counts, each number by hand on made sources."""

import ast
import subprocess

import pytest

from trunkline.errors import InputError
from upkeep import house, imports, names, sizes
from upkeep.follow import Trip, follow
from upkeep.sources import code_in, python_in, read_checkout, read_revision
from upkeep.walk import Index, going_back, walk


@pytest.fixture
def checkout(tmp_path):
    """A repository whose revision `first` has one file; since then it changed, and others came."""

    def git(*arguments):
        subprocess.run(["git", "-c", "user.name=a", "-c", "user.email=a@b", *arguments], cwd=tmp_path, check=True)

    (tmp_path / "demo").mkdir()
    (tmp_path / "demo/a.py").write_text("first = 'µ'\n", encoding="utf-8")
    (tmp_path / ".gitignore").write_text("ignored.py\n")
    git("init", "-q")
    git("add", ".")
    git("commit", "-qm", "first")
    git("tag", "first")
    (tmp_path / "demo/a.py").write_text("second = 2\n")
    for name in ("new.py", "ignored.py", "README.md", "table.csv"):
        (tmp_path / name).write_text("x = 1\n")
    (tmp_path / "link.py").symlink_to("new.py")
    return tmp_path


def test_a_checkout_is_read_as_it_is_on_disk(checkout):
    assert read_checkout(checkout) == {"README.md": "x = 1\n", "demo/a.py": "second = 2\n", "new.py": "x = 1\n"}
    subprocess.run(["git", "add", "new.py"], cwd=checkout, check=True)
    (checkout / "new.py").unlink()  # still in the index
    assert sorted(read_checkout(checkout)) == ["README.md", "demo/a.py"]


def test_a_revision_is_read_as_it_was(checkout):
    assert read_revision(checkout, "first") == {"demo/a.py": "first = 'µ'\n"}
    with pytest.raises(InputError, match="git archive in .*second"):
        read_revision(checkout, "second")


def test_python_is_taken_by_its_top_folder():
    sources = {"demo/a.py": "", "demo/a.md": "", "demos/b.py": "", "tests/c.py": "", "tests_d.py": ""}
    assert list(python_in(sources, "demo", "tests")) == ["demo/a.py", "tests/c.py"]
    assert list(code_in(sources)) == ["demo/a.py", "demos/b.py", "tests_d.py"]


@pytest.mark.parametrize(("source", "bound"), [
    ("a = b", "a"),
    ("a, (b, *c) = d = e", "a b c d"),
    ("a += 1", "a"),
    ("if (a := 1): pass", "a"),
    ("for a, b in c: pass", "a b"),
    ("with a as b, c as (d, e): pass", "b d e"),
    ("[a for b in c for d in e]", "b d"),
    ("def f(a, /, b, *c, d=e, **g): return h", "f a b c d g"),
    ("async def f(): pass", "f"),
    ("lambda a: b", "a"),
    ("class A(B):\n    c: int\n    d: int = 0", "A c d"),
    ("self.a = self.b.c = other.d = 1", "a"),
    ("a[b] = 1; del c; d.e()", ""),
    ("import a, b as c\nfrom d import e, f as g", "c g"),
    ("try: pass\nexcept A as b: pass\nexcept C: pass", "b"),
    ("match a:\n    case B(c=d) | [e, *_] as f: pass", "d e f"),
    ("_found = __found__ = found_in = 1", "found found found_in"),
])  # fmt: skip
def test_which_names_a_source_binds(source, bound):
    assert sorted(names.bound_names(ast.parse(source))) == sorted(bound.split())


def test_vague_names_are_counted_wherever_they_are_bound():
    sources = {"a.py": "found = 1\nfound = 2\nx = found + kept", "b.py": "def f(told, asked): pass"}
    assert names.count_names(sources) == (4, 6)
    assert names.count_names(sources, names.REFUSED) == (3, 6)
    assert names.count_names({}) == (0, 0)


def test_classes_that_share_a_name():
    nested, flat = "class A:\n    class B: pass\nclass C: pass", "class A: pass\nclass B: pass\nclass B: pass"
    assert list(names.repeated_classes({"a.py": nested, "b.py": flat}).items()) == [("B", 3), ("A", 2)]


def test_dataclasses_by_any_way_to_write_them():
    decorators = ["@dataclass\n", "@dataclasses.dataclass(frozen=True)\n", "@other.of(dataclass)\n", ""]
    assert names.count_dataclasses({"a.py": "\n".join(f"{line}class A: pass" for line in decorators)}) == 2


LIBRARY = {
    "trunkline/__init__.py": "",
    "trunkline/ground.py": "from os import path",
    "trunkline/a/__init__.py": "",
    "trunkline/a/x.py": "from . import y\nfrom ..b import z",
    "trunkline/a/y.py": "import trunkline.b.z, numpy",
    "trunkline/b/__init__.py": "",
    "trunkline/b/z.py": "def f():\n    from trunkline.c import name",
    "trunkline/c/__init__.py": "from trunkline import ground\nname = 1",
    "trunkline/d/__init__.py": "import trunkline.ground as g",
    "trunkline/e/__init__.py": "",
}


def test_arrows_lead_from_package_to_package_once():
    graph = imports.package_graph(LIBRARY)
    assert sorted(graph.edges) == [("a", "b"), ("b", "c"), ("c", imports.GROUND), ("d", imports.GROUND)]
    assert sorted(graph) == [imports.GROUND, "a", "b", "c", "d", "e"]


def test_floors_are_the_packages_on_the_longest_way():
    assert imports.floors(imports.package_graph(LIBRARY)) == 4  # a, b, c, the ground
    assert imports.circles(imports.package_graph(LIBRARY)) == []


def test_a_circle_is_of_packages_that_reach_each_other_and_is_one_floor():
    graph = imports.package_graph(LIBRARY | {"trunkline/c/w.py": "if TYPE_CHECKING:\n    from trunkline.a.x import X"})
    assert imports.circles(graph) == [["a", "b", "c"]]
    assert imports.floors(graph) == 2  # the circle, the ground
    assert imports.floors(imports.package_graph({})) == 0


@pytest.mark.parametrize(("name", "place"), [
    ("trunkline.a.x", ("trunkline/a/x.py", "")),
    ("trunkline.a.x.C.d", ("trunkline/a/x.py", "C.d")),
    ("trunkline.c.name", ("trunkline/c/__init__.py", "name")),
    ("trunkline.f", ("trunkline/__init__.py", "f")),
    ("numpy.linalg", None),
])  # fmt: skip
def test_where_a_full_name_is_defined(name, place):
    assert imports.locate(name, LIBRARY) == place


def test_lines_of_functions_from_def_to_end():
    nested = "@wraps\ndef f():\n    def g():\n        return 1\n\n    return g\n"
    method = "class A:\n    async def h(self): pass"
    assert sizes.function_lengths({"a.py": f"{nested}\n{method}\n"}) == [(1, "a.py:h"), (2, "a.py:g"), (5, "a.py:f")]


@pytest.mark.parametrize(("share", "length"), [(0.5, 5), (0.9, 9), (0.91, 10), (1, 10), (0, 1)])
def test_a_quantile_is_a_length_that_this_share_does_not_exceed(share, length):
    assert sizes.quantile([(lines, "") for lines in range(1, 11)], share) == length
    assert sizes.quantile([], share) == 0


def test_lines_of_files():
    sources = {"a.py": "x\n\ny\n", "b.py": "x\ny\nz\nw", "c.py": ""}
    assert sizes.count_lines(sources) == 7
    assert sizes.longest_file(sources) == (4, "b.py")


@pytest.mark.parametrize(("line", "count", "with_unit"), [
    ("A = 1.5  # m, of the arm", 1, 1),
    ("A = -2e3  # s", 1, 1),
    ("A: float = 2 * 60  # s that it may take", 1, 1),
    ("A = (0.1, 0.2)  # m/s², both", 1, 1),
    ("ÄÄÄÄÄ = 1  # N m/rad: of the joint", 1, 1),
    ("A = 1  # 1/s", 1, 1),
    ("A = (\n    1,  # m\n)", 1, 0),
    ("A = (1,\n     2)  # m", 1, 1),
    ("A = 3  # messages", 1, 0),
    ("A = 3  # many of them", 1, 0),
    ("A = 3", 1, 0),
    ("A = True  # m", 0, 0),
    ("A = 'text'  # m", 0, 0),
    ("A = B * 2  # m", 0, 0),
    ("A: int  # m", 0, 0),
    ("def f():\n    A = 1  # m", 0, 0),
])  # fmt: skip
def test_constants_have_their_unit_in_the_comment_behind(line, count, with_unit):
    assert sizes.count_constants({"a.py": line}) == (count, with_unit)


PROJECT = {
    "a.py": """
import numpy as np
import p.d as d
from b import B, helper as aid
from p import handed

def start(numbers):
    d.end(aid(1))
    numbers.append(B())
    local()
    handed()
    numbers.only()
    np.only(numbers)
    numbers.both()
    [later() for later in numbers]
    aid(2)

def local():
    def inner():
        aid(3)
        d.last()

def chain(): B().only(aid(1))
""",
    "b.py": """
def helper(x): return x

class B:
    def __init__(self):
        self.only()
        B.make()
    def only(self): start()
    def both(self): pass
    @classmethod
    def make(cls): return cls.both()
    def append(self): pass
""",
    "p/__init__.py": "from .d import handed\nfrom missing import start",
    "p/d.py": """
import a

def end(x): a.start()

def last(): pass

def handed(): last()

class D:
    def both(self): pass
""",
}


@pytest.mark.parametrize(("place", "calls"), [
    (("a.py", "start"), ["p/d.py end", "b.py helper", "b.py B.__init__", "a.py local", "p/d.py handed", "b.py B.only",
                         "b.py helper"]),
    (("a.py", "local"), ["b.py helper", "p/d.py last"]),
    (("a.py", "chain"), ["b.py B.__init__", "b.py B.only", "b.py helper"]),
    (("b.py", "B.__init__"), ["b.py B.only", "b.py B.make"]),
    (("b.py", "B.only"), []),
    (("b.py", "B.make"), ["b.py B.both"]),
    (("p/d.py", "end"), ["a.py start"]),
])  # fmt: skip
def test_calls_are_resolved_in_the_order_of_the_source(place, calls):
    assert [" ".join(target) for target in Index.of(PROJECT).calls(place)] == calls


TRIP = {
    "a.py": """
from b import first, line, second
def start():
    first()
    first()
    line()
    second()
    end()
def end():
    x = 1
    return x
""",
    "b.py": """
from a import end
def first():
    x = 1
    return x
def line():
    "One statement."
    return 1
def second():
    x = end()
    return x
""",
}


def test_a_reader_goes_back_for_what_is_longer_than_a_line_and_not_read():
    trail = walk(Index.of(TRIP), ("a.py", "start"))
    assert trail == ["a.py", "b.py", "b.py", "a.py"]  # first, second, and end of it
    assert going_back(trail) == (2, 2)


def test_a_method_is_of_a_class_that_the_file_knows():
    sources = {"a.py": "def start(plot): plot.word()", "b.py": "class B:\n    def word(self): return str()"}
    assert Index.of(sources).calls(("a.py", "start")) == []
    imported = sources | {"a.py": "from b import B\n" + sources["a.py"]}
    assert Index.of(imported).calls(("a.py", "start")) == [("b.py", "B.word")]


@pytest.mark.parametrize(("trail", "counts"), [("a", (1, 0)), ("a b", (2, 0)), ("a b a", (2, 1)), ("a b b", (2, 1))])
def test_going_back_is_to_a_file_that_was_opened_before(trail, counts):
    assert going_back(trail.split()) == counts


ENDS = "import numpy as np\nimport b\nfrom c import C\n"
READ = "def read(x): return x\n"
OBJECT = "from b import read\nclass C:\n    def __init__(self, x): read(x)\n    def use(self): return read(self)\n"


@pytest.mark.parametrize(("start", "stays"), [
    ("b.read(x)", "a b"),
    ("b.read(x.loss)", "a b"),
    ("b.read([y for y in x])", "a b"),
    ("b.read(sorted(x))", "a b"),
    ("b.read(y=1, x=x)", "a b"),
    ("y, z = x, 1\n    b.read(z)\n    b.read(y)", "a b"),
    ("for y in x:\n        b.read(y)", "a b"),
    ("with x as y:\n        b.read(y)", "a b"),
    ("if (y := x):\n        b.read(y)", "a b"),
    ("try:\n        pass\n    except ValueError:\n        b.read(x)", "a b"),
    ("C(b.read(x))", "a b c"),
    ("y = C(x)\n    y.use()", "a c b"),
    ("y = b.read(x)\n    C(y)", "a b c"),
    ("y = start(x)\n    b.read(x)", "a b"),
    ("b.read(1)", "a"),
    ("b.read(np.array(x))", "a"),
    ("b.read(x > 1)", "a"),
    ("b.read(f'{x}')", "a"),
    ("b.read(Bounds(x))", "a"),
    ("y = 1\n    b.read(y)", "a"),
])  # fmt: skip
def test_a_parameter_is_followed_to_where_it_ends(start, stays):
    sources = {"a.py": f"{ENDS}def start(x):\n    {start}\n", "b.py": READ, "c.py": OBJECT}
    trip = Trip(Index.of(sources))
    trip.enter(("a.py", "start"), {"x"})
    assert " ".join(file.removesuffix(".py") for file in trip.files) == stays


def test_what_is_put_into_an_object_is_followed_no_further():
    sources = {"a.py": "import b\nfrom c import C\ndef start(x): return b.read(C(x))", "b.py": READ, "c.py": OBJECT}
    assert follow(Index.of(sources), ("a.py", "start"), "x") == (3, 0), "read by C.__init__, and not in `start`"
    sources["c.py"] = "class C:\n    def __init__(self, x): pass\n"
    assert follow(Index.of(sources), ("a.py", "start"), "x") == (2, 0)


@pytest.mark.parametrize(("passed", "counts"), [
    ("b.read(x)", (2, 0)),
    ("b.read(x)\n    b.read(x)", (2, 0)),
    ("b.read(x)\n    b.more(x)", (2, 0)),
    ("b.read(x)\n    near(x)", (2, 1)),
    ("b.read(x)\n    near(x)\n    b.more(x)", (2, 2)),
])  # fmt: skip
def test_a_return_is_a_stay_in_a_file_that_the_trip_had_left(passed, counts):
    sources = {
        "a.py": f"import b\ndef start(x):\n    {passed}\ndef near(x): pass\n",
        "b.py": READ + "def more(x): pass\n",
    }
    assert follow(Index.of(sources), ("a.py", "start"), "x") == counts


SOURCES = {
    "README.md": "# A\n\ntext\n",
    "docs/a.md": "1\n2\n",
    "docs/results/b.md": "1\n",
    "docs/c.py": "x = 1\n",
    "trunkline/__init__.py": "",
    "trunkline/a/__init__.py": "from trunkline.b import c\n",
    "trunkline/b/__init__.py": "found = 1  # m\n",
    "trunkline/b/deep/__init__.py": "import trunkline.a\n",
    "trunkline/pipeline/identify.py": "def run():\n    pass\n\n\ndef f(): pass\n",
    "stages/a.py": "class A: pass\n",
    "rehearsal/a.py": "class A: pass\n",
    "tests/a.py": "told = 1\nclass A: pass\n",
}


def test_every_row_of_the_table():
    assert house.measure(SOURCES) == {
        "packages directly in trunkline/ (all below it)": "2 (3)",
        "files of trunkline/ itself": "1",
        "import arrows between packages": "2",
        "floors": "1",
        "circles of packages": "1; a, b",
        "library": "5 files, 8 lines",
        "stages, demo, examples, rehearsal": "2 files, 2 lines",
        "studies, benchmarks, qualification": "0 files, 0 lines",
        "upkeep": "0 files, 0 lines",
        "tests": "1 files, 2 lines",
        "docs": "2 files, 3 lines",
        "README.md": "3 lines",
        "function's lines: median, 90th percentile": "1, 2",
        "longest function": "2 (trunkline/pipeline/identify.py:run)",
        "longest file": "5 (trunkline/pipeline/identify.py)",
        "vague names per 1,000 bound": "166.7 (1 of 6)",
        "class names defined more than once": "1 (A ×2)",
        "dataclasses": "0",
        "numeric constants of modules (with unit)": "2 (1)",
        "from trunkline/pipeline/identify.py:run, every call: files entered, times back": "1, 0",
        "from trunkline/pipeline/identify.py:run, one parameter: files entered, times back": "–",
    }


def test_a_function_that_is_not_there_has_no_trip():
    assert list(house.trip({}, "a.py:f").values()) == ["–", "–"]


def test_the_trip_of_the_parameter_that_returns_most_is_shown():
    sources = {
        "a.py": "import b\ndef start(x, y):\n    b.read(x)\n    near(x)\n    b.read(y)\ndef near(x): pass\n",
        "b.py": READ,
    }
    assert list(house.trip(sources, "a.py:start").values())[1] == "2, 1 (x)"


def test_the_command_prints_both_revisions(checkout, capsys):
    assert house.main([str(checkout), "--against", "first", "--start", "new.py:f"]) == 0
    rows = capsys.readouterr().out.splitlines()
    assert rows[:2] == ["| measure | first | now |", "| --- | --- | --- |"]
    assert "| stages, demo, examples, rehearsal | 1 files, 1 lines | 1 files, 1 lines |" in rows
    assert "| from new.py:f, every call: files entered, times back | – | – |" in rows
    assert "| README.md | 0 lines | 1 lines |" in rows
    assert house.main([str(checkout)]) == 0
    assert capsys.readouterr().out.startswith("| measure | now |\n")


def test_a_folder_without_a_repository_is_named(tmp_path, capsys, monkeypatch):
    monkeypatch.setenv("GIT_CEILING_DIRECTORIES", str(tmp_path.parent))
    assert house.main([str(tmp_path)]) == 1
    assert f"error: git ls-files in {tmp_path}: fatal: not a git repository" in capsys.readouterr().err
