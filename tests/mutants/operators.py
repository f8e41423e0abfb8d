"""The mutants of a source: each one small change of its text, of the kinds that the field's literature lists.

Relational operators and their borders, connectors of conditions and each of their terms, arithmetic, constants, `min`
for `max` and the like, what is returned, conditions and calls left out. What only words a message, names a type or
checks one (`raise`, f-strings, annotations, decorators, `assert`) is left alone.
"""

import ast
import re
from collections import Counter
from collections.abc import Iterable, Iterator
from dataclasses import dataclass

COMPARED = {
    "<": ("<=", ">="), "<=": ("<", ">"), ">": (">=", "<="), ">=": (">", "<"), "==": ("!=",), "!=": ("==",),
    "is": ("is not",), "is not": ("is",), "in": ("not in",), "not in": ("in",),
}  # fmt: skip
TOKENS = {
    ast.Lt: "<", ast.LtE: "<=", ast.Gt: ">", ast.GtE: ">=", ast.Eq: "==", ast.NotEq: "!=", ast.Is: "is",
    ast.IsNot: "is not", ast.In: "in", ast.NotIn: "not in", ast.And: "and", ast.Or: "or", ast.Add: "+", ast.Sub: "-",
    ast.Mult: "*", ast.Div: "/", ast.Pow: "**", ast.FloorDiv: "//", ast.Mod: "%", ast.BitAnd: "&", ast.BitOr: "|",
}  # fmt: skip
CALCULATED = {"+": "-", "-": "+", "*": "/", "/": "*", "**": "*", "//": "/", "&": "|", "|": "&"}
CALLED = {"min": "max", "any": "all", "minimum": "maximum", "argmin": "argmax", "floor": "ceil", "nanmin": "nanmax"}
CALLED |= {after: before for before, after in CALLED.items()}
UNCHANGED = (ast.JoinedStr, ast.Raise, ast.Assert, ast.FunctionDef, ast.ClassDef)  # the last two: by their own name
INDICES = (ast.Constant, ast.UnaryOp, ast.Slice)  # another place of an array is mostly none at all
NO_MATTER = {
    "strict",
    "encoding",
    "keepdims",
    "dtype",
    "exist_ok",
    "newline",
    "repr",
    "eq",
    "frozen",
    "hermitian",
    "axis",
    "size",
    "maxsplit",
}
WIDEST = 90  # characters of an expression that is shown around a change


@dataclass(frozen=True)
class Mutant:
    """`text`: of the file at `path`, changed at `line` in `function`. `name`: the change in words, unique in the
    function, whatever comes before or after it. `tests`: those that it is run against."""

    path: str
    function: str
    name: str
    line: int
    text: str
    tests: tuple[str, ...] = ()

    @property
    def key(self) -> str:
        return f"{self.path}::{self.function}: {self.name}"


class Source:
    """A text with places by line and column, as the nodes of its tree have them."""

    def __init__(self, text: str) -> None:
        self.text, self.tree = text, ast.parse(text)
        self._lines = [0]
        for line in text.splitlines(keepends=True):
            self._lines.append(self._lines[-1] + len(line))

    def place(self, line: int, column: int) -> int:
        begin = self._lines[line - 1]
        width = self.text[begin:].encode()[:column]  # columns count bytes
        return begin + len(width.decode())

    def span(self, node) -> tuple[int, int]:
        return self.place(node.lineno, node.col_offset), self.place(node.end_lineno, node.end_col_offset)

    def of(self, node) -> str:
        begin, end = self.span(node)
        return self.text[begin:end]


Change = tuple[int, int, str]  # from, to, the new text


def functions(tree: ast.AST, prefix: str = "") -> Iterator[tuple[str, ast.AST]]:
    """Functions, classes and assigned constants by their dotted names; of a class what is in its body."""
    for node in ast.iter_child_nodes(tree):
        if isinstance(node, ast.FunctionDef | ast.ClassDef):
            yield prefix + node.name, node
            yield from functions(node, f"{prefix}{node.name}.")
        elif isinstance(node, ast.Assign | ast.AnnAssign) and isinstance(tree, ast.Module | ast.ClassDef):
            for name in ast.walk(node.targets[0] if isinstance(node, ast.Assign) else node.target):
                if isinstance(name, ast.Name):
                    yield prefix + name.id, node


