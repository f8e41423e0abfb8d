"""What session.yaml says of foreign tables: how a file is written, and what each of its columns is."""

import re
from pathlib import Path
from typing import Annotated, Any, Literal, NamedTuple

from pydantic import (
    AfterValidator,
    BaseModel,
    ConfigDict,
    Field,
    FiniteFloat,
    PlainValidator,
    field_validator,
    model_validator,
)

TEXT = (".csv", ".txt", ".tsv", ".dat")
TABLES = (*TEXT, ".parquet", ".npz", ".mat")  # how the names of files end that are read as tables
TO_SECONDS = {"s": 1.0, "ms": 1e-3, "us": 1e-6, "ns": 1e-9, "min": 60.0}


class Entry(BaseModel):
    """A block of session.yaml; unknown keys are refused."""

    model_config = ConfigDict(extra="forbid")


def keys_of_blocks(block: type[BaseModel] = Entry) -> list[str]:
    """The keys of all blocks of session.yaml."""
    below = [key for other in block.__subclasses__() for key in keys_of_blocks(other)]
    return [*block.model_fields, *below]


def _column(value: Any) -> int | str:
    if isinstance(value, bool) or not (isinstance(value, str) and value or isinstance(value, int) and value > 0):
        raise ValueError(f"found {value!r}, expected a column's name, or its number from 1")
    return value


class Constant(NamedTuple):
    """What a motor has throughout, where no column says it, in the unit of its numbers."""

    value: float


def _motor(value: Any) -> int | str | Constant:
    if isinstance(value, dict) and list(value) == ["value"] and isinstance(value["value"], int | float):
        return Constant(float(value["value"]))
    if isinstance(value, dict):
        raise ValueError(f"found {value!r}, expected a column, or {{value: NUMBER}} for what holds throughout")
    return value if isinstance(value, Constant) else _column(value)


Column = Annotated[int | str, PlainValidator(_column)]
MotorColumn = Annotated[int | str | Constant, PlainValidator(_motor)]


def _of_several(count: int) -> AfterValidator:
    """So many columns, each another."""

    def check(columns: list[int | str]) -> list[int | str]:
        if len(columns) != count:
            raise ValueError(f"found {len(columns)} columns, expected {count}")
        twice = next((column for column in columns if columns.count(column) > 1), None)
        if twice is not None:
            raise ValueError(f"found the column {twice!r} twice, expected another for each")
        return columns

    return AfterValidator(check)


Three = Annotated[list[Column], _of_several(3)]
Four = Annotated[list[Column], _of_several(4)]


class TableTime(Entry):
    """When rows were taken. column: with its `unit`; `date` is text such as 2026-03-14 14:15:33.120, or a time of
    Parquet. frames: the column of frame numbers; with `rate` (a second) and no `column` they are the time. rate alone:
    rows come evenly. start: s, when this time reads 0, on the clock of the session's other tables."""

    column: Column | None = None
    unit: Literal["s", "ms", "us", "ns", "min", "date"] | None = None
    frames: Column | None = None
    rate: Annotated[FiniteFloat, Field(gt=0, le=1e6)] | None = None
    start: FiniteFloat = 0.0

    @model_validator(mode="after")
    def _either(self):
        if (self.column is None) == (self.rate is None):
            both = "both `column` and `rate`" if self.rate else "no `column` and no `rate`"
            raise ValueError(f"found {both}, expected one of the two")
        if (self.column is None) != (self.unit is None):
            if self.unit is None:
                raise ValueError(f"unit: missing, expected that of the column {self.column!r}: "
                                 f"{', '.join(TO_SECONDS)} or date")  # fmt: skip
            raise ValueError(f"unit: found {self.unit!r} beside `rate`, which is in rows a second, expected none")
        return self


