"""What a table seems to hold, by its names and numbers: a `tables` block for session.yaml, and why each guess.

What nobody can see in a table, such as the convention of angles or the unit of motors, is left as a comment to fill in.
"""

import json
import re
from dataclasses import dataclass, field
from itertools import islice
from pathlib import Path
from typing import get_args

import numpy as np

from trunkline.errors import InputError
from trunkline.recordings.session.layout import TEXT, TO_SECONDS, TextForm
from trunkline.recordings.session.session import FORCES, MotorEntry
from trunkline.recordings.session.session import UNITS as METRES
from trunkline.recordings.tables.arrays import array_columns
from trunkline.recordings.tables.columns import BLANK, Key, cells_of, opened, seconds_of

LOOKED_AT = 5000  # lines
FORMS = [(",", "."), (";", "."), (";", ","), ("tab", "."), ("tab", ","), ("blanks", "."), ("blanks", ",")]
UNITS = "m|mm|cm|inch|s|ms|us|ns|min|deg|rad|Nm|N"
UNIT = re.compile(rf"([\s_]+|[\s_]*[\[(/]\s*)({UNITS})\s*[\])]?$")
BARE = re.compile(rf"[\[(]?({UNITS}|-|)[\])]?")
BETWEEN = r"[ _.:\-]*"
TURNED = r"q|quat(?:ernion)?|r|rot(?:ation)?|orientation|euler|angle"
MOVING = r"v|vel(?:ocity)?|a|acc(?:el(?:eration)?)?|w|omega|f|force|gyro"  # no places
AXIS = re.compile(
    rf"(.*?){BETWEEN}((?<![a-z])(?:pos(?:ition)?|translation|p|{TURNED}|{MOVING}))?{BETWEEN}([wxyz]){BETWEEN}(\d*)",
    re.IGNORECASE,
)
ANGLE = re.compile(rf"(.*?){BETWEEN}(roll|pitch|yaw){BETWEEN}(\d*)", re.IGNORECASE)
NUMBERED = re.compile(rf"(.*?){BETWEEN}(?<![a-z])q(?:uat)?_?([0-4])", re.IGNORECASE)
TIME = re.compile(r"(.*[ _.])?(time|t|ts|time_?stamp|stamp|secs?|seconds|elapsed|zeit)")
COUNTER = re.compile(r"frame|frames?[ _]?(number|nr|no|id)|sample|index|id")
LABEL = re.compile(r".*(id|trial|run|traj\w*|label|pattern|episode|experiment|take|test)")
COMMAND = re.compile(r"u\d+|.*(cmd|command|target|setpoint|input).*")
MEASURED = re.compile(r"(q|phi)\d+|.*(meas|actual|state|encoder|position|pos).*")
MOTOR = re.compile(r"[ulqm]_?\d+|phi\d+|.*(motor|servo|tendon|cable|winch|pull|tension|force|torque).*")
SENTINELS = (0.0, -1.0, -999.0, -9999.0, -99999.0, 999.0, 9999.0, 99999.0, 1e6)


@dataclass
class LookedAt:
    """A column. name: without unit; label: the same in lower case. values: (n,), NaN where a cell is no number."""

    key: Key
    name: str
    unit: str | None
    values: np.ndarray
    texts: list[str]

    @property
    def label(self) -> str:
        return self.name.lower()


@dataclass
class Guess:
    """tables: lines of the block. motors: of what stands beside it. why: a sentence a guess. unit: of positions.
    metres: in one of the motors' unit.

    labels: of the trials in the file, where a column has them.
    """

    tables: list[str]
    metres: float = 1.0
    motors: list[str] = field(default_factory=list)
    why: list[str] = field(default_factory=list)
    unit: str | None = None
    labels: list[str] = field(default_factory=list)


