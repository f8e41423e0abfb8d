"""Progress of a long stage: a live bar on a terminal, plain lines where there is none.

tqdm would write one ever longer line into a log, as it goes back to its beginning for each update.
"""

import sys
import time
from collections.abc import Iterator
from contextlib import contextmanager

from rich.console import Console
from rich.progress import (
    BarColumn,
    MofNCompleteColumn,
    Progress,
    TextColumn,
    TimeElapsedColumn,
    TimeRemainingColumn,
)

PLAIN_INTERVAL = 5.0  # s between plain lines


class _Bar:
    """A rich bar; what matters stands at its right end."""

    def __init__(self, bar: Progress, total: int, label: str, unit: str):
        self._bar = bar
        self._total, self._unit = total, unit
        self._task = bar.add_task(label, total=total, info="")
        self._rate = _Rate()

    def update(self, n: int = 1, **info: object) -> None:
        """Count `n` more units and show `info` (generation, best loss, ...)."""
        rate = self._rate.add(n)
        self._bar.update(self._task, advance=n, info=_words(info | {f"{self._unit}/s": rate}))

    def expect(self, more: int) -> None:
        """There are so many more units than expected so far, or fewer where it is negative."""
        self._total += more
        self._bar.update(self._task, total=self._total)


class _Lines:
    """Plain lines: one at once, one every few seconds and one at the end."""

    def __init__(self, total: int, label: str, unit: str):
        self._total, self._label, self._unit = total, label, unit
        self._done, self._info = 0, {}
        self._rate = _Rate()
        self._printed = time.monotonic()

    def update(self, n: int = 1, **info: object) -> None:
        """Count `n` more units and, every few seconds, print a line with `info`."""
        self._done += n
        self._info = info | {f"{self._unit}/s": self._rate.add(n)}
        if self._done < self._total and time.monotonic() - self._printed >= PLAIN_INTERVAL:
            self.line()

    def expect(self, more: int) -> None:
        """There are so many more units than expected so far, or fewer where it is negative."""
        self._total += more

    def line(self) -> None:
        self._printed = time.monotonic()
        share = f" ({100 * self._done / self._total:.0f} %)" if self._total else ""
        words = _words(self._info)
        print(f"{self._label}: {self._done}/{self._total} {self._unit}{share}{'  ' if words else ''}{words}",
              flush=True)


class _Rate:
    """Mean rate since the start, in units per second."""

    def __init__(self):
        self._started, self._done = time.monotonic(), 0

    def add(self, n: int) -> float:
        self._done += n
        return self._done / max(time.monotonic() - self._started, 1e-9)


def _words(info: dict[str, object]) -> str:
    return "  ".join(f"{k} {v:.4g}" if isinstance(v, float) else f"{k} {v}" for k, v in info.items())


@contextmanager
def progress(total: int, label: str, unit: str = "steps") -> Iterator[_Bar | _Lines]:
    """Show the progress of `total` units; call `.update(n, **info)` on what this yields, `.expect(more)` where there
    turn out to be more or fewer.

    Args:
        total: how many units make up the whole.
        label: what runs, e.g. `"identify_damping coarse"`.
        unit: plural noun for the count and the rate, e.g. `"generations"`.
    """
    if sys.stdout.isatty():
        columns = (TextColumn("{task.description}"), BarColumn(bar_width=24), MofNCompleteColumn(),
                   TimeElapsedColumn(), TimeRemainingColumn(), TextColumn("{task.fields[info]}"))
        with Progress(*columns, console=Console(file=sys.stdout)) as bar:
            yield _Bar(bar, total, label, unit)
    else:
        lines = _Lines(total, label, unit)
        lines.line()
        yield lines
        lines.line()
