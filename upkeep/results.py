"""What studies, benchmarks and qualification print, kept beside its command and its origin: docs/results/<name>.json.

`make readme` writes it into the page that has a block `<!-- results/<name> -->`; no figure of a study is typed by hand.
A result whose code has left the tree is archived: its file names the tag that still has that code.
"""

import contextlib
import csv
import io
import json
import re
import shlex
import subprocess
import sys
import textwrap
from collections.abc import Iterator
from dataclasses import asdict, dataclass
from itertools import groupby
from pathlib import Path
from typing import TextIO

from trunkline.errors import InputError
from trunkline.pipeline.checkout import require_checkout
from trunkline.pipeline.stage import write_json
from upkeep.origin import Origin, code_of, git, origin_of, reads_of

FOLDER = Path("docs/results")
COMMANDS = ("studies", "benchmarks", "qualification")  # rooms whose commands keep results
RECORDED = re.compile(r"\b(?:recorded|qualify|Rows)\(\"(\w+)\"")
# the commit of each tag, as a tag may not travel with a clone
ARCHIVES = {"results-1": "f922469a", "results-2": "3a340d6b", "results-3": "c0c74707", "results-4": "4b65c18e",
            "results-5": "0860a52f"}  # fmt: skip


class Both(io.TextIOBase):
    """Writes to a stream, and keeps it."""

    def __init__(self, stream: TextIO):
        self._stream, self._kept = stream, io.StringIO()

    def write(self, text: str) -> int:
        self._kept.write(text)
        return self._stream.write(text)

    def flush(self) -> None:
        self._stream.flush()

    def lines(self) -> list[str]:
        return [line.rstrip() for line in self._kept.getvalue().splitlines() if line.strip()]


@contextlib.contextmanager
def recorded(name: str, keep: bool = True, root: Path = Path("."), origin: Origin | None = None) -> Iterator[None]:
    """What is printed to stdout meanwhile also goes to docs/results/<name>.json, if it ends well.

    Args:
        keep: False for a run whose numbers say nothing, or only part of what the file holds.
        origin: that of rows which are summed up; without one that of the tree.

    Raises:
        InputError: `root` is not the top of a checkout, or has changes that are not committed; before any work.
    """
    if not keep:
        yield
        return
    require_checkout(root)
    command, both = command_line(), Both(sys.stdout)
    origin = origin or origin_of(root, name, modules_of(command))  # first, as somebody may edit meanwhile
    with contextlib.redirect_stdout(both):
        yield
    (root / FOLDER).mkdir(parents=True, exist_ok=True)
    write_json(root / FOLDER / f"{name}.json", {"command": command, **asdict(origin), "lines": both.lines()})


def command_line() -> str:
    """That of this process."""
    return shlex.join(["python", *sys.orig_argv[1:]])


def modules_of(command: str) -> list[str]:
    """Those that a command runs.

    Raises:
        InputError: there is none; what made a result is then unknown.
    """
    if not (found := re.findall(r"(?<=-m )[\w.]+", command)):
        raise InputError(f"{command}: found no module, expected `python -m studies.…` or the like")
    return found


