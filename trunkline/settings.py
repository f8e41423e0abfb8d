"""Settings are the library's own dataclasses: the types of their fields are the ranges that a value must keep.

What a function is set by is a plain dataclass beside it, as `statics`' or `ik`'s are, with `Literal`,
`Annotated[int, Field(ge=8, le=100)]` and, for rules between fields, a `__post_init__` that raises ValueError.
Every number has both ends: beyond them lies what nobody means, or what no computer finishes (a test asks for them).
Code may build it freely. What comes from files is checked as a whole, from the class that `settings` decorates down.
"""

from pathlib import Path
from typing import Annotated, TypeVar, dataclass_transform

import yaml
from omegaconf import DictConfig, OmegaConf
from omegaconf.errors import OmegaConfBaseException
from pydantic import ConfigDict, Field
from pydantic.dataclasses import dataclass

from trunkline.errors import InputError

Schema = TypeVar("Schema")
Seed = Annotated[int, Field(ge=0, le=2**32 - 1)]  # what every generator of random numbers takes
MOST_VALUES = 100_000  # in a file with its aliases written out; those of this project have hundreds


def read_yaml(path: Path) -> DictConfig:
    """A file of `key: value` lines, as OmegaConf reads YAML.

    Raises:
        InputError: there is no such file, it is no YAML, holds something else, or grows endlessly by its aliases.
    """
    try:
        size = _size(yaml.compose(path.read_text(encoding="utf-8"), Loader=yaml.SafeLoader), {})
        if size > MOST_VALUES:
            raise InputError(f"{path}: found {size:.3g} values by aliases (&, *), expected at most {MOST_VALUES}")
        config = OmegaConf.load(path)
    except FileNotFoundError:
        raise InputError(f"{path}: no such file") from None
    except UnicodeDecodeError as error:
        raise InputError(f"{path}: byte {error.start} is no UTF-8, expected a text file in UTF-8") from error
    except RecursionError:
        raise InputError(f"{path}: found an alias within itself, or lists in lists without end") from None
    except (yaml.YAMLError, OmegaConfBaseException, OSError) as error:
        raise InputError(f"{path}: not readable as YAML: {error}") from error
    if not isinstance(config, DictConfig):
        raise InputError(f"{path}: found a list, expected `key: value` lines")
    return config


def _size(node: yaml.Node | None, sizes: dict[int, int]) -> int:
    """How many values a node has when its aliases are written out, without doing so."""
    if node is None or isinstance(node, yaml.ScalarNode):
        return 1
    if id(node) not in sizes:
        parts = [part for pair in node.value for part in pair] if isinstance(node, yaml.MappingNode) else node.value
        sizes[id(node)] = 1 + sum(_size(part, sizes) for part in parts)
    return sizes[id(node)]


def rename_keys(values: dict, renamed: dict[str, str], where: str) -> None:
    """Give keys of an earlier release the names that they have now, in place, and print a line for each.

    Args:
        renamed: the old name of a key to the new one. where: begins the line.

    Raises:
        InputError: a key is there under both names.
    """
    for old, new in renamed.items():
        if old in values:
            if new in values:
                raise InputError(f"{where}: found `{old}` beside `{new}`, its new name, expected `{new}` alone")
            print(f"{where}: `{old}` is called `{new}` now: please rename it, the next release reads `{new}` alone")
            values[new] = values.pop(old)


@dataclass_transform(kw_only_default=True, field_specifiers=(Field,))
def settings(cls: type[Schema]) -> type[Schema]:
    """Decorate a stage's `Config`: it and all dataclasses nested in it refuse unknown keys and conversions.

    The class becomes a keyword-only pydantic dataclass; numbers must be finite. The nested ones stay as they are and
    need no decorator. Where a library's dataclass is all that a stage is set by: `Config = settings(Filter)`.
    """
    made = dataclass(cls, config=ConfigDict(extra="forbid", strict=True, allow_inf_nan=False), kw_only=True)
    assert issubclass(made, cls)  # itself, or a class made of it where it was a dataclass before
    return made
