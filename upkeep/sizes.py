"""Count lines and functions, and constants whose unit stands in a comment."""

import ast
import math
import re

from upkeep.names import Function
from upkeep.sources import Sources, parse

UNITS = r"s|ms|us|µs|ns|min|h|m|mm|cm|µm|kg|g|N|mN|kN|Nm|Pa|kPa|MPa|GPa|J|W|V|A|mA|Hz|kHz|rad|deg|°|°C|K|%|px|bytes|B"
WITH_UNIT = re.compile(rf"\s*# *(1/)?({UNITS})[²³\d]?([ ·*/]({UNITS})[²³\d]?)*(?=$|[\s,;:.)])")
LITERAL = (ast.Constant, ast.UnaryOp, ast.BinOp, ast.Tuple, ast.operator, ast.unaryop, ast.expr_context)


def count_lines(sources: Sources) -> int:
    return sum(len(text.splitlines()) for text in sources.values())


def longest_file(sources: Sources) -> tuple[int, str]:
    """Its lines, and its path."""
    return max(((len(text.splitlines()), path) for path, text in sources.items()), default=(0, ""))


def function_lengths(sources: Sources) -> list[tuple[int, str]]:
    """Lines of each function and method from `def` to its end, with docstring, and `path:name`; shortest first.

    A nested function counts by itself, and its lines count in the function around it too.
    """
    return sorted(
        ((node.end_lineno or node.lineno) - node.lineno + 1, f"{path}:{node.name}")
        for path, text in sources.items()
        for node in ast.walk(parse(text))
        if isinstance(node, Function)
    )


def quantile(ordered: list[tuple[int, str]], share: float) -> int:
    """The length that this share of the functions does not exceed (nearest rank)."""
    return ordered[max(math.ceil(share * len(ordered)), 1) - 1][0] if ordered else 0


def count_constants(sources: Sources) -> tuple[int, int]:
    """Names of a module that are set to a number, a product or a tuple of numbers; how many have their unit behind.

    The unit is what the comment on the line begins with: `LENGTH = 0.3  # m, of the arm`.
    """
    units = [bool(WITH_UNIT.match(_behind(node, text))) for text in sources.values() for node in _constants(text)]
    return len(units), sum(units)


def _constants(text: str) -> list[ast.stmt]:
    nodes = [node for node in parse(text).body if isinstance(node, ast.Assign | ast.AnnAssign) and node.value]
    return [node for node in nodes if all(map(_numeric, ast.walk(node.value)))]  # type: ignore[arg-type]


def _numeric(node: ast.AST) -> bool:
    return isinstance(node, LITERAL) and (not isinstance(node, ast.Constant) or type(node.value) in (int, float))


def _behind(node: ast.stmt, text: str) -> str:
    """What follows a statement on its last line; columns of `ast` are bytes."""
    return text.split("\n")[(node.end_lineno or 1) - 1].encode()[node.end_col_offset :].decode()
