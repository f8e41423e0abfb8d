"""A session: a folder of logs and the session.yaml that says what they are."""

import difflib
import re
from pathlib import Path
from typing import Annotated, Any, Literal

import numpy as np
from omegaconf import OmegaConf
from pydantic import (
    AfterValidator,
    BeforeValidator,
    Field,
    FiniteFloat,
    PrivateAttr,
    StrictBool,
    ValidationError,
    field_validator,
    model_validator,
)

from trunkline.errors import InputError, nearest
from trunkline.recordings.logs.bag2 import bag_with, recording_name, recordings_in
from trunkline.recordings.session.layout import TABLES, Entry, TableLayout, keys_of_blocks
from trunkline.recordings.session.shared_recordings import check_shared
from trunkline.recordings.session.yaml_lines import with_line
from trunkline.recordings.signals.held import Between
from trunkline.recordings.trials.experiments import EXPERIMENTS, LOAD, PULL, ExperimentName, Level
from trunkline.recordings.trials.recording import FORCE, LENGTH
from trunkline.recordings.trials.splits import SplitName
from trunkline.settings import read_yaml, rename_keys

NONE = "none"  # in place of a topic's name
RENAMED = {"segments": "markers"}  # keys of the release before


def _folder_name(name: str) -> str:
    if not name or name.startswith(".") or {"/", "\\"} & set(name):
        raise ValueError(f"found {name!r}, expected the name of a folder, without a path")
    return name


SessionName = Annotated[str, AfterValidator(_folder_name)]


def _no_list(value):
    if isinstance(value, list):
        names = ", ".join(map(str, value))
        raise ValueError(
            f"found a list, expected one folder: move these sessions into one, such as data/raw/arm_7, and write "
            f"session: arm_7, only: [{names}]"
        )
    return value


def _each_once(names: list[str]) -> list[str]:
    twice = next((name for name in names if names.count(name) > 1), None)
    if twice is not None:
        raise ValueError(f"found {twice!r} twice, expected each session once")
    return names


OneFolder = Annotated[SessionName, BeforeValidator(_no_list)]
SomeSessions = Annotated[list[SessionName], AfterValidator(_each_once)]
Vector = tuple[FiniteFloat, FiniteFloat, FiniteFloat]


class MocapFrame(Entry):
    """The motion-capture frame: which way is up in it, and the unit of its positions.

    name: for logs of transforms between several frames, the one that the poses are wanted in; by default the nearest
    that holds them all. gravity: "none" for an arm that is too light or too stiff to feel it; `up` then only says how
    the frame is turned.
    """

    name: str | None = None
    up: Vector
    unit: Literal["m", "mm", "cm", "inch"] = "m"
    gravity: Literal["standard", "none"] = "standard"

    @model_validator(mode="after")
    def _direction(self):
        if np.linalg.norm(self.up) < 1e-6:
            raise ValueError("up: found the zero vector, expected the direction against gravity")
        return self

    def up_direction(self) -> np.ndarray:
        """(3,), a unit vector."""
        return np.array(self.up) / np.linalg.norm(self.up)


class FixedBase(Entry):
    """Where no body marks the mount: its pose in the motion-capture frame. By default its z axis is up.

    body: a tracked point on the mount from which `position` is: where it rests in each log, or trial of a table.
    """

    position: Vector
    body: str | None = None
    quaternion: tuple[FiniteFloat, FiniteFloat, FiniteFloat, FiniteFloat] | None = None

    @model_validator(mode="after")
    def _rotation(self):
        if self.quaternion is not None and np.linalg.norm(self.quaternion) < 1e-6:
            raise ValueError("quaternion: found norm zero, expected (w, x, y, z) of a rotation")
        return self


class Topics(Entry):
    """Topic names; what is left out is found by its schema. poses: one topic, or body to topic.

    commands, tendon_positions: one topic, several, or motor to topic; `none` where no topic is one.
    """

    poses: str | dict[str, str] | None = None
    commands: str | list[str] | dict[str, str] | None = None
    tendon_positions: str | list[str] | dict[str, str] | None = None

    @field_validator("commands", "tendon_positions", mode="before")
    @classmethod
    def _left_out(cls, names):
        return names or NONE  # an empty value in session.yaml means that there is none

    def of(self, key: str) -> list[str]:
        """All topics that `commands` or `tendon_positions` names."""
        names = getattr(self, key)
        names = [] if names in (None, NONE) else names
        return [names] if isinstance(names, str) else list(names.values() if isinstance(names, dict) else names)


