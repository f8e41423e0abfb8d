"""`python -m trunkline.pipeline.baseline "why"`: the metrics of this commit become those that the gate keeps near to.

`baseline.json` lies beside each `limits.yaml`. Nothing else changes it, so that many commits, each a little worse, end
at the gate as one that is as much worse. It keeps why it was ever changed, of which commit, and what got worse by it.
The command asks for a clean working tree: what it writes is a commit of its own.
"""

import json
import subprocess
import sys
from argparse import ArgumentParser
from pathlib import Path
from typing import Annotated

from pydantic import Field, TypeAdapter

from trunkline.errors import InputError, in_one_line
from trunkline.pipeline.checkout import require_checkout
from trunkline.pipeline.limits import (
    Limits,
    checked,
    limit_files,
    lookup,
    metrics_folder,
    read_limits,
    read_metrics,
)
from trunkline.pipeline.stage import write_json
from trunkline.settings import settings

Words = Annotated[str, Field(min_length=1)]


@settings
class Change:
    """Of which `commit` the metrics were taken, the `reason`, and what got `worse` by it, a line each."""

    commit: Words
    reason: Words
    worse: list[str]


@settings
class Baseline:
    """metrics: stage: dotted key: value, of the last of `changes`, which are in order."""

    changes: Annotated[list[Change], Field(min_length=1)]
    metrics: dict[str, dict[str, float]]


def baseline_file(limits: Path) -> Path:
    return limits.with_name("baseline.json")


def read_baseline(path: Path) -> Baseline:
    """The baseline at `path`; InputError where it is missing, malformed or holds a number that is not finite."""
    if not path.is_file():
        raise InputError(f'{path}: no such file, expected a baseline (`make baseline REASON="..."`)')
    return checked(path, path.read_text(encoding="utf-8"), TypeAdapter(Baseline))


def disagreements(baseline: Baseline, folder: Path) -> list[str]:
    """One line per value that is not that of its commit's metrics: it was edited. Empty where that commit is not at
    hand, as in a shallow clone or without Git."""
    commit, found = baseline.changes[-1].commit, []
    for stage, values in baseline.metrics.items():
        text = _output(folder, "show", f"{commit}:./artifacts/{stage}/metrics.json")
        metrics = None if text is None else json.loads(text)
        for key, value in values.items():
            if metrics is not None and lookup(metrics, key) != value:
                found.append(f"{stage}: {key}: baseline {value:g}, expected that of {commit}: {lookup(metrics, key)!r}")
    return found


def unrun(limits: Limits, baseline: Baseline, folder: Path) -> list[str]:
    """Stages that have neither metrics in `folder` nor a row in the baseline."""
    return [
        stage
        for stage in limits
        if stage not in baseline.metrics and not (folder / "artifacts" / stage / "metrics.json").exists()
    ]


def renewed(before: Baseline | None, limits: Limits, folder: Path, commit: str, reason: str) -> Baseline:
    """The baseline after `before`, of the metrics in `folder`.

    Raises:
        InputError: metrics are missing or miss their goals.
    """
    values: dict[str, dict[str, float]] = {}
    worse = []
    never = [] if before is None else unrun(limits, before, folder)
    for stage, rows in limits.items():
        if stage in never:
            continue
        metrics = read_metrics(folder, stage)
        for key, limit in rows.items():
            if problems := limit.problems(metrics, key, None):
                raise InputError(f"{stage}: {key}: {problems[0]}")
            if limit.equals is not None:
                continue  # it is its own baseline
            value = lookup(metrics, key)
            values.setdefault(stage, {})[key] = value
            old = None if before is None else before.metrics.get(stage, {}).get(key)
            if old is not None and (value > old if limit.rises else value < old):
                worse.append(f"{stage}: {key}: {old:g}, now {value:g}")
    changes = [] if before is None else before.changes
    return Baseline(changes=[*changes, Change(commit=commit, reason=reason, worse=worse)], metrics=values)


def _output(folder: Path, *arguments: str) -> str | None:
    """What a Git command in `folder` prints; None where it fails or there is no Git."""
    try:
        done = subprocess.run(["git", *arguments], cwd=folder, capture_output=True, encoding="utf-8", check=False)
    except FileNotFoundError:
        return None
    return None if done.returncode else done.stdout


@in_one_line
def main(root: Path = Path("."), words: list[str] | None = None) -> int:
    parser = ArgumentParser(prog="trunkline.pipeline.baseline", description="Make the committed metrics the baseline.")
    parser.add_argument("reason", help="why these values are to be the baseline")
    reason = " ".join(parser.parse_args(words).reason.split())
    require_checkout(root)
    if not reason:
        raise InputError('found no reason, expected why: make baseline REASON="..."')
    commit = _output(root, "rev-parse", "--short=10", "HEAD")
    if commit is None:
        raise InputError("found no commit, expected a clone with Git, to say of which commit the metrics are")
    changed = _output(root, "status", "--porcelain", "--untracked-files=no")
    if changed:
        first = changed.splitlines()[0].split()[-1]
        raise InputError(f"{first}: found changes that are not committed, expected none: a baseline has its own commit")
    for file in limit_files(root):
        path = baseline_file(file)
        before = read_baseline(path) if path.is_file() else None
        after = renewed(before, read_limits(file), metrics_folder(file), commit.strip(), reason)
        if before is not None and before.metrics == after.metrics:
            print(f"baseline: {path.relative_to(root)}: nothing changed")
            continue
        write_json(path, TypeAdapter(Baseline).dump_python(after))
        print(f"baseline: wrote {path.relative_to(root)}")
        for line in after.changes[-1].worse:
            print(f"baseline: worse: {line}")
    return 0


if __name__ == "__main__":
    sys.exit(main())
