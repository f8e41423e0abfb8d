"""Errors of pydantic as one line that names the key."""

import re
from collections.abc import Iterator
from typing import Any

from pydantic import TypeAdapter

from trunkline.errors import nearest

UNKNOWN_KEY = "unexpected_keyword_argument"  # what pydantic calls it in a dataclass
MANY = 12  # valid names, from which on the nearest alone is printed
# pydantic's names for a number out of its range, and JSON schema's for the end that it passed
BEYOND = {
    "greater_than": "exclusiveMinimum",
    "greater_than_equal": "minimum",
    "less_than": "exclusiveMaximum",
    "less_than_equal": "maximum",
}


def path_of(problem: Any, composed: dict[str, Any]) -> list[str]:
    """Where pydantic found a problem as a path of keys: without its mark for keys and its choices among classes."""
    path, value = [], composed
    for place, part in enumerate(problem["loc"]):
        last = place == len(problem["loc"]) - 1
        names_class = not last and isinstance(problem["loc"][place + 1], str)
        if names_class and isinstance(value, dict) and value.get("kind") == part:
            continue  # a class may be called as one of its keys
        if isinstance(value, dict) and (part in value or (last and problem["type"] == "missing")):
            within = value.get(part)
        elif isinstance(value, list) and isinstance(part, int):
            within = None if last else value[part]  # the last of a list may be what it lacks
        else:
            continue
        path.append(str(part))
        value = within
    return path


def in_order(problems: list[Any], composed: dict[str, Any]) -> list[Any]:
    """Unknown keys first, for they explain missing ones, and those explain the rest.

    Of a value that may have several forms pydantic says all that it is not. Where it is wrong within one of them, it
    has that form, and the others are left out.
    """
    paths = [path_of(problem, composed) for problem in problems]

    def another_form(place: int) -> bool:
        path = paths[place]
        within = any(len(other) > len(path) and other[: len(path)] == path for other in paths)
        return within and problems[place]["type"].endswith("_type")

    left = [problem for place, problem in enumerate(problems) if not another_form(place)]
    return sorted(left, key=lambda problem: {UNKNOWN_KEY: 0, "missing": 1}.get(problem["type"], 2))


def others_missing(problems: list[Any], composed: dict[str, Any]) -> str:
    """Of problems `in_order`, where the first is a missing key: what tells the others that are missing."""
    names = [".".join(path_of(problem, composed)) for problem in problems if problem["type"] == "missing"]
    if problems[0]["type"] != "missing" or len(names) == 1:
        return ""
    return f"; also missing: {', '.join(names[1:])}"


def describe(problem: Any, adapter: TypeAdapter) -> str:
    if problem["type"] == UNKNOWN_KEY:
        schema = adapter.json_schema()
        classes = [schema, *schema.get("$defs", {}).values()]
        valid = [name for cls in classes for name in cls.get("properties", {})]
        unknown = str(problem["loc"][-1])
        return "unknown key" + nearest(unknown, [name for name in valid if name != unknown])  # of another class
    if problem["type"] == "missing":
        return "missing, expected a value"
    expected = problem["msg"].removeprefix("Input should be ").removeprefix("Value error, ")
    if problem["type"] == "value_error":  # a rule between fields, in the schema's own words
        return expected
    value = problem["input"]
    if problem["type"] == "union_tag_not_found":  # which of several classes: a key of theirs says it
        return f"{problem['ctx']['discriminator']}: missing, expected a value".replace("'", "", 2)
    if problem["type"] == "union_tag_invalid":
        key, value = problem["ctx"]["discriminator"].strip("'"), problem["ctx"]["tag"]
        expected = f"one of {problem['ctx']['expected_tags']}"
        valid = re.findall(r"'([^']*)'", expected)
        return f"{key}: found {value!r}, expected {expected}" + nearest(value, valid)
    if problem["type"] in BEYOND:
        expected = _range(problem, adapter) or expected
    valid = re.findall(r"'([^']*)'", expected) if problem["type"] == "literal_error" else []
    suggestion = nearest(str(value), valid)
    if suggestion and len(valid) > MANY:
        expected = f"one of {len(valid)} names"
    return f"found {value!r}, expected {expected}{suggestion}"


def _range(problem: Any, adapter: TypeAdapter) -> str:
    """Both ends of the range that a number is out of; empty where keys of that name have several."""
    key = [part for part in problem["loc"] if isinstance(part, str)][-1:]
    schema = adapter.json_schema()
    named = [cls.get("properties", {}).get(*key) for cls in (schema, *schema.get("$defs", {}).values()) if key]
    passed, (limit, *_) = BEYOND[problem["type"]], problem["ctx"].values()
    ranges = {_ends(node) for node in _nodes(named) if node.get(passed) == limit}
    return ranges.pop() if len(ranges) == 1 else ""


def _nodes(schema: Any) -> Iterator[dict]:
    """All parts of a JSON schema."""
    if isinstance(schema, dict):
        yield schema
    for part in schema.values() if isinstance(schema, dict) else schema if isinstance(schema, list) else ():
        yield from _nodes(part)


def _ends(node: dict) -> str:
    """The range that a part of a JSON schema gives; empty where it is open on one side."""
    low, high = (node.get(end, node.get(f"exclusive{end.capitalize()}")) for end in ("minimum", "maximum"))
    if low is None or high is None:
        return ""
    above, below = "more than " * ("minimum" not in node), "less than " * ("maximum" not in node)
    return f"{above}{low:.10g} to {below}{high:.10g}"
