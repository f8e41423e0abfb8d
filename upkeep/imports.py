"""Resolve imports to files, and measure the graph of packages: arrows, floors, circles.

An import counts wherever it stands in a file: within a function and for types alone too. The packages are the folders
directly in trunkline/; the files of trunkline/ itself are one package, the ground.
"""

import ast
from collections.abc import Callable

import networkx as nx

from upkeep.sources import Sources, parse

GROUND = "(ground)"


def imported_names(path: str, tree: ast.AST) -> dict[str, list[str]]:
    """Each name that the imports of a file bind, to the full names that it may stand for: `{"np": ["numpy"]}`.

    `import a.b` binds `a`, and is listed as `a.b`.
    """
    names: dict[str, list[str]] = {}
    for node in ast.walk(tree):
        if isinstance(node, ast.Import):
            for alias in node.names:
                names.setdefault(alias.asname or alias.name, []).append(alias.name)
        elif isinstance(node, ast.ImportFrom):
            package = path.split("/")[: -node.level] if node.level else []
            source = ".".join([*package, *([node.module] if node.module else [])])
            for alias in node.names:
                names.setdefault(alias.asname or alias.name, []).append(f"{source}.{alias.name}")
    return names


def locate(name: str, sources: Sources) -> tuple[str, str] | None:
    """The file of a full name, and the rest of the name within it: `a.b.C.d` may be `a/b.py` and `C.d`."""
    parts = name.split(".")
    for length in range(len(parts), 0, -1):
        stem = "/".join(parts[:length])
        for path in (f"{stem}.py", f"{stem}/__init__.py"):
            if path in sources:
                return path, ".".join(parts[length:])
    return None


def package_of(path: str) -> str:
    """The package of a file below trunkline/: its folder directly in there, or the ground."""
    parts = path.split("/")
    return parts[1] if len(parts) > 2 else GROUND


def folder_of(path: str) -> str:
    """The innermost folder of a file below trunkline/, from there, or the ground."""
    return "/".join(path.split("/")[1:-1]) or GROUND


def package_graph(library: Sources, place: Callable[[str], str] = package_of) -> nx.DiGraph:
    """Packages, or whatever else is the `place` of a file, with an arrow from each to every other that a file of it
    imports."""
    graph = nx.DiGraph()
    graph.add_nodes_from(map(place, library))
    for path, text in library.items():
        for names in imported_names(path, parse(text)).values():
            files = [located[0] for name in names if (located := locate(name, library))]
            graph.add_edges_from((place(path), place(file)) for file in files)
    graph.remove_edges_from(list(nx.selfloop_edges(graph)))
    return graph


def circles(graph: nx.DiGraph) -> list[list[str]]:
    """Sets of packages that import each other, directly or by way of others."""
    return sorted(sorted(nodes) for nodes in nx.strongly_connected_components(graph) if len(nodes) > 1)


def floors(graph: nx.DiGraph) -> int:
    """Packages on the longest way along the arrows, where a circle counts as one package."""
    return len(nx.dag_longest_path(nx.condensation(graph)))