class TextForm(Entry):
    """How a text file is written. separator: by default a comma, of .tsv a tab, of .txt and .dat blanks. header: lines
    above the numbers. names: which of these lines has the columns' names, from 1; by default the last."""

    separator: Literal[",", ";", "tab", "blanks"] | None = None
    decimal: Literal[".", ","] = "."
    encoding: Literal["utf-8", "utf-16", "latin-1"] = "utf-8"
    header: Annotated[int, Field(strict=True, ge=0, le=1000)] = 1
    names: Annotated[int, Field(strict=True, ge=1)] | None = None

    @model_validator(mode="after")
    def _within(self):
        if self.names is not None and self.names > self.header:
            raise ValueError(f"names: found {self.names}, expected a line of the header, which has {self.header}")
        if self.separator == self.decimal == ",":
            raise ValueError("decimal: found ',' beside the separator ',', expected another separator")
        return self

    def separator_of(self, path: Path) -> str:
        """`,`, `;`, a tab, or a blank for any number of them."""
        by_name = {".tsv": "tab", ".txt": "blanks", ".dat": "blanks"}.get(path.suffix.lower(), ",")
        named = self.separator or (";" if by_name == self.decimal == "," else by_name)
        return {"tab": "\t", "blanks": " "}.get(named, named)


class TableBody(Entry):
    """Columns of a body: its position in `frame.unit`, and its orientation, as `quaternion` or `euler` of `tables`
    says, if there is one."""

    position: Three
    quaternion: Four | None = None
    euler: Three | None = None

    @model_validator(mode="after")
    def _one_orientation(self):
        if self.quaternion is not None and self.euler is not None:
            raise ValueError("euler: found it beside `quaternion`, expected one of the two")
        return self


class Euler(Entry):
    """Of angles in the order of `convention`, as SciPy has it: xyz about axes that stand, XYZ about those that turn
    along."""

    convention: str
    unit: Literal["deg", "rad"]

    @field_validator("convention")
    @classmethod
    def _turning(cls, convention):
        axes = re.fullmatch("[xyz]{3}|[XYZ]{3}", convention)
        if axes is None or convention[0] == convention[1] or convention[1] == convention[2]:
            raise ValueError(f"found {convention!r}, expected SciPy's three letters, such as 'xyz' about axes that "
                             "stand, or 'XYZ' about those that turn along")  # fmt: skip
        return convention


Motors = dict[str, MotorColumn]


class MotorsFile(TextForm):
    """A file of its own for `commands` and `tendon_positions`. time: by default its rows are those of the poses."""

    file: str
    time: TableTime | None = None


class TableLayout(TextForm):
    """bodies: name to its columns. quaternion: the order of their four columns. frame: `base` where poses are relative
    to the base. gaps: numbers that stand for what was not measured, beside blanks and NaN; 0 counts for a body where
    all three are. commands, tendon_positions: name of the motor to its column, or a list of columns, which then name
    the motors. trial: the column that says which trial a row is of."""

    time: TableTime
    bodies: dict[str, TableBody] = Field(min_length=1)
    quaternion: Literal["wxyz", "xyzw"] | None = None
    euler: Euler | None = None
    frame: Literal["world", "base"] = "world"
    gaps: list[FiniteFloat] = []
    commands: Motors | None = Field(default=None, min_length=1)
    tendon_positions: Motors | None = Field(default=None, min_length=1)
    motors_file: MotorsFile | None = None
    trial: Column | None = None

    @field_validator("commands", "tendon_positions", mode="before")
    @classmethod
    def _by_column(cls, motors: Any):
        return {str(column): column for column in motors} if isinstance(motors, list) else motors

    @model_validator(mode="after")
    def _complete(self):
        for name, body in self.bodies.items():
            for key, expected in (("quaternion", "wxyz or xyzw, the order of the columns"),
                                  ("euler", "{convention: xyz, unit: deg}, or what they are")):  # fmt: skip
                if getattr(body, key) is not None and getattr(self, key) is None:
                    raise ValueError(f"{key}: missing, as bodies.{name} has one, expected {expected}")
        if self.motors_file is not None and self.commands is None and self.tendon_positions is None:
            raise ValueError("motors_file: found no columns of it, expected `commands` or `tendon_positions`")
        return self