def guess(path: Path) -> Guess:
    """Look at a table.

    Raises:
        InputError: it cannot be read, or has no columns that could be positions.
    """
    try:
        form, columns = _text(path) if path.suffix.lower() in TEXT else ([], _arrays(path))
    except OSError as error:
        raise InputError(f"{path}: {(error.strerror or str(error)).lower()}, expected a table") from error
    if not any(len(column.values) for column in columns):
        raise InputError(f"{path}: found no row of numbers, expected a table")
    result = Guess(form)
    left = _time(result, columns)
    left = _bodies(result, left, path)
    left = _motors(result, left)
    left = _trials(result, left)
    if left:
        result.why.append(f"not used: {', '.join(str(column.key) for column in left)}")
    return result


def _text(path: Path) -> tuple[list[str], list[LookedAt]]:
    """Lines of `tables` on how a text is written, and its columns."""
    encoding = _encoding(path)
    with opened(path, encoding) as file:
        lines = [line.rstrip("\r\n") for line in islice(file, LOOKED_AT)]
    end = [line for line in lines if line.strip()][-50:]
    separator, decimal = max(FORMS, key=lambda form: _score(end, *form))
    form = TextForm(separator=separator, decimal=decimal, encoding=encoding)  # type: ignore[arg-type]
    with opened(path, encoding) as file:
        rows = [cells for _, cells in islice(cells_of(file, form.separator_of(path)), LOOKED_AT)]
    width = len(_cells(end[-1], separator)) if end else 0
    words = min((_words(_cells(line, separator), decimal) for line in end), default=0)
    numeric = [len(row) == width and _words(row, decimal) <= words and any(_value(cell, decimal) for cell in row)
               for row in rows]  # fmt: skip
    header = numeric.index(True) if True in numeric else len(rows)
    above = [[cell.strip() for cell in row] for row in rows[:header]]
    names_at = next((i for i in reversed(range(header)) if _are_names(above[i], width)), None)
    wide = [row for row in above if len(row) == width and any(row)]
    units = next((row for row in wide if all(map(BARE.fullmatch, row))), [""] * width)
    above_each = list(zip(*(_filled(row) for row in wide if row is not units), strict=True)) or [()] * width
    text = [f"separator: {json.dumps(separator)}", f"decimal: {json.dumps(decimal)}", f"encoding: {encoding}"]
    text.append(f"header: {header}")
    if names_at is not None and names_at != header - 1:
        text.append(f"names: {names_at + 1}")
    body = [row for row in rows[header:] if len(row) == width]
    columns = []
    for place in range(width):
        name = " ".join(filter(None, above_each[place])) if names_at is None else above[names_at][place].lstrip("# ")
        key = place + 1 if names_at is None or not name else name
        cells = [row[place].strip() for row in body]
        values = np.array([np.nan if (value := _number(cell, decimal)) is None else value for cell in cells])
        columns.append(_column(key, name, values, cells, units[place]))
    return text, columns


def _arrays(path: Path) -> list[LookedAt]:
    names, read = array_columns(path)
    columns = []
    for name, array in read(names).items():
        texts = [] if array.dtype.kind in "biuf" else [str(value) for value in array.tolist()]
        if array.dtype.kind in "Mm":
            values = seconds_of(array)
        else:
            values = array.astype(float) if not texts else np.full(len(array), np.nan)
        columns.append(_column(name, name, values, texts, ""))
    return columns


def _column(key: Key, name: str, values: np.ndarray, texts: list[str], unit: str) -> LookedAt:
    inside, stated = UNIT.search(name), BARE.fullmatch(unit)
    plain = name[: inside.start()].strip() if inside else name
    return LookedAt(key, plain, (inside[2] if inside else stated[1] if stated else None) or None, values, texts)


def _filled(row: list[str]) -> list[str]:
    """A line whose cells stand for those right of them too, where they are blank."""
    filled: list[str] = []
    for cell in row:
        filled.append(cell or (filled[-1] if filled else ""))
    return filled


