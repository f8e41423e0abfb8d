"""Follow the calls of a function as a reader would, and count the files entered and how often the reader goes back.

The walk takes the calls of a function in the order in which they stand in the source, and enters each function of the
project at its first call, before the calls that come after: depth first, each function once. A call is resolved without
running anything: names by the imports of the file or its definitions, also where a package's `__init__` hands them on;
`self.method` by the class around; a class by its `__init__` or `__post_init__`; any other method by its name, where one
method alone of the project has that name, the file has or imports its class, no built-in type has it, and it is no
library's. What is called otherwise is not followed, nor are functions that are only handed on. The body of a nested
function belongs to the function around it.

The walk goes back when a call leads to another file in which it has been before, for a function that it has not read.
At the end of a call the reader is where he was, which is no going back. A helper of another file whose body is a single
statement is not entered.
"""

import ast
from collections import defaultdict
from collections.abc import Iterator
from dataclasses import dataclass

from upkeep.imports import imported_names, locate
from upkeep.names import Function
from upkeep.sources import Sources, parse

BUILT_IN = {name for kind in (str, bytes, list, dict, set, tuple, int, float) for name in dir(kind)}
Place = tuple[str, str]  # file, and name in it: "f", "Class.method"


@dataclass(frozen=True)
class Index:
    """Functions and methods of the project, and by file what its imports name."""

    sources: Sources
    functions: dict[Place, ast.AST]
    imports: dict[str, dict[str, list[str]]]
    methods: dict[str, list[Place]]  # by name

    @classmethod
    def of(cls, sources: Sources) -> "Index":
        functions = {(path, name): node for path, text in sources.items() for name, node in _definitions(parse(text))}
        methods = defaultdict(list)
        for path, name in functions:
            if "." in name:
                methods[name.partition(".")[2]].append((path, name))
        imports = {path: imported_names(path, parse(text)) for path, text in sources.items()}
        return cls(sources, functions, imports, methods)

    def calls(self, place: Place) -> list[Place]:
        """What a function calls, in the order of the source; what cannot be resolved is left out."""
        calls = [node.func for node in ast.walk(self.functions[place]) if isinstance(node, ast.Call)]
        calls.sort(key=lambda function: (function.end_lineno, function.end_col_offset))
        return [target for function in calls if (target := self.resolve(place, function))]

    def resolve(self, place: Place, function: ast.expr) -> Place | None:
        """The function of the project that is called in `place`."""
        path, around = place[0], place[1].partition(".")[0]
        head, _, rest = ast.unparse(function).partition(".")
        if head in ("self", "cls") and (path, f"{around}.{rest}") in self.functions:
            return path, f"{around}.{rest}"
        target = self.named(path, head, rest)
        if target or not isinstance(function, ast.Attribute) or function.attr in BUILT_IN or self.foreign(path, head):
            return target
        candidates = self.methods.get(function.attr, [])
        return candidates[0] if len(candidates) == 1 and self.named_in(path, candidates[0]) else None

    def named_in(self, path: str, method: Place) -> bool:
        """Whether the class of a method stands in a file: `plot.text` is of no class that the file does not know."""
        return method[0] == path or method[1].partition(".")[0] in self.imports[path]

    def foreign(self, path: str, head: str) -> bool:
        """Whether a file imports this name from elsewhere than the project: `np`."""
        names = [full for alias, names in self.imports[path].items() if alias.split(".")[0] == head for full in names]
        return bool(names) and not any(locate(name, self.sources) for name in names)

    def named(self, path: str, head: str, rest: str) -> Place | None:
        """The function that a name stands for in a file, by its definitions and then by its imports."""
        name = f"{head}.{rest}" if rest else head
        for form in (name, f"{name}.__init__", f"{name}.__post_init__"):
            if (path, form) in self.functions:
                return path, form
        for alias, sources in self.imports[path].items():
            if name == alias or name.startswith(f"{alias}."):
                for source in sources:
                    file, inner = locate(source + name.removeprefix(alias), self.sources) or (path, "")
                    if target := self.named(file, *inner.partition(".")[::2]):
                        return target
        return None


def _definitions(tree: ast.Module) -> Iterator[tuple[str, ast.AST]]:
    """Functions of a module and methods of its classes, not those within others."""
    for node in tree.body:
        if isinstance(node, Function):
            yield node.name, node
        elif isinstance(node, ast.ClassDef):
            yield from ((f"{node.name}.{item.name}", item) for item in node.body if isinstance(item, Function))


def walk(index: Index, start: Place) -> list[str]:
    """The files in the order in which a reader opens them, one entry for each call that leads into another file."""
    opened = [start[0]]
    entered: set[Place] = set()

    def enter(place: Place) -> None:
        entered.add(place)
        for target in index.calls(place):
            beside = target[0] == place[0]
            if target not in entered and (beside or not is_helper(index.functions[target])):
                if not beside:
                    opened.append(target[0])
                enter(target)

    enter(start)
    return opened


def is_helper(function: ast.AST) -> bool:
    """Whether the body is one statement, beside a docstring: its name says enough."""
    statements = [node for node in ast.walk(function) if isinstance(node, ast.stmt)][1:]
    return sum(not (isinstance(node, ast.Expr) and isinstance(node.value, ast.Constant)) for node in statements) <= 1


def going_back(opened: list[str]) -> tuple[int, int]:
    """How many files are opened, and how often one that was opened before."""
    return len(set(opened)), len(opened) - len(set(opened))
