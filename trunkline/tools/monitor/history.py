"""The history of a drift monitor: lines of JSON beside its chart, so that it goes on where it was stopped.

The file is replaced whole after every trial, so a killed process leaves no half a line. The first line names the model
and the parameters; another model is refused, as its scores are about another arm.
"""

import fcntl
import json
from collections.abc import Iterator
from contextlib import contextmanager
from dataclasses import dataclass, field
from pathlib import Path

import numpy as np

from trunkline.errors import InputError
from trunkline.files import file_digest, written_whole
from trunkline.tools.monitor.scores import Score


@dataclass
class History:
    """made_of: what all scores are of. rows: a row a trial that was scored, refused or is awaited, in their order."""

    path: Path
    made_of: dict
    rows: list[dict] = field(default_factory=list)

    @classmethod
    def opened(cls, path: Path, made_of: dict, replace: bool = False) -> "History":
        """The history at `path`, or an empty one. replace: whether that of another model is replaced, not refused.

        Raises:
            InputError: it is of another model, or of something else.
        """
        if not path.is_file():
            return cls(path, made_of)
        try:
            head, *rows = [json.loads(line) for line in path.read_text(encoding="utf-8").splitlines()]
        except ValueError as error:
            raise InputError(f"{path}: {error}, expected lines of JSON that this command wrote") from error
        if head != made_of:
            if replace:
                return cls(path, made_of)
            differs = ", ".join(key for key in made_of if head.get(key) != made_of[key])
            raise InputError(f"{path}: found scores of other {differs}, expected the same; begin anew with --out")
        return cls(path, made_of, rows)

    def add(self, **row) -> None:
        """Add a row, in place of an earlier one of the same trial."""
        key = (row["session"], row["trial"])
        self.rows = [other for other in self.rows if (other["session"], other["trial"]) != key] + [row]
        self.path.parent.mkdir(parents=True, exist_ok=True)
        with written_whole(self.path) as part:
            part.write_text("".join(json.dumps(line) + "\n" for line in (self.made_of, *self.rows)), encoding="utf-8")

    def of(self, session: str, trial: str) -> dict | None:
        """The row of a trial."""
        return next((row for row in self.rows if (row["session"], row["trial"]) == (session, trial)), None)

    def scores(self) -> list[tuple[dict, Score]]:
        """Rows of trials that were scored, with their scores, in the order in which they came."""
        return [(row, read_score(row)) for row in self.rows if "slope" in row]


def score_row(score: Score) -> dict:
    """A score as a row of JSON."""
    row = {"kind": score.kind, "level": score.level, "load": score.load}
    return row | {"slope": score.slope.tolist(), "curvature": score.curvature.tolist()}


def read_score(row: dict) -> Score:
    slope, curvature = np.array(row["slope"]), np.array(row["curvature"])
    return Score(row["trial"], row["kind"], row["level"], row["load"], slope, curvature)


def digest(path: Path) -> str:
    """Of a file's bytes."""
    return file_digest(path)[:16]


@contextmanager
def alone(folder: Path) -> Iterator[None]:
    """Refuse a second monitor of the same state, such as of a cron job that comes before the last one is done.

    Raises:
        InputError: there is one.
    """
    folder.mkdir(parents=True, exist_ok=True)
    with (folder / "lock").open("w") as file:
        try:
            fcntl.flock(file, fcntl.LOCK_EX | fcntl.LOCK_NB)
        except OSError as error:
            raise InputError(f"{folder}: found another monitor at work there, expected one at a time") from error
        yield