UNITS = {"m": 1.0, "mm": 1e-3, "rad": 1.0, "deg": np.pi / 180}
FORCES = ("N", "Nm", "effort")  # units of motors that are commanded by what they pull with


class MotorEntry(Entry):
    """What a motor's name in the log stands for, where that is not the pull of one tendon in metres.

    unit: of its numbers: of a length, of a drum's angle, of a tension, of a drum's torque, or "effort", which is N of
    tension but for a factor that is to be identified. spool_radius: m, of the drum of one that turns. tendons: name in
    the model to how far the motor winds it in, or by what tension it pulls it, times what the number says; less than 0
    for one that is paid out.
    """

    unit: Literal["m", "mm", "rad", "deg", "N", "Nm", "effort"]
    spool_radius: Annotated[FiniteFloat, Field(gt=0, le=1)] | None = None
    tendons: dict[str, FiniteFloat] = Field(min_length=1)

    @model_validator(mode="after")
    def _drum(self):
        turns = self.unit in ("rad", "deg", "Nm")
        if turns and self.spool_radius is None:
            raise ValueError(f"spool_radius: missing, expected that of a motor that counts {self.unit}, m")
        if not turns and self.spool_radius is not None:
            raise ValueError(f"spool_radius: found {self.spool_radius}, expected none for a motor that counts "
                             f"{self.unit}")
        return self

    @property
    def full_turn(self) -> float | None:
        """In the unit of its numbers; None of a motor that does not count angles."""
        return {"rad": 2 * np.pi, "deg": 360.0}.get(self.unit)

    @property
    def scale(self) -> float:
        """m of cable, or N of tension in it, for each unit of its numbers."""
        if self.unit in FORCES:
            return 1 / (self.spool_radius or 1.0)
        return UNITS[self.unit] * (self.spool_radius or 1.0)


class Rows(Entry):
    """Which rows of a table, from 1, are a trial's poses: those from `first` to `last`, but none of the trials that
    `without` names. draw: how many of these, drawn with `seed`."""

    first: Annotated[int, Field(strict=True, ge=1)] = 1
    last: Annotated[int, Field(strict=True, ge=1)]
    without: list[str] = []
    draw: Annotated[int, Field(strict=True, ge=2)] | None = None
    seed: Annotated[int, Field(strict=True, ge=0)] | None = None

    @model_validator(mode="after")
    def _complete(self):
        if self.last < self.first:
            raise ValueError(f"last: found {self.last}, expected no row before `first`, {self.first}")
        if (self.draw is None) != (self.seed is None):
            missing = "seed" if self.seed is None else "draw"
            raise ValueError(f"{missing}: missing, expected both `draw` and `seed`, or none")
        return self

    def chosen(self, taken: set[int]) -> np.ndarray:
        """Their numbers, from 1, in their order, of those that are not `taken`. Shape (T,).

        Raises:
            ValueError: fewer are left than are drawn.
        """
        rows = np.array([row for row in range(self.first, self.last + 1) if row not in taken], dtype=int)
        if self.draw is None:
            return rows
        if self.draw > len(rows):
            raise ValueError(f"draw: found {self.draw}, expected at most the {len(rows)} rows that are left")
        return np.sort(np.random.default_rng(self.seed).choice(rows, self.draw, replace=False))