def _encoding(path: Path) -> str:
    data = path.read_bytes()
    if data[:2] in (b"\xff\xfe", b"\xfe\xff") or data[:400].count(0) > 100:
        return "utf-16"
    try:
        data.decode("utf-8")
        return "utf-8"
    except UnicodeDecodeError:
        return "latin-1"


def _cells(line: str, separator: str) -> list[str]:
    by = {"blanks": " ", "tab": "\t"}.get(separator, separator)
    return next((cells for _, cells in cells_of([line], by)), [])


def _number(cell: str, decimal: str) -> float | None:
    """None where a cell is no number; NaN where it is blank."""
    try:
        return float(cell.replace(",", ".") if decimal == "," else cell)
    except ValueError:
        return np.nan if BLANK.fullmatch(cell) else None


def _value(cell: str, decimal: str) -> bool:
    """Whether a cell is a number, and not blank."""
    value = _number(cell, decimal)
    return value is not None and not np.isnan(value)


def _words(row: list[str], decimal: str) -> int:
    return sum(_number(cell, decimal) is None for cell in row)


def _score(lines: list[str], separator: str, decimal: str) -> int:
    """By cells that are numbers; those that are none count twice against it."""
    cells = [cell for line in lines for cell in _cells(line, separator)]
    return len(cells) - 3 * _words(cells, decimal)


def _are_names(row: list[str], width: int) -> bool:
    return len(set(row)) == len(row) == width and _words(row, ".") >= width - 1


def _time(result: Guess, columns: list[LookedAt]) -> list[LookedAt]:
    """The columns without those of time and frame numbers."""
    counts = (c for c in columns if COUNTER.fullmatch(c.label) or not c.name)
    counter = next((c for c in counts if np.isin(np.diff(c.values), range(1, 100)).all()), None)
    left = [column for column in columns if column is not counter]
    time = next((c for c in left if TIME.fullmatch(c.label) and _runs(c)), None)
    if time is None:
        time = next((c for c in left if not c.name and np.all(np.diff(c.values) > 0)), None)
    frames = "" if counter is None else f", frames: {_yaml(counter.key)}"
    if counter is not None:
        result.why.append(f"frame numbers: column {counter.key!r}, as it counts up")
    if time is None:
        result.tables.append(f"time: {{rate: 100{frames}}}  # FILL IN the rate, frames a second: no column is a time")
        result.why.append("time: no column is called so and runs forwards: the rate is for you to fill in")
        return left
    unit, why = _time_unit(time)
    result.tables.append(f"time: {{column: {_yaml(time.key)}, unit: {unit}{frames}}}")
    result.why.append(f"time: column {time.key!r}, {'by its name' if time.name else 'as it runs'}; in {unit}, {why}")
    return [column for column in left if column is not time]


def _runs(column: LookedAt) -> bool:
    """Whether a column is numbers that mostly increase, or dates."""
    if np.isfinite(column.values).all():
        return bool(np.mean(np.diff(column.values) > 0) > 0.5)
    return bool(column.texts) and all(re.match(r"\d{4}-\d\d-\d\d[ T]\d\d:\d\d", text) for text in column.texts)


def _time_unit(time: LookedAt) -> tuple[str, str]:
    if not np.isfinite(time.values).all():
        return "date", "as its cells are"
    if time.unit in TO_SECONDS:
        return time.unit, "by its name"
    middle, step = float(np.median(time.values)), float(np.median(np.diff(time.values)))
    for unit, least in (("ns", 1e17), ("us", 1e14), ("ms", 1e11), ("s", 1e8)):
        if middle > least:
            return unit, f"as {middle:.6g} then counts from 1970"
    unit = "s" if step < 1 else "ms" if step < 1000 else "us"
    return unit, f"as rows are {step * TO_SECONDS[unit]:.3g} s apart then"


