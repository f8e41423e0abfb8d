"""The sessions in a monitored folder, and which of their logs are complete.

A folder is looked at again and again, not subscribed to: the kernel's notices (inotify, and the libraries over it) do
not tell of what another machine writes to a network drive, where labs keep their logs, and a look costs a few stats.

A log is whole when it ends as MCAP says, which needs no clock and no guess at how long a recorder may pause. One that
does not is still being written or copied, or was cut off: it is left until it changes, or taken with what can be
salvaged once it has not changed for `PATIENCE` seconds.
"""

from dataclasses import dataclass
from pathlib import Path

from omegaconf import OmegaConf

from trunkline.errors import InputError
from trunkline.recordings.logs.records import MAGIC
from trunkline.settings import read_yaml

PATIENCE = 600.0  # s


@dataclass(frozen=True)
class LogState:
    """Of a file: what changes when it does. whole: whether it ends as a log should."""

    size: int
    modified: int
    whole: bool

    @property
    def mark(self) -> str:
        return f"{self.size}-{self.modified}"


def state_of(log: Path) -> LogState | None:
    """None where there is no such file."""
    try:
        status = log.stat()
        with log.open("rb") as file:
            file.seek(max(status.st_size - len(MAGIC), 0))
            end = file.read()
    except OSError:  # gone, or not yet to be read
        return None
    return LogState(status.st_size, status.st_mtime_ns, status.st_size > 2 * len(MAGIC) and end == MAGIC)


def sessions_of(folder: Path) -> list[Path]:
    """The folder itself where it has a session.yaml, and each folder in it that has one, by name.

    Raises:
        InputError: it is no folder.
    """
    if not folder.is_dir():
        raise InputError(f"{folder}: no such folder, expected one into which sessions are dropped")
    folders = sorted(file.parent for file in folder.glob("[!.]*/session.yaml"))
    return [folder, *folders] if (folder / "session.yaml").is_file() else folders


def without_session(folder: Path) -> list[Path]:
    """Folders with logs and no session.yaml, the watched one among them; not those of a session, a folder a log."""
    logs = [*folder.glob("*.mcap"), *folder.glob("[!.]*/*.mcap")]
    bags = {log.parent for log in logs if (log.parent.parent / "session.yaml").is_file()}
    return sorted({log.parent for log in logs if not (log.parent / "session.yaml").is_file()} - bags)


def planned(session: Path) -> list[dict]:
    """The trials of a session.yaml, as it has them: it may name logs that are yet to come.

    Raises:
        InputError: the file cannot be read, or has no list of trials.
    """
    path = session / "session.yaml"
    content = OmegaConf.to_container(read_yaml(path), resolve=False)
    trials = content.get("trials") if isinstance(content, dict) else None
    if not isinstance(trials, list) or not all(isinstance(trial, dict) and "file" in trial for trial in trials):
        raise InputError(f"{path}: trials: found {trials!r:.40}, expected a list of trials, each with its file")
    return trials


def name_of(trial: dict) -> str:
    return str(trial.get("name") or Path(str(trial["file"])).stem)
