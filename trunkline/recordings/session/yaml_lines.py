"""Where in a YAML file a key stands."""

from pathlib import Path

import yaml


def line_of(path: Path, key: str) -> int | None:
    """The line, from 1, of a key such as `trials.3.level`, or of the last part of it that is there; None where not even
    the first is."""
    node, line = yaml.compose(path.read_text(encoding="utf-8"), Loader=yaml.SafeLoader), None
    for part in key.split("."):
        if isinstance(node, yaml.MappingNode):
            below = next(((name, value) for name, value in node.value if name.value == part), None)
        elif isinstance(node, yaml.SequenceNode) and part.isdecimal() and int(part) < len(node.value):
            below = (node.value[int(part)],) * 2
        else:
            below = None
        if below is None:
            break
        line, node = below[0].start_mark.line + 1, below[1]
    return line


def with_line(path: Path, problem: str) -> str:
    """A `problem` of a file that begins with its key and a colon, with the file and the key's line."""
    line = line_of(path, problem.partition(":")[0])
    return f"{path}: {problem}" + (f" (line {line})" if line is not None else "")