def _bodies(result: Guess, columns: list[LookedAt], path: Path) -> list[LookedAt]:
    """The columns without those of poses."""
    positions, turns, angles = (dict[str, dict[str, LookedAt]]() for _ in range(3))
    for column in columns:
        if not (COMMAND.fullmatch(column.label) or column.label.startswith(("motor", "servo", "tendon"))):
            if match := ANGLE.fullmatch(column.name):
                angles.setdefault(_name(match[1], match[3]), {})[match[2].lower()] = column
            elif match := AXIS.fullmatch(column.name):
                head, kind, axis, tail = match.groups()
                if kind is not None and re.fullmatch(MOVING, kind.lower()):
                    continue
                turned = kind is not None and re.fullmatch(TURNED, kind.lower())
                (turns if turned else positions).setdefault(_name(head, tail), {})[axis.lower()] = column
            elif match := NUMBERED.fullmatch(column.name):
                turns.setdefault(_name(match[1], ""), {})[match[2]] = column
    bodies = {name: axes for name, axes in positions.items() if set("xyz") <= axes.keys()}
    if not bodies and not any(column.name for column in columns) and len(columns) % 3 == 0:
        bodies = {f"body_{i // 3 + 1}": dict(zip("xyz", columns[i : i + 3], strict=True))
                  for i in range(0, len(columns), 3)}  # fmt: skip
        result.why.append("bodies: three columns each, in their order, as they have no names")
    if not bodies:
        some = ", ".join(str(column.key) for column in columns[:12])
        expected = "expected columns of x, y and z, such as tip_x, tip_y, tip_z"
        alone = any(MOTOR.fullmatch(column.label) or COMMAND.fullmatch(column.label) for column in columns)
        more = "; of motors alone, it is the `motors_file` of the poses' `tables`" if alone else ""
        raise InputError(f"{path}: found {some}, {expected}: `tables` in session.yaml is for you to write{more}")
    used = [axes[axis] for axes in bodies.values() for axis in "xyz"]
    result.unit = next((column.unit for column in used if column.unit is not None), None)
    if any(set(axes) == set("wxyz") for name, axes in turns.items() if name in bodies):
        result.tables.append("quaternion: wxyz")
        result.why.append("quaternions: in the order of w, x, y, z, by the columns' names")
    result.tables.append("bodies:")
    for name, axes in bodies.items():
        text = f"position: [{', '.join(_yaml(axes[axis].key) for axis in 'xyz')}]"
        reason, fill = "x, y and z of one name", ""
        if set(axes_of_turn := turns.get(name, {})) == set("wxyz"):
            text += f", quaternion: [{', '.join(_yaml(axes_of_turn[axis].key) for axis in 'wxyz')}]"
            used += axes_of_turn.values()
            reason += ", and its quaternion"
        elif len(axes_of_turn) == 4 and np.allclose(sum(c.values**2 for c in axes_of_turn.values()), 1, atol=1e-2):
            listed = ", ".join(_yaml(column.key) for column in axes_of_turn.values())
            fill = f"  # FILL IN: quaternion: [{listed}], with `quaternion: wxyz` or xyzw above"
            used += axes_of_turn.values()
            reason += "; four numbers of norm 1 are a quaternion, whose order no number tells"
        elif len(turned := angles.get(name) or (axes_of_turn if set(axes_of_turn) == set("xyz") else {})) == 3:
            order = ("roll", "pitch", "yaw") if name in angles else "xyz"
            listed = ", ".join(_yaml(turned[key].key) for key in order)
            unit = next((c.unit for c in turned.values() if c.unit in ("deg", "rad")), "deg")
            fill = f"  # FILL IN: euler: [{listed}], with `euler: {{convention: xyz, unit: {unit}}}` above, or as it is"
            used += turned.values()
            reason += "; of its angles no number tells the convention"
        result.tables.append(f"  {_yaml(name)}: {{{text}}}{fill}")
        result.why.append(f"body {name}: {reason}")
    _gaps(result, [np.stack([axes[axis].values for axis in "xyz"], axis=1) for axes in bodies.values()])
    return [column for column in columns if all(column is not other for other in used)]


