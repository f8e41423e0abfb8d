"""No vague words as names, and one class to a name: tests/names.yaml lists what is left, and can only be lowered.

`python -m tests.test_names` lowers it after a clean-up, and moves numbers along where files moved. It goes away when
all numbers are 0.
"""

import sys
from collections import Counter
from pathlib import Path

import pytest
import yaml

from upkeep.names import REFUSED, bound_names, count_names, repeated_classes, script_names
from upkeep.sources import Sources, code_in, parse, python_in, read_checkout

ROOT = Path(__file__).parents[1]
FILE = ROOT / "tests/names.yaml"
HEADER = f"""\
# Only lowered, by `python -m tests.test_names`; tests/test_names.py compares. names: how often each folder, and each
# package of trunkline/, still binds one of {", ".join(REFUSED)}.
# classes: class names that trunkline/ defines more than once, and how often.
"""
Counts = dict[str, int]


def folder_of(path: str) -> str:
    """The top folder; of the library the package: `trunkline/kinematics`."""
    parts = path.split("/")
    return "/".join(parts[:2]) if parts[0] == "trunkline" and len(parts) > 2 else parts[0]


def vague_names(sources: Sources) -> Counts:
    """How often each folder binds one of the refused words; folders without any are left out."""
    counts: Counter[str] = Counter()
    for path, text in sources.items():
        if path.endswith(".py"):
            counts[folder_of(path)] += sum(name in REFUSED for name in bound_names(parse(text)))
    return {folder: count for folder, count in sorted(counts.items()) if count}


def counted(sources: Sources) -> dict[str, Counts]:
    """What tests/names.yaml has to say."""
    classes = repeated_classes(python_in(sources, "trunkline"))
    return {"names": vague_names(sources), "classes": dict(sorted(classes.items()))}


def written() -> dict[str, Counts]:
    return yaml.safe_load(FILE.read_text(encoding="utf-8")) if FILE.exists() else {"names": {}, "classes": {}}


def differences(counts: Counts, limits: Counts) -> list[str]:
    """A line for each number that is higher than its limit, or lower."""
    pairs = {key: (counts.get(key, 0), limits.get(key, 0)) for key in sorted({*counts, *limits})}
    return [
        f"{key}: {count} where {FILE.name} allows {limit}, "
        + ("take a word of the field" if count > limit else "lower it by `python -m tests.test_names`")
        for key, (count, limit) in pairs.items()
        if count != limit
    ]


def higher_totals(counts: dict[str, Counts], limits: dict[str, Counts]) -> list[str]:
    """Sections whose sum has risen."""
    return [section for section in counts if sum(counts[section].values()) > sum(limits[section].values())]


@pytest.fixture(scope="module")
def sources():
    return read_checkout(ROOT)


def test_no_folder_binds_more_vague_names_than_listed_and_none_fewer(sources, capsys):
    vague, bound = count_names(code_in(sources), REFUSED)
    with capsys.disabled():
        print(f"\nvague names outside tests: {vague} of {bound:,} bound names, {1000 * vague / bound:.1f} in 1,000")
    lines = differences(vague_names(sources), written()["names"])
    assert not lines, "\n".join(lines)


def test_no_class_name_of_the_library_gets_a_further_meaning(sources):
    lines = differences(counted(sources)["classes"], written()["classes"])
    assert not lines, "\n".join(lines)


def test_scripts_of_the_page_have_no_vague_names():
    paths = [path for folder in ("src", "test", "bench") for path in (ROOT / "client" / folder).rglob("*.*js")]
    names = {str(path): set(script_names(path.read_text(encoding="utf-8"))) & {*REFUSED} for path in paths}
    assert len(names) > 20
    assert not any(names.values()), {path: words for path, words in names.items() if words}


@pytest.mark.parametrize("script", [
    "const found = 1;", "for (const [one] of x) y;", "const { said } = x;", "const f = (told) => 1;", "this.held = 1;",
    "get known() {}", "({ given: 1 });", "f(...seen);", "const KEPT = 1;", 'f("a", own);', "`a`; told; `b`",
])  # fmt: skip
def test_a_vague_name_of_a_script_is_noticed(script):
    assert {*script_names(script)} & {*REFUSED}


@pytest.mark.parametrize("script", [
    'x === "held"', "x.said", "x?.told", "// one\n/* seen\nown */", "`known`", "f(/kept, seen/);", "foundIn = 1",
])  # fmt: skip
def test_strings_comments_and_keys_of_messages_are_no_names_of_a_script(script):
    assert not {*script_names(script)} & {*REFUSED}


def test_the_list_goes_when_it_is_empty():
    assert not FILE.exists() or any(written().values()), f"delete {FILE.name}"


def test_numbers_differ_by_rising_by_falling_and_by_a_new_folder():
    assert differences({"a": 2, "b": 1}, {"a": 2, "b": 1}) == []
    rise, fall, new = differences({"a": 3, "c": 1}, {"a": 2, "b": 1})
    assert rise == "a: 3 where names.yaml allows 2, take a word of the field"
    assert fall == "b: 0 where names.yaml allows 1, lower it by `python -m tests.test_names`"
    assert new == "c: 1 where names.yaml allows 0, take a word of the field"


def test_names_are_counted_by_folder_and_by_package_of_the_library():
    text = "found = one = 1\nfound_in = shown = 2"  # two of the four are refused
    paths = (
        "trunkline/a.py",
        "trunkline/kinematics/ik/a.py",
        "trunkline/kinematics/ik/deep/b.py",
        "new/a.py",
        "tests/a/b.py",
        "docs/a.md",
    )
    assert vague_names({path: text for path in paths} | {"demo/a.py": "length = 1"}) == {
        "new": 2, "tests": 2, "trunkline": 2, "trunkline/kinematics": 4,
    }  # fmt: skip


def test_classes_are_counted_in_the_library_alone():
    twice = {"trunkline/a.py": "class A: pass", "trunkline/b/c.py": "class A: pass\nclass B: pass"}
    assert counted(twice | {"demo/a.py": "class B: pass"})["classes"] == {"A": 2}


def test_the_list_is_not_written_where_a_total_rose():
    limits = {"names": {"a": 2, "b": 1}, "classes": {"A": 2}}
    assert higher_totals({"names": {"c": 3}, "classes": {"A": 2}}, limits) == []  # moved
    assert higher_totals({"names": {"c": 4}, "classes": {"B": 3}}, limits) == ["names", "classes"]


def main() -> int:
    counts, limits = counted(read_checkout(ROOT)), written()
    if higher := higher_totals(counts, limits):
        print(*(line for section in higher for line in differences(counts[section], limits[section])), sep="\n")
        return 1
    FILE.write_text(HEADER + yaml.safe_dump(counts, sort_keys=False), encoding="utf-8")
    return 0


if __name__ == "__main__":
    sys.exit(main())
