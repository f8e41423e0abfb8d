"""`python -m upkeep.house [FOLDER]`: measure the code of a checkout, as a Markdown table.

Numbers of code are of all Python files but tests; packages and their imports are those of trunkline/.
"""

import argparse
import sys
from pathlib import Path

from trunkline.errors import in_one_line
from upkeep import imports, names, sizes
from upkeep.follow import follow, parameters_of
from upkeep.sources import Sources, code_in, python_in, read_checkout, read_revision
from upkeep.walk import Index, going_back, walk

KINDS = {
    "library": ("trunkline",),
    "stages, demo, examples, rehearsal": ("stages", "demo", "examples", "rehearsal"),
    "studies, benchmarks, qualification": ("studies", "benchmarks", "qualification"),
    "upkeep": ("upkeep",),
    "tests": ("tests",),
}
START = "trunkline/pipeline/identify.py:run"


def measure(sources: Sources, start: str = START) -> dict[str, str]:
    """Every row of the table: what is measured, and its value."""
    code = code_in(sources)
    return packages(python_in(sources, "trunkline")) | lines(sources) | code_rows(code) | trip(code, start)


def packages(library: Sources) -> dict[str, str]:
    """Packages of the library and the graph of their imports."""
    graph = imports.package_graph(library)
    folders = [path.removesuffix("/__init__.py") for path in library if path.endswith("/__init__.py")]
    direct = [folder for folder in folders if folder.count("/") == 1]
    circles = imports.circles(graph)
    return {
        "packages directly in trunkline/ (all below it)": f"{len(direct)} ({len(set(folders) - {'trunkline'})})",
        "files of trunkline/ itself": str(sum(path.count("/") == 1 for path in library)),
        "import arrows between packages": str(graph.number_of_edges()),
        "floors": str(imports.floors(graph)),
        "circles of packages": "; ".join([str(len(circles)), *map(", ".join, circles)]),
    }


def lines(sources: Sources) -> dict[str, str]:
    """Files and lines of each kind."""
    kinds = {kind: python_in(sources, *folders) for kind, folders in KINDS.items()}
    kinds["docs"] = {path: text for path, text in sources.items() if path.startswith("docs/") and path.endswith(".md")}
    counts = {kind: f"{len(files)} files, {sizes.count_lines(files):,} lines" for kind, files in kinds.items()}
    return counts | {"README.md": f"{len(sources.get('README.md', '').splitlines())} lines"}


def code_rows(code: Sources) -> dict[str, str]:
    """Functions, files, names, classes and constants."""
    lengths = sizes.function_lengths(code)
    vague, bound = names.count_names(code)
    classes = names.repeated_classes(code)
    constants, with_unit = sizes.count_constants(code)
    return {
        "function's lines: median, 90th percentile": f"{sizes.quantile(lengths, 0.5)}, {sizes.quantile(lengths, 0.9)}",
        "longest function": "{} ({})".format(*lengths[-1]) if lengths else "0",
        "longest file": "{} ({})".format(*sizes.longest_file(code)),
        "vague names per 1,000 bound": f"{1000 * vague / max(bound, 1):.1f} ({vague:,} of {bound:,})",
        "class names defined more than once": f"{len(classes)} ({classes_line(classes)})",
        "dataclasses": str(names.count_dataclasses(code)),
        "numeric constants of modules (with unit)": f"{constants} ({with_unit})",
    }


def classes_line(classes: dict[str, int], most: int = 5) -> str:
    """The most frequent of them."""
    return ", ".join(f"{name} ×{count}" for name, count in list(classes.items())[:most]) or "none"


def trip(code: Sources, start: str) -> dict[str, str]:
    """Files that a reader of a function enters, and how often he goes back, if he follows every call, and if he follows
    the parameter of it that returns most; a dash where there is no such function."""
    index, (path, _, name) = Index.of(code), start.partition(":")
    every, parameter = (f"from {start}, {what}: files entered, times back" for what in ("every call", "one parameter"))
    if (path, name) not in index.functions:
        return {every: "–", parameter: "–"}
    trips = {each: follow(index, (path, name), each) for each in parameters_of(index.functions[path, name])}
    longest = max(trips.items(), key=lambda item: item[1][1], default=None)
    followed = "{1}, {2} ({0})".format(longest[0], *longest[1]) if longest else "–"
    return {every: "{}, {}".format(*going_back(walk(index, (path, name)))), parameter: followed}


def table(columns: dict[str, dict[str, str]]) -> str:
    """Markdown, a column for each revision."""
    header = [["measure", *columns], ["---"] * (len(columns) + 1)]
    rows = [[row, *(column[row] for column in columns.values())] for row in next(iter(columns.values()))]
    return "\n".join(f"| {' | '.join(cells)} |" for cells in header + rows)


@in_one_line
def main(arguments: list[str] | None = None) -> int:
    parser = argparse.ArgumentParser(prog="python -m upkeep.house", description=__doc__)
    parser.add_argument("folder", nargs="?", type=Path, default=Path("."), help="top of a checkout")
    parser.add_argument("--against", metavar="REVISION", help="a revision of it to show beside")
    parser.add_argument("--start", default=START, metavar="FILE:NAME", help="where the trip of a reader starts")
    args = parser.parse_args(arguments)
    columns = {args.against: read_revision(args.folder, args.against)} if args.against else {}
    columns["now"] = read_checkout(args.folder)
    print(table({name: measure(sources, args.start) for name, sources in columns.items()}))
    return 0


if __name__ == "__main__":
    sys.exit(main())