@dataclass(frozen=True)
class KeptResult:
    """A file of docs/results/: what a command printed, and of which code.

    command, lines: as they were run and printed. name: of the file. ran_as: its module's name then, "" if it is the
    same today. unproven: why nobody can name its code, "" of a result that names it. archived: the tag whose code made
    it or can still be read beside it, "" as long as the tree has that code.
    """

    name: str
    command: str
    lines: tuple[str, ...]
    origin: Origin
    ran_as: str = ""
    unproven: str = ""
    archived: str = ""

    @classmethod
    def read(cls, path: Path) -> "KeptResult":
        """
        Raises:
            InputError: it is no such file.
        """
        try:
            content = json.loads(path.read_text(encoding="utf-8"))
            code = content.get("code", {}) if "stale" in content else content["code"]
            return cls(
                path.stem, content["command"], tuple(content["lines"]),
                Origin(content["commit"], content.get("date", ""), code),
                content.get("ran_as", ""), content.get("stale", ""), content.get("archived", ""),
            )  # fmt: skip
        except (ValueError, KeyError, TypeError, AttributeError) as error:
            raise InputError(f"{path}: {error!r}, expected JSON with command, commit and lines of a study") from None

    def state(self, root: Path) -> str:
        """"archived (tag)", "STALE" or "of this code"."""
        if self.archived:
            return f"archived ({self.archived})"
        return "STALE" if self.unproven or self.origin.changed(self._now(root)) else "of this code"

    def problem(self, root: Path) -> str:
        """What is wrong with its state; "" of a right one. Whoever deletes the code of a result archives the result."""
        has_code = self.name in names_recorded(root)
        if self.archived and self.archived not in ARCHIVES:
            return f"{self.name}: archived by {self.archived}, expected a tag of {', '.join(ARCHIVES)}"
        if self.archived and has_code:
            return f"{self.name}: archived, and the tree has its code: it is of this code or STALE"
        if not self.archived and not has_code:
            return f"{self.name}: the tree has no code of it, expected it archived"
        return ""

    def words(self, root: Path) -> str:
        """Its commit, day and state."""
        ran = f"as `{self.ran_as}`, " if self.ran_as else ""
        words = f"{ran}commit {self.origin.commit}" + (f" of {self.origin.date}" if self.origin.date else "")
        if self.archived:
            words += f"; {self.state(root)}: its code stands last in commit {ARCHIVES[self.archived]}"
            return f"{words}; {self.unproven}" if self.unproven else words
        if self.unproven:
            return f"{words}; **STALE**: {self.unproven}"
        now = self._now(root)
        if changed := self.origin.changed(now):
            names, left = [name for name in changed if name in now], sum(name not in now for name in changed)
            names += [f"{left} that it no longer goes through"] if left else []
            return f"{words}; **STALE**, changed since: {', '.join(names)}"
        return f"{words}; nothing that it goes through has changed since"

    def markdown(self, root: Path) -> str:
        """Tables as they are, other lines as they were printed, and of what they are."""
        parts = []
        for is_table, group in groupby(self.lines, key=lambda line: line.startswith("|")):
            text = "\n".join(group)
            again = re.sub(r"\n(.+\n\|-)", r"\n\n\1", text)  # a second header
            parts.append(again if is_table else f"```\n{text}\n```")
        words = textwrap.fill(f"({self.words(root)})", 118, break_long_words=False, break_on_hyphens=False)
        return "\n\n".join([*parts, f"`{self.command}`\n{words}"])

    def _now(self, root: Path) -> dict[str, str]:
        return code_of(root, modules_of(self.command), reads_of(root, self.name))


def kept_results(root: Path) -> list[KeptResult]:
    """All of docs/results/, by name."""
    return [KeptResult.read(path) for path in sorted((root / FOLDER).glob("*.json"))]


def names_recorded(root: Path) -> set[str]:
    """Of the results that the tree's own commands write."""
    files = [file for room in COMMANDS for file in sorted((root / room).rglob("*.py"))]
    return {name for file in files for name in RECORDED.findall(file.read_text(encoding="utf-8"))}


def block(path: Path) -> str:
    """The Markdown of a file of docs/results/, as its page shows it.

    Raises:
        InputError: it is no such file. One that is not there is a study that has not been run since files are kept.
    """
    if not path.is_file():
        return "(no run is kept yet)"
    return KeptResult.read(path).markdown(path.parents[2])


def results_index(root: Path) -> str:
    """Two tables: the results whose code is in the tree, and the archive."""
    pages = {
        name: page.relative_to(root / "docs").as_posix()
        for page in sorted((root / "docs").rglob("*.md"))
        for name in re.findall(r"^<!-- results/(\w+) -->$", page.read_text(encoding="utf-8"), re.MULTILINE)
    }
    tables = []
    for is_archive, title in ((False, "result"), (True, "archived result")):
        lines = [f"| {title} | page | by | commit | day | state |", "|---|---|---|---|---|---|"]
        for result in kept_results(root):
            if bool(result.archived) == is_archive:
                page = pages.get(result.name, "")
                link = f"[{page}](../{page})" if page else "–"
                cells = [f"`{result.name}`", link, f"`{modules_of(result.command)[0]}`", result.origin.commit]
                lines.append(f"| {' | '.join([*cells, result.origin.date or '–', result.state(root)])} |")
        tables.append("\n".join(lines))
    return "\n\n".join(tables)


def not_in_history(root: Path) -> list[str]:
    """A line for each kept result of docs/results, file or row, whose commit is no ancestor of HEAD.

    Raises:
        InputError: the clone is shallow, or there is no Git: it cannot be checked.
    """
    try:
        if git(root, "rev-parse", "--is-shallow-repository").strip() != "false":
            raise InputError(f"{root.resolve()}: found a shallow clone, expected the whole history")
        history = git(root, "rev-list", "HEAD").split()
    except (FileNotFoundError, subprocess.CalledProcessError):
        raise InputError(f"{root.resolve()}: found no Git repository, expected the whole history") from None
    in_history, lines = {commit[:7] for commit in history}, []
    for file in sorted((root / FOLDER).glob("*.json")):
        commits = {json.loads(file.read_text(encoding="utf-8"))["commit"]}
        if file.with_suffix(".csv").is_file():
            with file.with_suffix(".csv").open(newline="", encoding="utf-8") as table:
                commits |= {row["commit"] for row in csv.DictReader(table) if row.get("commit")}
        clean = sorted(commit.removesuffix(" with changes") for commit in commits)
        lines += [f"{file.stem}: commit {commit}" for commit in clean if commit[:7] not in in_history]
    return lines
