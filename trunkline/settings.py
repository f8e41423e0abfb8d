"""Dataclasses of what people set: their types are the ranges that a value must keep."""

from typing import TypeVar, dataclass_transform

from pydantic import ConfigDict, Field
from pydantic.dataclasses import dataclass

Schema = TypeVar("Schema")


@dataclass_transform(kw_only_default=True, field_specifiers=(Field,))
def settings(cls: type[Schema]) -> type[Schema]:
    """Decorate a stage's ``Config`` and the classes nested in it: unknown keys and conversions are refused.

    The class becomes a keyword-only pydantic dataclass. Ranges: ``PositiveFloat``, ``Field(gt=0)``; choices:
    ``Literal``; rules between fields: a ``__post_init__`` that raises ValueError.
    """
    return dataclass(cls, config=ConfigDict(extra="forbid", strict=True), kw_only=True)