class TrialEntry(Entry):
    """window: s from the log's first pose. level: in the unit of the experiment. load: kg at the tip.

    label: what the column `tables.trial` says in this trial's rows; by default its name. table: what of `tables` is
    otherwise in this trial's file. rows: which of the table's rows are its poses, by default all.
    """

    name: str = ""
    file: str
    label: str | int | float | None = None
    table: dict[str, Any] = {}
    rows: Rows | None = None
    window: tuple[FiniteFloat, FiniteFloat] | None = None
    experiment: ExperimentName
    level: FiniteFloat | None = None
    load: FiniteFloat = 0.0
    split: SplitName
    _chosen: tuple[int, ...] | None = PrivateAttr(default=None)

    @field_validator("level", "load", mode="before")
    @classmethod
    def _number(cls, value):
        if isinstance(value, bool):
            raise ValueError(f"found {str(value).lower()}, expected a number")
        return value

    @model_validator(mode="after")
    def _complete(self):
        if self.window is not None and not self.window[0] < self.window[1]:
            raise ValueError(f"window: found {list(self.window)}, expected [start, end] with start < end")
        level = EXPERIMENTS[self.experiment].level
        if level is not None:
            if self.level is None:
                raise ValueError(f"level: missing, expected the nominal level of a {self.experiment}")
            self._check("level", self.level, level)
        self._check("load", self.load, LOAD)
        name = recording_name(self.file)
        self.name = self.name or (name if self.label is None else f"{name}_{self.label}")
        return self

    @property
    def chosen(self) -> tuple[int, ...] | None:
        """Rows of the table, from 1, as `rows` has them; None for all."""
        return self._chosen

    @property
    def of_table(self) -> bool:
        return Path(self.file).suffix.lower() in TABLES

    def _check(self, key: str, value: float, level: Level) -> None:
        if not level.low <= value <= level.high:
            expected = f"{level.low:g} to {level.high:g}, the {level.says} of a {self.experiment}"
            raise ValueError(f"{key}: found {value:g}, expected {expected}")


