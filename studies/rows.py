"""Rows of a study that takes long, each kept as soon as it is done: stopped, the study goes on from there.

A row says what it was made of, and of which code (upkeep/origin.py). Rows of another arm, other settings or
other code stay in the table, and count for nothing. What is done once more is a further row: the first one counts.
"""

import contextlib
import csv
import hashlib
import io
from collections.abc import Iterator
from dataclasses import dataclass
from pathlib import Path

import pandas as pd

from trunkline.files import written_whole
from upkeep.origin import Origin, origin_of
from upkeep.results import FOLDER, command_line, modules_of, recorded

TEXTS = ("made_of", "commit", "code")  # columns


def digest(told: object, *files: Path) -> str:
    """Of what a study is made of: of settings as they are printed, and of files and folders by their bytes."""
    found = hashlib.sha256(repr(told).encode())
    for path in files:
        for file in sorted(path.rglob("*")) if path.is_dir() else [path]:
            if file.is_file():
                found.update(file.read_bytes())
    return found.hexdigest()[:12]


@dataclass
class Rows:
    """docs/results/<name>.csv. made_of: the digest. key: the column that names a row. origin: of the rows to be added.

    Raises:
        InputError: the code is not that of a commit; before any work.
    """

    name: str
    made_of: str
    key: str
    folder: Path = FOLDER
    origin: Origin | None = None

    def __post_init__(self):
        self.origin = self.origin or origin_of(Path("."), self.name, modules_of(command_line()))

    @property
    def path(self) -> Path:
        return self.folder / f"{self.name}.csv"

    def read(self) -> dict[str, dict]:
        """The rows so far that are of the same and of this code, by their keys, in their order: first attempts."""
        rows = [row for row in self._every() if self._counts(row)]
        if not rows:
            return {}
        text, texts = io.StringIO(_text(rows)), dict.fromkeys((self.key, *TEXTS), str)
        found: dict[str, dict] = {}
        for row in pd.read_csv(text, dtype=texts, keep_default_na=False, na_values=["nan"]).to_dict("records"):
            found.setdefault(row[self.key], row)
        return found

    def add(self, key: str, **cells: float | str) -> None:
        """Keep a row. The file is replaced whole, so that a run that is killed leaves no half of one."""
        assert self.origin is not None
        rows = self._every()
        attempt = 1 + sum(row.get(self.key) == key for row in rows)
        last = {"made_of": self.made_of, "commit": self.origin.commit, "code": self.origin.digest, "attempt": attempt}
        self.folder.mkdir(parents=True, exist_ok=True)
        with written_whole(self.path) as part:
            part.write_text(_text([*rows, {self.key: key, **cells, **last}]), encoding="utf-8")

    @contextlib.contextmanager
    def recorded(self, keep: bool) -> Iterator[None]:
        """What is printed meanwhile goes to docs/results/<name>.json, of the rows' origin; a last line says what is in
        the table beside the rows that count."""
        with recorded(self.name, keep, origin=self.origin):
            yield
            if line := self.attempts():
                print(line)

    def attempts(self) -> str:
        """A line that says what is in the table beside the rows that count; "" where there is nothing."""
        others = [row for row in self._every() if not self._counts(row)]
        counted, again = len(self.read()), len(self.uncounted()) - len(others)
        words = [f"{again} further attempts, which do not count"] if again else []
        if others:
            commits = ", ".join(dict.fromkeys(row.get("commit") or "none that is named" for row in others))
            words.append(f"{len(others)} rows of other code or settings, which do not count (commits {commits})")
        return f"{counted} rows, and {' and '.join(words)}" if words else ""

    def uncounted(self) -> list[dict[str, str]]:
        """Further attempts, and rows of other code or settings, as they were written."""
        counted: set[str] = set()
        found = []
        for row in self._every():
            if self._counts(row) and row[self.key] not in counted:
                counted.add(row[self.key])
            else:
                found.append(row)
        return found

    def _every(self) -> list[dict]:
        if not self.path.is_file():
            return []
        with self.path.open(newline="", encoding="utf-8") as file:
            return list(csv.DictReader(file))

    def _counts(self, row: dict) -> bool:
        assert self.origin is not None
        return (row.get("made_of"), row.get("code")) == (self.made_of, self.origin.digest)


def _text(rows: list[dict]) -> str:
    """As CSV; cells that a row has not are empty."""
    written = io.StringIO()
    columns = list(dict.fromkeys(name for row in rows for name in row))
    writer = csv.DictWriter(written, columns, lineterminator="\n")
    writer.writeheader()
    writer.writerows(rows)
    return written.getvalue()
