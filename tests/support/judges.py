"""Which functions decide a verdict, by reading the code: for the test that asks each of them for a table.

A verdict is a truth value, or an array of them, or a count or share of them, that goes by one of `WORDS`. Who computes
one decides; who only passes it on does not.
"""

import ast
from collections.abc import Iterator
from dataclasses import dataclass
from pathlib import Path

WORDS = ("success", "clean", "agreed", "held", "reachable", "converged", "at_bound")
ROOMS = ("trunkline", "rehearsal", "demo", "stages")
CAUSES = "rehearsal.experiments."  # here a verdict is a cause in words, "" for success
LOGICAL = ("all", "any", "bool", "isfinite", "isnan", "isclose", "allclose", "array_equal", "logical_and",
           "logical_or", "logical_not", "isin")  # fmt: skip
CHOOSING = ("where", "flatnonzero", "nonzero")  # their first argument chooses among values
Function = ast.FunctionDef | ast.AsyncFunctionDef


@dataclass(frozen=True, order=True)
class Judge:
    """A function, `module:name` or `module:Class.name`, and the word of its verdict."""

    function: str
    word: str


@dataclass(frozen=True)
class Read:
    """A source file: `module`, its tree, and by the names of its imports what they name, `module:name`."""

    module: str
    tree: ast.Module
    imports: dict[str, str]


def read_folder(root: Path, rooms: tuple[str, ...] = ROOMS) -> list[tuple[str, ast.Module]]:
    """Modules in these folders below `root`, and their trees."""
    paths = [path for room in rooms for path in sorted((root / room).rglob("*.py"))]
    return [
        (".".join(path.relative_to(root).with_suffix("").parts), ast.parse(path.read_text("utf-8"))) for path in paths
    ]


def judges(modules: list[tuple[str, ast.Module]]) -> set[Judge]:
    """All that decide in these modules."""
    read = [Read(module, tree, _imports(tree)) for module, tree in modules]
    functions = {f"{source.module}:{name}": function for source in read for name, function in _functions(source.tree)}
    built: dict[str, list[list[str]]] = {}
    for name, fields in (pair for source in read for pair in _built(source.tree)):
        built.setdefault(name, []).append(fields)
    judges = set()
    for source in read:
        for name, function in [("<module>", source.tree), *_functions(source.tree)]:
            name_here = f"{source.module}:{name}"
            if (word := name.rpartition(".")[2].strip("_")) in WORDS and _computes(function):
                judges.add(Judge(name_here, word))
            for word, value in _bound(function, built):
                judges |= {Judge(decider, word) for decider in _deciders(value, name_here, source, functions)}
            if source.module.startswith(CAUSES) and _says_why(function):
                judges.add(Judge(name_here, "success"))
    return judges


def _imports(tree: ast.Module) -> dict[str, str]:
    froms = [node for node in ast.walk(tree) if isinstance(node, ast.ImportFrom) and node.module]
    return {alias.asname or alias.name: f"{node.module}:{alias.name}" for node in froms for alias in node.names}


def _functions(node: ast.AST, before: str = "") -> Iterator[tuple[str, Function]]:
    """All functions below, by their names with those of classes and functions around them."""
    for child in ast.iter_child_nodes(node):
        inner = before
        if isinstance(child, Function | ast.ClassDef):
            inner = f"{before}.{child.name}" if before else child.name
            if isinstance(child, Function):
                yield inner, child
        yield from _functions(child, inner)


def _within(function: ast.AST) -> Iterator[ast.AST]:
    """Nodes of a function without those of functions and classes in it."""
    for child in ast.iter_child_nodes(function):
        if not isinstance(child, Function | ast.ClassDef):
            yield child
            yield from _within(child)


def _built(tree: ast.Module) -> Iterator[tuple[str, list[str]]]:
    """Classes whose fields are given in order."""
    for node in ast.walk(tree):
        if isinstance(node, ast.ClassDef):
            yield node.name, [item.target.id for item in node.body
                              if isinstance(item, ast.AnnAssign) and isinstance(item.target, ast.Name)]  # fmt: skip


def _bound(function: ast.AST, built: dict[str, list[list[str]]]) -> Iterator[tuple[str, ast.expr]]:
    """Each of WORDS that is bound, and to what: as variable, attribute, item, argument or field."""
    for node in _within(function):
        pairs: list[tuple[str, ast.expr]] = []
        if isinstance(node, ast.Assign):
            pairs = [pair for target in node.targets for pair in _targets(target, node.value)]
        elif isinstance(node, ast.AnnAssign | ast.AugAssign | ast.NamedExpr) and node.value is not None:
            pairs = list(_targets(node.target, node.value))
        elif isinstance(node, ast.Call):
            pairs = [(keyword.arg, keyword.value) for keyword in node.keywords if keyword.arg]
            pairs += [
                pair for fields in built.get(_last(node.func), []) for pair in zip(fields, node.args, strict=False)
            ]
        elif isinstance(node, ast.Dict):
            keys = zip(node.keys, node.values, strict=True)
            pairs = [(str(key.value), value) for key, value in keys if isinstance(key, ast.Constant)]
        yield from (pair for pair in pairs if pair[0] in WORDS)