class Session(Entry):
    """base: the body that marks the mount, or its pose. markers, tendons: name in the log to name in the model.

    bodies: names of the poses, in order, where messages hold them without. A list of tendons does the same for numbers.
    clock: what dates a pose: its header's stamp, the recorder's log time, or its frame number at the rate
    that the stamps show. With `log`, commands and tendon positions are dated by it too.
    even_times: whether frames that seem late are dated as cameras take them, at one rate; not where every time is known
    to be right, as in a log that is thinned out while nothing moves.
    tables: how trials are read whose files are no MCAP logs, but tables.
    motors: name in the log to what it moves, in place of `tendons`, where motors count otherwise than in metres of a
    tendon's pull, or move several.
    commands: whether they hold until the next, or go on in a straight line to it; by default they hold, but for ramps
    whose samples come evenly.
    shared: what is to be said of trials that share data, by trial; see `check_shared`. unlisted: the folder's logs, and
    what logs can be made of, that no trial is of.
    """

    frame: MocapFrame
    base: str | FixedBase
    markers: dict[str, str] | None = Field(default=None, min_length=1)
    tendons: dict[str, str] | None = Field(default=None, min_length=1)
    motors: dict[str, MotorEntry] | None = Field(default=None, min_length=1)
    topics: Topics = Topics()
    bodies: list[str] | None = Field(default=None, min_length=1)
    tables: TableLayout | None = None
    clock: Literal["stamp", "log", "frame"] = "stamp"
    even_times: StrictBool = True
    commands: Between | None = None
    trials: list[TrialEntry] = Field(min_length=1)
    _shared: dict[str, list[str]] = PrivateAttr(default_factory=dict)
    _unlisted: list[str] = PrivateAttr(default_factory=list)

    @property
    def command_unit(self) -> str:
        """Of a trial's commands: LENGTH or FORCE."""
        return FORCE if any(motor.unit in FORCES for motor in (self.motors or {}).values()) else LENGTH

    def coupling(self) -> tuple[tuple[str, ...], np.ndarray]:
        """Names of the tendons that `motors` moves, and by how much, in `command_unit` for each unit of a motor's
        numbers. Shape (tendons, motors)."""
        motors = list((self.motors or {}).values())
        names = tuple(dict.fromkeys(name for motor in motors for name in motor.tendons))
        moved = [[motor.scale * motor.tendons.get(name, 0.0) for motor in motors] for name in names]
        return names, np.array(moved).reshape(len(names), len(motors))

    def _unturned(self, layout: TableLayout) -> str:
        """Why poses that are relative to the base cannot be put into the world; empty where they can."""
        if isinstance(self.base, FixedBase):
            return "" if self.base.quaternion else "quaternion missing, expected how it is turned"
        body = layout.bodies.get(self.base)
        if body is None:
            return f"found {self.base!r}, expected one of `bodies` of `tables`{nearest(self.base, list(layout.bodies))}"
        return "" if body.quaternion or body.euler else f"found no orientation of {self.base!r}, expected its columns"

    def layout_of(self, trial: TrialEntry) -> TableLayout:
        """What the columns of a trial's table are. Raises ValueError where `table` of the trial says it wrongly."""
        assert self.tables is not None, "of a session with tables"
        stated = {key: getattr(self.tables, key) for key in self.tables.model_fields_set}
        return TableLayout.model_validate(stated | trial.table) if trial.table else self.tables

    def motors_files(self) -> set[str]:
        """Tables of motors alone."""
        layouts = [self.layout_of(trial) for trial in self.trials if trial.of_table] if self.tables else []
        return {layout.motors_file.file for layout in layouts if layout.motors_file is not None}

    @property
    def shared(self) -> dict[str, list[str]]:
        return self._shared

    @property
    def unlisted(self) -> list[str]:
        return self._unlisted

    @field_validator("base", mode="before")
    @classmethod
    def _name_or_pose(cls, base):
        if not isinstance(base, str | dict):
            raise ValueError(f"found {base!r}, expected a body's name, or {{position: [x, y, z]}}")
        return base

    @field_validator("tendons", mode="before")
    @classmethod
    def _by_place(cls, names):
        return {str(place): name for place, name in enumerate(names, 1)} if isinstance(names, list) else names

    @model_validator(mode="after")
    def _one_to_one(self):
        if self.motors is not None and self.tendons is not None:
            raise ValueError("motors: found it beside `tendons`, expected one of the two")
        for key in ("markers", "tendons"):
            names = list((getattr(self, key) or {}).values())
            twice = next((name for name in names if names.count(name) > 1), None)
            if twice is not None:
                raise ValueError(f"{key}: found {twice!r} twice, expected each name of the model once")
        return self

    @model_validator(mode="after")
    def _of_forces(self):
        """Motors that are commanded by force are so all of them, and nothing measures them in their unit."""
        if self.command_unit != FORCE:
            return self
        units = {name: motor.unit for name, motor in (self.motors or {}).items()}
        if lengths := [name for name, unit in units.items() if unit not in FORCES]:
            expected = f"a unit of force ({', '.join(FORCES)}) as others have it, or all motors by lengths"
            raise ValueError(f"motors.{lengths[0]}.unit: found {units[lengths[0]]!r}, expected {expected}")
        if self.topics.of("tendon_positions") or (self.tables is not None and self.tables.tendon_positions):
            raise ValueError("tendon_positions: found it of motors that are commanded by force, expected none: lengths "
                             "and forces do not share a unit")  # fmt: skip
        for index, trial in enumerate(self.trials):
            if EXPERIMENTS[trial.experiment].level is PULL:
                problem = f"found a {trial.experiment}, whose level is in mm of pull"
                expected = "expected a motion, as motors are commanded by force"
                raise ValueError(f"trials.{index}.experiment: {problem}, {expected}")
        return self

    @model_validator(mode="after")
    def _of_rows(self):
        """Each trial's rows, after those that it goes without."""
        before: dict[str, set[int]] = {}
        for index, trial in enumerate(self.trials):
            if trial.rows is None:
                continue
            where = f"trials.{index}.rows"
            if not EXPERIMENTS[trial.experiment].stepwise:
                raise ValueError(f"{where}: found it of a {trial.experiment}, expected `window`: only in a static_path "
                                 "is every row a pose at rest of its own")  # fmt: skip
            for name in trial.rows.without:
                if name not in before:
                    some = f"a trial with `rows` above{nearest(name, list(before))}"
                    raise ValueError(f"{where}.without: found {name!r}, expected {some}")
            try:
                rows = trial.rows.chosen(set().union(*(before[name] for name in trial.rows.without)))
            except ValueError as error:
                raise ValueError(f"{where}.{error}") from error
            trial._chosen = tuple(rows.tolist())
            before[trial.name] = set(trial._chosen)
        return self

    @model_validator(mode="after")
    def _of_tables(self):
        for index, trial in enumerate(self.trials):
            where = f"trials.{index}"
            if not trial.of_table or self.tables is None:
                fields = {"label": trial.label is not None, "table": bool(trial.table), "rows": trial.rows is not None}
                key = next((key for key, is_there in fields.items() if is_there), None)
                if key is not None:
                    raise ValueError(f"{where}.{key}: found it without `tables`, or of a log, expected none")
                continue
            try:
                layout = self.layout_of(trial)
            except ValidationError as error:
                raise ValueError(f"{where}.table: {_describe(error)}") from error
            if layout.trial is None and trial.label is not None:
                raise ValueError(f"{where}.label: found {trial.label!r}, expected none, or `trial` in `tables`: the "
                                 "column that has it")  # fmt: skip
            if layout.frame == "base" and (problem := self._unturned(layout)):
                raise ValueError(f"base: {problem}, as `tables` has `frame: base`")
            if layout.trial is not None and trial.label is None:
                trial.label = trial.name
        return self