def mutants(path: str, text: str, only: Iterable[str] = ()) -> list[Mutant]:
    """Of the file's text, in its order. `only`: names of functions, classes (with all in them) and constants.

    Raises:
        ValueError: there is no such name.
    """
    source, wanted, places = Source(text), list(only), []
    names = list(functions(source.tree))
    for name in wanted:
        if not any(name == other for other, _ in names):
            raise ValueError(f"{path}: found no {name}, expected a function, a class or a constant of this name")
    done: dict[ast.AST, str] = {}
    for name, node in names:
        if not wanted or any(name == one or name.startswith(f"{one}.") for one in wanted):
            done.setdefault(node, name)
    for node, name in done.items():
        if not isinstance(node, ast.ClassDef):
            places += [(name, where, change) for where, change in _changes(source, node)]
    return list(_named(path, source, places))


def _named(path: str, source: Source, places: list) -> Iterator[Mutant]:
    count: Counter = Counter()
    for function, (begin, end), (first, last, new) in places:
        after = source.text[begin:first] + new + source.text[last:end]
        name = f"{' '.join(source.text[begin:end].split())} -> {' '.join(after.split())}"
        count[function, name] += 1
        number = count[function, name]
        text = source.text[:first] + new + source.text[last:]
        line = source.text.count("\n", 0, first) + 1
        yield Mutant(path, function, name if number == 1 else f"{name} #{number}", line, text)


def _changes(source: Source, top: ast.AST) -> Iterator[tuple[tuple[int, int], Change]]:
    """What is shown, and the change in it."""
    for node, parents in _below(top, [top]):
        for change in _of(source, node, parents):
            yield _shown(source, change, [*parents, node]), change


def _shown(source: Source, change: Change, around: list) -> tuple[int, int]:
    """The widest expression around a change that is short, with an `if` before it; else the lines of the change."""
    first, last = shown = change[:2]
    for node in reversed(around):
        if isinstance(node, ast.keyword | ast.comprehension):
            continue
        if not isinstance(node, ast.expr | ast.Return | ast.Assign | ast.If):
            break
        begin, end = source.span(node)
        if isinstance(node, ast.If):
            end = source.span(node.test)[1]
        if not begin <= first <= last <= end or end - begin > WIDEST or "\n" in source.text[begin:end]:
            break
        shown = begin, end
    if shown == (first, last) and last - first < 8:  # an operator alone says nothing
        return source.text.rfind("\n", 0, first) + 1, source.text.find("\n", last)
    return shown


def _below(node: ast.AST, parents: list) -> Iterator[tuple[ast.AST, list]]:
    """The nodes in which something is changed, each with those around it."""
    for field, value in ast.iter_fields(node):
        if field in ("annotation", "returns", "decorator_list", "type_params"):
            continue
        for child in value if isinstance(value, list) else [value]:
            if not isinstance(child, ast.AST) or isinstance(child, UNCHANGED):
                continue
            if isinstance(child, ast.keyword) and child.arg in NO_MATTER:
                continue
            index = isinstance(node, ast.Subscript) and child is node.slice
            if isinstance(child, INDICES) and (index or _in_index(node, parents)):
                continue
            yield child, parents
            yield from _below(child, [*parents, child])


def _in_index(node: ast.AST, parents: list) -> bool:
    """Whether it is the tuple of an index."""
    around = parents[-2] if len(parents) > 1 else None
    return isinstance(node, ast.Tuple) and isinstance(around, ast.Subscript) and node is around.slice