def _targets(target: ast.expr, value: ast.expr) -> Iterator[tuple[str, ast.expr]]:
    if isinstance(target, ast.Tuple | ast.List):
        several = value.elts if isinstance(value, ast.Tuple) and len(value.elts) == len(target.elts) else None
        for index, each in enumerate(target.elts):
            yield from _targets(each, several[index] if several else value)
    elif isinstance(target, ast.Subscript) and isinstance(target.slice, ast.Constant):
        yield str(target.slice.value), value
        yield from _targets(target.value, value)
    elif isinstance(target, ast.Subscript | ast.Starred):
        yield from _targets(target.value, value)
    elif isinstance(target, ast.Name | ast.Attribute):
        yield target.id if isinstance(target, ast.Name) else target.attr, value


def _deciders(value: ast.AST, qualified: str, read: Read, functions: dict[str, Function]) -> Iterator[str]:
    """Who computes a value: this function, where there is logic in it; else those that it calls or hands on."""
    aside = _aside(value)
    if any(map(_logical, _without(value, aside))):
        yield qualified
        return
    if isinstance(value, ast.Call):
        called = _called(value, read, functions)
        yield from called
        if called or _last(value.func)[:1].isupper():
            return
    elif isinstance(value, ast.Attribute | ast.Subscript | ast.Lambda):
        return
    for part in ast.iter_child_nodes(value):
        if id(part) not in aside and not isinstance(part, ast.comprehension):
            yield from _deciders(part, qualified, read, functions)


def _called(call: ast.Call, read: Read, functions: dict[str, Function]) -> set[str]:
    """Functions that are called, or handed on to what is: of this module or imported, and methods that decide."""
    names = [name.id for name in [call.func, *call.args] if isinstance(name, ast.Name)]
    deciders = {
        qualified for name in names for qualified in (read.imports.get(name, ""), f"{read.module}:{name}")
    } & set(functions)
    if isinstance(call.func, ast.Attribute) and not (
        isinstance(call.func.value, ast.Name) and call.func.value.id == "np"
    ):
        ending = f".{call.func.attr}"
        deciders |= {
            qualified
            for qualified, function in functions.items()
            if qualified.partition(":")[2].endswith(ending) and _computes(function)
        }
    return deciders


def _logical(node: ast.AST) -> bool:
    """Whether it is a truth value, or an array of them, that is computed."""
    return (
        isinstance(node, ast.Compare | ast.BoolOp)
        or (isinstance(node, ast.UnaryOp) and isinstance(node.op, ast.Not | ast.Invert))
        or (isinstance(node, ast.BinOp) and isinstance(node.op, ast.BitAnd | ast.BitOr | ast.BitXor))
        or (isinstance(node, ast.Call) and _last(node.func) in LOGICAL)
    )


def _aside(value: ast.AST) -> set[int]:
    """Parts of an expression that choose among values, and so are none of its own."""
    nodes = list(ast.walk(value))
    return {
        *(id(part) for node in nodes if isinstance(node, ast.comprehension) for part in node.ifs),
        *(id(node.test) for node in nodes if isinstance(node, ast.IfExp)),
        *(id(node.slice) for node in nodes if isinstance(node, ast.Subscript)),
        *(id(part) for node in nodes if isinstance(node, ast.Call) and _last(node.func) in CHOOSING
          for part in node.args[:1]),
    }  # fmt: skip


def _without(node: ast.AST, aside: set[int]) -> Iterator[ast.AST]:
    if id(node) not in aside:
        yield node
        for child in ast.iter_child_nodes(node):
            yield from _without(child, aside)


def _computes(function: ast.AST) -> bool:
    """Whether what a function returns has logic in it."""
    returned = [node.value for node in _within(function) if isinstance(node, ast.Return) and node.value is not None]
    return any(_logical(part) for value in returned for part in _without(value, _aside(value)))


def _says_why(function: ast.AST) -> bool:
    """Whether a function returns words, and goes one way or another: with none for success, or with others' words."""
    words = isinstance(function, Function) and isinstance(function.returns, ast.Name) and function.returns.id == "str"
    returned = [node.value for node in _within(function) if isinstance(node, ast.Return) and node.value is not None]
    empty = [
        node for value in returned for node in ast.walk(value) if isinstance(node, ast.Constant) and not node.value
    ]
    return words and (bool(empty) or len(returned) > 1)


def _last(name: ast.expr) -> str:
    return name.id if isinstance(name, ast.Name) else name.attr if isinstance(name, ast.Attribute) else ""