def _name(head: str, tail: str) -> str:
    return "_".join(part.strip(" _.:-") for part in (head, tail) if part.strip(" _.:-")) or "body"


def _gaps(result: Guess, bodies: list[np.ndarray]) -> None:
    """Numbers that a body has in all three places again and again."""
    values = [value for value in SENTINELS if any(1 < np.sum((p == value).all(axis=1)) < len(p) for p in bodies)]
    if values:
        result.tables.append(f"gaps: [{', '.join(f'{value:g}' for value in values)}]")
        result.why.append(f"gaps: {' and '.join(f'{value:g}' for value in values)}, in x, y and z of several rows")


def _motors(result: Guess, columns: list[LookedAt]) -> list[LookedAt]:
    """The columns without those of motors; where their unit is not clear, as comments."""
    motors = [c for c in columns if (MOTOR.fullmatch(c.label) or COMMAND.fullmatch(c.label)) and not _is_text(c)]
    if not motors:
        return columns
    simple = set(get_args(MotorEntry.model_fields["unit"].annotation)) - {"rad", "deg", *FORCES}  # no drum, no sign
    units = {c.unit or ("N" if re.search("tension|force", c.label) else None) for c in motors}
    clear = len(units) == 1 and units <= simple
    off = "" if clear else "# "
    for role, some in (("commands", [c for c in motors if not MEASURED.fullmatch(c.label)]),
                       ("tendon_positions", [c for c in motors if MEASURED.fullmatch(c.label)])):  # fmt: skip
        if some:
            listed = ", ".join(f"motor_{i}: {_yaml(c.key)}" for i, c in enumerate(some, 1))
            result.tables.append(f"{off}{role}: {{{listed}}}")
            result.why.append(f"{role}: columns {', '.join(str(c.key) for c in some)}, by their names")
    unit = next(iter(units)) if len(units) == 1 else None
    count = max(sum(bool(MEASURED.fullmatch(c.label)) == kind for c in motors) for kind in (False, True))
    result.metres = METRES.get(unit or "", 1.0)
    result.motors.append(f"{off}motors:  # which tendon each winds in by what it counts is a guess, and so are signs")
    if not clear:
        result.motors.append("#   FILL IN the unit, and take # away here and in `tables`")
    for number in range(1, count + 1):
        text = f"{{unit: {unit or '???'}, tendons: {{tendon_{number}: 1}}}}"
        result.motors.append(f"{off}  motor_{number}: {text}")
    why = f"by their names in {unit}" if clear else f"in {unit or 'a unit that no name tells'}, for you to fill in"
    result.why.append(f"motors: {why}")
    return [column for column in columns if all(column is not motor for motor in motors)]


def _is_text(column: LookedAt) -> bool:
    return not np.isfinite(column.values).any()


def _trials(result: Guess, columns: list[LookedAt]) -> list[LookedAt]:
    """The columns without the one that names trials."""
    for column in columns:
        if not LABEL.fullmatch(column.label):
            continue
        cells = column.texts or [f"{value:.15g}" for value in column.values]
        labels = list(dict.fromkeys(cells))
        changes = 1 + sum(a != b for a, b in zip(cells[:-1], cells[1:], strict=True))
        if 1 < len(labels) == changes <= len(cells) / 5:
            result.tables.append(f"trial: {_yaml(column.key)}")
            result.why.append(f"trials: column {column.key!r}, by its name: {len(labels)} labels, one after the other; "
                              f"below are the frames of the first")  # fmt: skip
            result.labels = labels
            return [other for other in columns if other is not column]
    return columns


def _yaml(value: Key) -> str:
    """A name as YAML has it in a list."""
    plain = isinstance(value, int) or re.fullmatch(r"[A-Za-z_][\w./-]*", value)
    words = ("y", "n", "yes", "no", "on", "off", "true", "false", "null")
    return str(value) if plain and str(value).lower() not in words else json.dumps(value, ensure_ascii=False)
