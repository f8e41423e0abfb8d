"""Count the names that code binds, the vague ones among them, and classes that share a name.

Bound are: names that are assigned (also by `+=`, `:=` and with a type alone, as fields of dataclasses are), targets of
loops, `with` and comprehensions, arguments, functions, classes, attributes assigned on `self`, and what `except`,
`import` and `case` name by `as`. Each place that binds counts: a name assigned twice counts twice. Underscores at
either end are left out, so `_found` is `found`; `found_in` is another name.
"""

import ast
import re
from collections import Counter
from collections.abc import Iterable, Iterator

from upkeep.sources import Sources, parse

REFUSED = ("found", "told", "one", "own", "said", "seen", "given", "held", "kept", "known")  # in tests/test_names.py
VAGUE = (*REFUSED, "heard", "asked", "shown", "meant")
Function = ast.FunctionDef | ast.AsyncFunctionDef
# Of a script: comments, strings and patterns; names but for properties of others than `this`, as keys are the wire's.
_NO_NAMES = re.compile(
    r'//.*|/\*[\s\S]*?\*/|"(?:\\.|[^"\\\n])*"|`(?:\\.|[^`\\])*`|(?<=[(\[,:=&|?! ])/(?! )(?:\\.|[^/\\\n])+/'
)
_NAME = re.compile(r"(?:(?<![\w$.])|(?<=\bthis\.)|(?<=\.{3}))[A-Za-z_$][\w$]*")


def bound_names(tree: ast.AST) -> Iterator[str]:
    """Every name that a source binds, once for each place that binds it, without underscores at its ends."""
    return (name.strip("_") for node in ast.walk(tree) if (name := _bound(node)))


def _bound(node: ast.AST) -> str | None:
    match node:
        case ast.Name(id=name, ctx=ast.Store()) | ast.Attribute(value=ast.Name(id="self"), attr=name, ctx=ast.Store()):
            return name
        case ast.FunctionDef(name=name) | ast.AsyncFunctionDef(name=name) | ast.ClassDef(name=name):
            return name
        case ast.arg(arg=name) | ast.alias(asname=name) | ast.ExceptHandler(name=name) | ast.MatchAs(name=name):
            return name
    return None


def script_names(text: str) -> Iterator[str]:
    """Every name of a script in JavaScript, once for each place that binds or uses it, but for keys of messages."""
    return (name.strip("_").lower() for name in _NAME.findall(_NO_NAMES.sub(" ", text)))


def count_names(sources: Sources, words: Iterable[str] = VAGUE) -> tuple[int, int]:
    """How many bound names are one of `words`, and how many there are."""
    counts = Counter(name for text in sources.values() for name in bound_names(parse(text)))
    return sum(counts[word] for word in words), counts.total()


def repeated_classes(sources: Sources) -> dict[str, int]:
    """Class names that are defined more than once, by how often, the most frequent first."""
    counts = Counter(node.name for node in _classes(sources))
    return {name: count for name, count in counts.most_common() if count > 1}


def count_dataclasses(sources: Sources) -> int:
    """Classes that are decorated as dataclasses, with or without arguments."""
    decorators = [ast.unparse(part) for node in _classes(sources) for part in node.decorator_list]
    return sum(text.partition("(")[0].rpartition(".")[2] == "dataclass" for text in decorators)


def _classes(sources: Sources) -> Iterator[ast.ClassDef]:
    return (node for text in sources.values() for node in ast.walk(parse(text)) if isinstance(node, ast.ClassDef))
