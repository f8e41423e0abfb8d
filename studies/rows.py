"""Rows of a study that takes long, each kept as soon as it is done: stopped, the study goes on from there.

A row says what it was made of: another arm, other trials or other settings are refused, not mixed in. Rows of other
commits are taken, and named.
"""

import hashlib
from dataclasses import dataclass
from pathlib import Path

import pandas as pd

from trunkline.errors import InputError
from trunkline.pipeline.results import FOLDER, commit_of


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
    """docs/results/<name>.csv. made_of: the digest. key: the column that names a row."""

    name: str
    made_of: str
    key: str
    folder: Path = FOLDER

    @property
    def path(self) -> Path:
        return self.folder / f"{self.name}.csv"

    def read(self) -> dict[str, dict]:
        """The rows so far, by their keys, in their order.

        Raises:
            InputError: they are of something else.
        """
        if not self.path.is_file():
            return {}
        table = pd.read_csv(self.path, dtype={self.key: str, "made_of": str, "commit": str}, keep_default_na=False)
        if others := set(table["made_of"]) - {self.made_of}:
            raise InputError(
                f"{self.path}: found rows of another arm, other trials or other settings ({', '.join(sorted(others))}),"
                f" expected {self.made_of}; delete the file to begin anew"
            )
        return {row[self.key]: row for row in table.to_dict("records")}

    def add(self, key: str, **cells: float | str) -> None:
        """Keep a row. The file is replaced whole, so that a run that is killed leaves no half of one."""
        row = {self.key: key, **cells, "made_of": self.made_of, "commit": commit_of(Path("."))}
        self.folder.mkdir(parents=True, exist_ok=True)
        part = self.path.with_suffix(".part")
        pd.DataFrame([*self.read().values(), row]).to_csv(part, index=False)
        part.replace(self.path)


def other_commits(rows: dict[str, dict]) -> str:
    """A line that says which commits the rows are of, where that is not the present one alone; "" where it is."""
    found = list(dict.fromkeys(row["commit"] for row in rows.values()))
    return f"rows made at commits {', '.join(found)}" if found != [commit_of(Path("."))] else ""