def sessions_in(folder: Path) -> list[str]:
    """Names of the sessions that a folder holds."""
    return sorted(file.parent.name for file in folder.glob("[!.]*/session.yaml"))


def session_folders(folder: Path, only: list[str] | None = None) -> dict[str, Path]:
    """Folders of the sessions that are to be read together, by name: of several that `folder` holds all, in the order
    of their names, or `only` those; else `folder` itself.

    Raises:
        InputError: `only` names what it does not hold.
    """
    inside = [] if (folder / "session.yaml").is_file() else sessions_in(folder)
    for name in only or []:
        if name not in inside:
            there = f"one of the sessions in {folder}: {', '.join(inside)}{nearest(name, inside)}"
            expected = there if inside else f"none, as {folder} holds no several sessions"
            raise InputError(f"ingest.only: found {name!r}, expected {expected}")
    return {name: folder / name for name in only or inside} or {folder.name: folder}


def logs_in(folder: Path) -> list[str]:
    """The logs of a session by their paths below it: its own, then those one folder down; a folder that ROS 2 recorded
    is one."""
    return [log.relative_to(folder).as_posix() for log in recordings_in(folder)]


def tables_in(folder: Path) -> list[str]:
    """The tables of a folder, or one further down, as `logs_in` has logs."""
    files = [file for level in ("[!.]*", "[!.]*/[!.]*") for file in sorted(folder.glob(level)) if file.is_file()]
    return [file.relative_to(folder).as_posix() for file in files if file.suffix.lower() in TABLES]


TABLE_REMEDY = "`trunkline inspect` proposes a session.yaml that reads such tables"


def unread_in(folder: Path) -> dict[str, list[str]]:
    """Recordings of a folder, and of folders in it, that are none of `logs_in`, by what to do with them."""
    remedies = {
        "[!.]*.mcap.lz4": "decompress them, as by `lz4 -d`",
        "[!.]*.bag.active": "`rosbag reindex` makes bags of them that are closed",
    }
    by_remedy = {remedy: [*folder.glob(f"[!.]*/{of}"), *folder.glob(of)] for of, remedy in remedies.items()}
    inner = [sub for sub in folder.glob("[!.]*/[!.]*/") if not (sub.parent / "session.yaml").is_file()]
    by_remedy["they lie two folders down, or deeper: move them up"] = [
        log for sub in inner for log in recordings_in(sub)
    ]
    by_remedy[TABLE_REMEDY] = [folder / table for table in tables_in(folder)]
    return {
        remedy: sorted(file.relative_to(folder).as_posix() for file in files)
        for remedy, files in by_remedy.items()
        if files
    }


def unreadable_in(folder: Path) -> str:
    """What else is there of which logs can be made, and how, as the end of a sentence; empty where nothing is."""
    return "".join(f"; found {some_of(files)}: {remedy}" for remedy, files in unread_in(folder).items())


def some_of(files: list[str]) -> str:
    """Some of the files, and how many there are, in words."""
    return ", ".join(files[:3]) + (f" and {len(files) - 3} more" if len(files) > 3 else "")


def named_logs(path: Path) -> set[str]:
    """The logs that a session.yaml names, whatever else is wrong with it."""
    content = OmegaConf.to_container(read_yaml(path), resolve=False)
    trials = content.get("trials") if isinstance(content, dict) else None
    entries = trials if isinstance(trials, list) else []
    return {str(trial.get("file")) for trial in entries if isinstance(trial, dict)}


