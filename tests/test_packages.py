"""The packages of trunkline/ in the order of the data: an earlier one never imports a later one, and within a package
its folders import each other one way."""

import ast
import re
from pathlib import Path

import networkx
import pytest

ROOT = Path(__file__).parents[1]

# In the order in which data flow, as CONTRIBUTING.md lists them; files of trunkline/ itself come before all of them.
TABLE = (ROOT / "CONTRIBUTING.md").read_text(encoding="utf-8").partition("<!-- packages -->")[2]
PACKAGES = re.findall(r"^\| `(\w+)` \|", TABLE.partition("<!-- /packages -->")[0], re.MULTILINE)
GROUND = {file.stem for file in (ROOT / "trunkline").glob("*.py")}
OUTSIDE = {"stages", "demo", "studies", "benchmarks", "qualification", "examples", "rehearsal", "upkeep", "tests"}


def _modules_imported(file: Path) -> set[str]:
    """Dotted names that a file imports anywhere in it, those of the tree alone."""
    imported = set()
    for node in ast.walk(ast.parse(file.read_text(encoding="utf-8"))):
        if isinstance(node, ast.ImportFrom) and node.module:
            imported |= {f"{node.module}.{alias.name}" for alias in node.names}
        elif isinstance(node, ast.Import):
            imported |= {alias.name for alias in node.names}
    return {name for name in imported if name.split(".")[0] in {"trunkline", *OUTSIDE}}


def _packages_imported(file: Path) -> set[str]:
    """Packages of trunkline/, files of it and folders beside it that a file imports."""
    names = [name.split(".") for name in _modules_imported(file)]
    return {parts[1] if parts[0] == "trunkline" else parts[0] for parts in names}


def _folder(module: str) -> str:
    """`a/b` of a module `trunkline.a.b.c`, or `a` of one without folders in between."""
    parts = module.split(".")[1:]
    while parts and not (ROOT / "trunkline" / "/".join(parts)).is_dir():
        parts.pop()
    return "/".join(parts)


def test_every_package_has_its_place():
    folders = {path.parent.name for path in (ROOT / "trunkline").glob("*/__init__.py")}
    assert sorted(folders) == sorted(PACKAGES)


@pytest.mark.parametrize("package", PACKAGES)
def test_an_earlier_package_never_imports_a_later_one(package):
    allowed = {*PACKAGES[: PACKAGES.index(package) + 1], *GROUND}
    for file in (ROOT / "trunkline" / package).rglob("*.py"):
        assert _packages_imported(file) <= allowed, file


def test_the_ground_imports_no_package():
    for file in (ROOT / "trunkline").glob("*.py"):
        assert not _packages_imported(file) & {*PACKAGES, *OUTSIDE}, file


def test_no_folders_import_each_other_in_a_circle():
    arrows = networkx.DiGraph()
    for file in (ROOT / "trunkline").rglob("*.py"):
        place = file.parent.relative_to(ROOT / "trunkline").as_posix()
        for module in _modules_imported(file):
            there = _folder(module) if module.startswith("trunkline.") else ""
            if place != "." and there and there != place:
                arrows.add_edge(place, there)
    assert [sorted(circle) for circle in networkx.strongly_connected_components(arrows) if len(circle) > 1] == []


def test_nothing_imports_a_stage():
    for folder in ("trunkline", "demo", "examples"):
        for file in (ROOT / folder).rglob("*.py"):
            assert "stages" not in _packages_imported(file), file
