"""The rooms of trunkline/ in the order of the data: an earlier room never imports a later one."""

import ast
import re
from pathlib import Path

import pytest

ROOT = Path(__file__).parents[1]

# In the order in which data flow, as CONTRIBUTING.md lists them; files of trunkline/ itself come before all of them.
TABLE = (ROOT / "CONTRIBUTING.md").read_text(encoding="utf-8").partition("<!-- rooms -->")[2]
ROOMS = re.findall(r"^\| `(\w+)` \|", TABLE.partition("<!-- /rooms -->")[0], re.MULTILINE)
OUTSIDE = ("stages", "demo", "studies", "benchmarks", "examples", "tests")


def _rooms_imported(file: Path) -> set[str]:
    """Rooms that a file imports anywhere in it."""
    found = set()
    for node in ast.walk(ast.parse(file.read_text(encoding="utf-8"))):
        modules = [node.module or ""] if isinstance(node, ast.ImportFrom) else []
        modules += [alias.name for alias in node.names] if isinstance(node, ast.Import) else []
        if isinstance(node, ast.ImportFrom) and node.module == "trunkline":
            modules = [f"trunkline.{alias.name}" for alias in node.names]
        found |= {module.split(".")[1] for module in modules if module.startswith("trunkline.")}
        found |= {module.split(".")[0] for module in modules if module.split(".")[0] in OUTSIDE}
    return found


def test_every_room_has_its_place():
    folders = {path.parent.name for path in (ROOT / "trunkline").glob("*/__init__.py")}
    assert sorted(folders) == sorted(ROOMS)


@pytest.mark.parametrize("room", ROOMS)
def test_an_earlier_room_never_imports_a_later_one(room):
    allowed = {*ROOMS[: ROOMS.index(room) + 1], *(file.stem for file in (ROOT / "trunkline").glob("*.py"))}
    for file in (ROOT / "trunkline" / room).rglob("*.py"):
        assert _rooms_imported(file) <= allowed, file


def test_what_stands_before_all_rooms_imports_none():
    for file in (ROOT / "trunkline").glob("*.py"):
        assert not _rooms_imported(file) & {*ROOMS, *OUTSIDE}, file


def test_nothing_imports_a_stage():
    for folder in ("trunkline", "demo", "examples"):
        for file in (ROOT / folder).rglob("*.py"):
            assert "stages" not in _rooms_imported(file), file
