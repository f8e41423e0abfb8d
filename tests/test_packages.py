"""The packages of trunkline/ in the order of the data: an earlier one never imports a later one, and within a package
its folders import each other one way."""

import re
from pathlib import Path

import pytest

from upkeep.imports import circles, folder_of, imported_names, package_graph
from upkeep.sources import parse, python_in, read_checkout

ROOT = Path(__file__).parents[1]

# In the order in which data flow, as CONTRIBUTING.md lists them; files of trunkline/ itself come before all of them.
TABLE = (ROOT / "CONTRIBUTING.md").read_text(encoding="utf-8").partition("<!-- packages -->")[2]
PACKAGES = re.findall(r"^\| `(\w+)` \|", TABLE.partition("<!-- /packages -->")[0], re.MULTILINE)
GROUND = {file.stem for file in (ROOT / "trunkline").glob("*.py")}
OUTSIDE = {"stages", "demo", "studies", "benchmarks", "qualification", "examples", "rehearsal", "upkeep", "tests"}
TOP = {"trunkline", *OUTSIDE}


def _packages_imported(file: Path) -> set[str]:
    """Packages of trunkline/, files of it and folders beside it that a file imports."""
    names = imported_names(file.relative_to(ROOT).as_posix(), parse(file.read_text(encoding="utf-8")))
    modules = [module.split(".") for bound in names.values() for module in bound]
    return {parts[1] if parts[0] == "trunkline" else parts[0] for parts in modules if parts[0] in TOP}


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
    assert circles(package_graph(python_in(read_checkout(ROOT), "trunkline"), folder_of)) == []


def test_nothing_imports_a_stage():
    for folder in ("trunkline", "demo", "examples"):
        for file in (ROOT / folder).rglob("*.py"):
            assert "stages" not in _packages_imported(file), file