def _of(source: Source, node: ast.AST, parents: list) -> Iterator[Change]:
    """The changes of one node."""
    begin, end = source.span(node) if hasattr(node, "lineno") else (0, 0)
    if isinstance(node, ast.Compare):
        sides = [node.left, *node.comparators]
        for left, right, operator in zip(sides[:-1], sides[1:], node.ops, strict=True):
            token = TOKENS[type(operator)]
            turned = COMPARED[token][-1:] if not _decides(node, parents[-1]) else ()
            yield from _token(source, left, right, token, dict.fromkeys([*COMPARED[token][:-1], *turned]))
    elif isinstance(node, ast.BoolOp):
        neutral = isinstance(
            node.op, ast.And
        )  # a term left out; what tells it from the whole tells `or` from `and` too
        yield from ((*source.span(value), str(neutral)) for value in node.values)
    elif isinstance(node, ast.BinOp) and not _of_words(node):
        token = TOKENS.get(type(node.op), "")
        if new := CALCULATED.get(token):
            yield from _token(source, node.left, node.right, token, (new,))
    elif isinstance(node, ast.UnaryOp) and not isinstance(node.operand, ast.Constant):
        if isinstance(node.op, ast.Not) and _decides(node, parents[-1]):
            return
        yield begin, begin + (3 if isinstance(node.op, ast.Not) else 1), ""
    elif isinstance(node, ast.Constant):
        yield from _constant(source, node)
    elif isinstance(node, ast.Call):
        yield from _call(source, node)
    elif isinstance(node, ast.If | ast.IfExp | ast.comprehension):
        for test in node.ifs if isinstance(node, ast.comprehension) else [node.test]:
            first, last = source.span(test)
            names = any(isinstance(part, ast.NamedExpr) for part in ast.walk(test))  # a name for what is below
            yield first, last, f"({source.of(test)}) and False" if names else "False"
            yield first, last, f"({source.of(test)}) or True" if names else "True"
    elif isinstance(node, ast.Return) and isinstance(node.value, ast.JoinedStr):
        yield *source.span(node.value), '""'
    elif isinstance(node, ast.Return) and isinstance(node.value, ast.Constant) and isinstance(node.value.value, str):
        yield *source.span(node.value), '""' if node.value.value else '"mutant"'
    elif isinstance(node, ast.Continue | ast.Break) or (
        isinstance(node, ast.Expr) and isinstance(node.value, ast.Call)
    ):
        yield begin, end, "pass"
    elif isinstance(node, ast.AugAssign) and (new := CALCULATED.get(TOKENS.get(type(node.op), ""))):
        yield from _token(source, node.target, node.value, f"{TOKENS[type(node.op)]}=", (f"{new}=",))
    elif isinstance(node, ast.Assign) and _of_state(node) and getattr(parents[0], "name", "") != "__init__":
        yield begin, end, "pass"


def _decides(node: ast.AST, parent: ast.AST) -> bool:
    """Whether it is a condition or a term of one: what tells its being left out from it, tells its contrary from it."""
    tests = parent.ifs if isinstance(parent, ast.comprehension) else []
    tests = [parent.test] if isinstance(parent, ast.If | ast.IfExp) else tests
    return isinstance(parent, ast.BoolOp) or any(node is test for test in tests)


def _token(source: Source, left: ast.AST, right: ast.AST, token: str, new: Iterable[str]) -> Iterator[Change]:
    """The operator between two nodes, exchanged."""
    after = source.span(left)[1]
    between = source.text[after : source.span(right)[0]]
    match = re.search(r"\s+".join(re.escape(part) for part in token.split()), between)
    assert match
    for other in new:
        yield after + match.start(), after + match.end(), other


def _constant(source: Source, node: ast.Constant) -> Iterator[Change]:
    value, span = node.value, source.span(node)
    if isinstance(value, bool):
        yield *span, str(not value)
    elif isinstance(value, int | float):
        yield *span, "1" if value == 0 else repr(2 * value)


def _call(source: Source, node: ast.Call) -> Iterator[Change]:
    begin, end = source.span(node)
    name = node.func.attr if isinstance(node.func, ast.Attribute) else getattr(node.func, "id", "")
    if name in CALLED and (node.args or name not in CALLED.values() or isinstance(node.func, ast.Attribute)):
        last = source.span(node.func)[1]
        yield last - len(name), last, CALLED[name]
    elif name == "isfinite":
        yield begin, end, f"({source.of(node)} | True)"
    elif name == "abs" and len(node.args) == 1:
        yield begin, end, f"({source.of(node.args[0])})"


def _of_words(node: ast.BinOp) -> bool:
    """Whether it joins texts, lists or mappings."""
    sides = (node.left, node.right)
    return any(
        isinstance(side, ast.JoinedStr | ast.List | ast.ListComp | ast.Tuple | ast.Dict) for side in sides
    ) or any(isinstance(side, ast.Constant) and isinstance(side.value, str) for side in sides)


def _of_state(node: ast.Assign) -> bool:
    """Whether it sets attributes alone."""
    target = node.targets[0]
    each = target.elts if isinstance(target, ast.Tuple) else [target]
    return all(isinstance(part, ast.Attribute) for part in each)
