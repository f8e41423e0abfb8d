"""Modules of studies, benchmarks and qualification that code and docs name exist, unless they are archived."""

import re
from pathlib import Path

import pytest

from upkeep.sources import read_checkout

ROOT = Path(__file__).parents[2]
NAMED = re.compile(r"(?<!\(as `)\b(studies|benchmarks|qualification)\.([a-z]\w*)")  # "(as `...`": its name in a result
TAG = re.compile(r"\bresults-\d")


def missing(text: str, modules: set[str]) -> list[str]:
    """Names of modules in `text` that are none of `modules`, and beside which, or on the next line, is no tag."""
    lines = text.splitlines()
    named = [(name[0], " ".join(lines[i : i + 2])) for i, line in enumerate(lines) for name in NAMED.finditer(line)]
    return [name for name, beside in named if name not in modules and not TAG.search(beside)]


@pytest.mark.parametrize(
    ("text", "expected"),
    [("see `python -m studies.there`", []), ("see `studies.gone`", ["studies.gone"]),
     ("`python -m studies.gone`\n(commit 1234567; archived (results-1): …", []),
     ("`studies.gone`, tag results-1", []), ("`studies.gone`\n\nresults-1", ["studies.gone"]),
     ("`python -m studies.there`\n(as `benchmarks.gone`, commit 1234567)", []),
     ("trunkline.studies and case studies. They", [])],
)  # fmt: skip
def test_a_module_that_is_gone_is_missing_unless_a_tag_is_beside_it(text, expected):
    assert missing(text, {"studies.there"}) == expected


def test_modules_that_code_and_docs_name_exist():
    sources = read_checkout(ROOT)
    folders = ("studies", "benchmarks", "qualification")
    paths = [path for folder in folders for path in (ROOT / folder).iterdir() if path.suffix == ".py" or path.is_dir()]
    modules = {f"{path.parent.name}.{path.stem}" for path in paths}
    texts = {path: text for path, text in sources.items() if not path.startswith("tests/")}
    settings = [path for folder in ("conf", "studies", "rehearsal", "demo") for path in (ROOT / folder).rglob("*.yaml")]
    texts |= {str(path.relative_to(ROOT)): path.read_text(encoding="utf-8") for path in settings}
    assert {path: names for path, text in texts.items() if (names := missing(text, modules))} == {}
