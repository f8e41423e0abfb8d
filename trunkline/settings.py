"""Settings are the library's own dataclasses: the types of their fields are the ranges that a value must keep.

What a function is set by is a plain dataclass beside it, as `statics`' or `ik`'s are, with `Literal`,
`Annotated[int, Field(ge=8, le=100)]` and, for rules between fields, a `__post_init__` that raises ValueError.
Every number has both ends: beyond them lies what nobody means, or what no computer finishes (a test asks for them).
Code may build it freely. What comes from files is checked as a whole, from the class that `settings` decorates down.
"""

from typing import Annotated, TypeVar, dataclass_transform

from pydantic import ConfigDict, Field
from pydantic.dataclasses import dataclass

Schema = TypeVar("Schema")
Seed = Annotated[int, Field(ge=0, le=2**32 - 1)]  # what every generator of random numbers takes


@dataclass_transform(kw_only_default=True, field_specifiers=(Field,))
def settings(cls: type[Schema]) -> type[Schema]:
    """Decorate a stage's `Config`: it and all dataclasses nested in it refuse unknown keys and conversions.

    The class becomes a keyword-only pydantic dataclass; numbers must be finite. The nested ones stay as they are and
    need no decorator. Where a library's dataclass is all that a stage is set by: `Config = settings(Filter)`.
    """
    made = dataclass(cls, config=ConfigDict(extra="forbid", strict=True, allow_inf_nan=False), kw_only=True)
    assert issubclass(made, cls)  # itself, or a class made of it where it was a dataclass before
    return made