def read_session(folder: Path, files: set[str] | None = None) -> Session:
    """Read and check `folder`/session.yaml.

    Args:
        files: logs that are there so far; others, and the trials of them, are left out. By default all logs must be.

    Raises:
        InputError: naming the file and key, what was found and what was expected.
    """
    folder = Path(folder)
    path = folder / "session.yaml"
    logs, tables = (logs_in(folder), tables_in(folder)) if folder.is_dir() else (None, [])
    if logs is None:
        there = ", ".join(sessions_in(folder.parent)) or "none yet"
        raise InputError(f"{folder}: no such folder, expected a session of logs and a session.yaml; found {there}")
    if not path.is_file():
        deeper = sum("/" in log for log in logs)
        place = f" ({deeper} of them one folder down)" if deeper else ""
        remedy = "`trunkline inspect` proposes one" if logs else f"expected both{unreadable_in(folder)}"
        raise InputError(f"{folder}: found {len(logs)} logs{place} and no session.yaml, {remedy}")
    content = OmegaConf.to_container(read_yaml(path), resolve=False)
    assert isinstance(content, dict)
    rename_keys(content, RENAMED, str(path))
    if files is not None:
        logs, tables = ([file for file in some if file in files] for some in (logs, tables))
        content["trials"] = [trial for trial in content["trials"] if trial["file"] in files]
    try:
        session = Session.model_validate(content)
    except ValidationError as error:
        raise InputError(with_line(path, _describe(error))) from error
    logs += tables if session.tables is not None else []
    bags = {trial.file: bag_with(folder / trial.file) for trial in session.trials if trial.file not in logs}
    for index, trial in enumerate(session.trials):
        if trial.file in tables and session.tables is None:
            expected = "expected `tables`, which says what its columns are (`trunkline inspect` proposes it)"
            problem = f"trials.{index}.file: found the table {trial.file!r}, {expected}"
            raise InputError(with_line(path, problem))
        if trial.file not in logs and bags[trial.file] is None:
            close = difflib.get_close_matches(trial.file, logs, n=1) or logs[:1]
            expected = f"one of the folder's {len(logs)} logs" + (f", such as {close[0]}" if close else "")
            raise InputError(with_line(path, f"trials.{index}.file: found {trial.file!r}, expected {expected}"))
    names = [trial.name for trial in session.trials]
    for index, name in enumerate(names):
        if name in names[:index]:
            problem = f"trials.{index}.name: found {name!r} again, expected each name once"
            raise InputError(with_line(path, problem))
    session._shared = check_shared(folder, session.trials)
    of_bags = {bag.relative_to(folder).as_posix() for bag in bags.values() if bag is not None}
    listed = {trial.file for trial in session.trials} | of_bags | session.motors_files()
    others = [file for remedy, files in unread_in(folder).items() if remedy != TABLE_REMEDY for file in files]
    session._unlisted = sorted({*logs, *others} - listed)
    return session


def _describe(error: ValidationError) -> str:
    """The first problem in one line, and how many more there are."""
    problems = error.errors()
    # a union reports each of its branches; the deepest says what is wrong within the branch that was meant
    problem = max(problems, key=lambda p: (p["type"] in ("extra_forbidden", "value_error"), -problems.index(p)))
    loc = [part for part in problem["loc"] if part != "str" and "FixedBase" not in str(part)]  # pydantic's branches
    key = ".".join(map(str, loc)) or "the file"
    more = f" (and {len(problems) - 1} more)" if len(problems) > 1 else ""
    if problem["type"] == "missing":
        return f"{key}: missing, expected a value{more}"
    if problem["type"] == "extra_forbidden":
        return f"{key}: unknown key{nearest(str(loc[-1]), keys_of_blocks())}{more}"
    if problem["type"] == "value_error":
        key = f"{key}: " if problem["loc"] else ""
        return f"{key}{problem['msg'].removeprefix('Value error, ')}{more}"
    expected = problem["msg"].removeprefix("Input should be ")
    if problem["type"] == "tuple_type":
        expected = "a list of numbers, such as [0, 1, 0]"
    if problem["type"] == "literal_error":
        expected += nearest(str(problem["input"]), re.findall(r"'([^']*)'", expected))
    return f"{key}: found {problem['input']!r}, expected {expected}{more}"
