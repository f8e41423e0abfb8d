"""Logs that a monitor waits for, and the lines printed about them: once, not at every look."""

import json
import time
from pathlib import Path

from trunkline.files import written_whole
from trunkline.tools.monitor.inbox import PATIENCE, LogState


class PendingFiles:
    """Stored in the file `path`, so that a command that looks once and ends waits as one that stays does."""

    def __init__(self, path: Path):
        self._path = path
        content = json.loads(path.read_text(encoding="utf-8")) if path.is_file() else {}
        self._marks: dict[str, list] = content.get("seen", {})  # log → mark, and when it was first seen so, s
        self._printed: dict[str, str] = content.get("said", {})

    def ready(self, log: Path, state: LogState) -> bool:
        """Whether a log can be loaded: complete, or unchanged for long. Prints a line where it cannot yet."""
        if state.whole:
            return True
        mark, since = self._marks.get(f"{log}", ["", 0.0])
        now = time.time()
        if mark != state.mark:
            self._marks[f"{log}"] = [state.mark, now]
            self._keep()
            since = now
        if now - since >= PATIENCE:
            self.say(f"{log}", f"{log}: cut off, and as it is for {PATIENCE / 60:.0f} min: taken with what is left")
            return True
        self.say(f"{log}", f"{log}: not whole yet ({state.size} bytes, no end): waits until it changes")
        return False

    def say(self, key: str, line: str) -> bool:
        """Print a line unless it was the last one about `key`; whether it was printed."""
        head = line.split(" (")[0]  # a log that grows is not printed at every size
        if self._printed.get(key) == head:
            return False
        self._printed[key] = head
        self._keep()
        print(f"monitor: {line}", flush=True)
        return True

    def forget(self, key: str) -> None:
        """The line about `key` is out of date: the next one is printed."""
        if self._printed.pop(key, None) is not None:
            self._keep()

    def _keep(self) -> None:
        with written_whole(self._path) as part:
            part.write_text(json.dumps({"seen": self._marks, "said": self._printed}), encoding="utf-8")
