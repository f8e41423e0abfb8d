"""`python -m upkeep.baseline "why"`: the metrics of this commit become those that the gate keeps near to.

`baseline.json` lies beside each `limits.yaml`. Nothing else changes it, so that many commits, each a little worse, end
at the gate as one that is as much worse. It keeps why it was ever changed, of which commit, and what got worse by it.
The command asks for a clean working tree: what it writes is a commit of its own.

The changes are a chain: each has the digest of its values, and a hash of that, of its commit, of its words and of the
hash before it. A value or a reason that was edited, and a change that was dropped, show without Git. With Git the last
change's commit must be in the history and have these values: who joins commits to one makes the baseline again.
"""

import hashlib
import json
import subprocess
import sys
from argparse import ArgumentParser
from pathlib import Path
from typing import Annotated, Any

from pydantic import Field, TypeAdapter

from trunkline.errors import InputError, in_one_line
from trunkline.pipeline.checkout import require_checkout
from trunkline.pipeline.stage import write_json
from trunkline.settings import settings
from upkeep.limits import (
    Limits,
    checked,
    is_finite,
    limit_files,
    lookup,
    metrics_folder,
    read_limits,
    read_metrics,
    refuse_test,
)

Words = Annotated[str, Field(min_length=1)]


@settings
class Renewal:
    """Of which `commit` the metrics were taken, the `reason`, and what got `worse` by it, a line each."""

    commit: Words
    reason: Words
    worse: list[str]


@settings
class Chained(Renewal):
    """A renewal in the chain. values: digest of its metrics. hash: of all this and of the hash before it."""

    values: Words
    hash: Words


@settings
class MetricBaseline:
    """metrics: stage: dotted key: value, of the last of `changes`, which are in order. unchained: those of before there
    was a chain, as they were; the hash before the first of the chain is theirs."""

    changes: Annotated[list[Chained], Field(min_length=1)]
    metrics: dict[str, dict[str, float]]
    unchained: list[Renewal] = Field(default_factory=list)


def baseline_file(limits: Path) -> Path:
    return limits.with_name("baseline.json")


def read_baseline(path: Path) -> MetricBaseline:
    """The baseline at `path`; InputError where it is missing, malformed or holds a number that is not finite."""
    if not path.is_file():
        raise InputError(f'{path}: no such file, expected a baseline (`make baseline REASON="..."`)')
    return checked(path, path.read_text(encoding="utf-8"), TypeAdapter(MetricBaseline))


def rounded(value: Any) -> Any:
    """A number as `write_json` writes it; what is none is handed back."""
    return float(f"{value:.9g}") if is_finite(value) else value


def digest(content: object) -> str:
    """Of what JSON can hold, whatever the order of its keys."""
    return hashlib.sha256(json.dumps(content, sort_keys=True, separators=(",", ":")).encode()).hexdigest()


def linked(parent: str, commit: str, reason: str, worse: list[str], metrics: dict[str, dict[str, float]]) -> Chained:
    """The change that follows the hash `parent`."""
    values = digest(metrics)
    words = {"commit": commit, "reason": reason, "worse": worse}
    return Chained(**words, values=values, hash=digest([parent, values, words]))


def root_hash(unchained: list[Renewal]) -> str:
    """What the first change of the chain follows."""
    return digest([{"commit": change.commit, "reason": change.reason, "worse": change.worse} for change in unchained])


def breaks(baseline: MetricBaseline) -> list[str]:
    """One line per place at which the chain does not hold, so that something was edited or dropped; needs no Git."""
    broken, parent = [], root_hash(baseline.unchained)
    for number, change in enumerate(baseline.changes):
        words = {"commit": change.commit, "reason": change.reason, "worse": change.worse}
        if change.hash != digest([parent, change.values, words]):
            broken.append(f"baseline: change {number}, of {change.commit}: was edited, or one before it was or is gone")
        parent = change.hash
    if baseline.changes[-1].values != digest(baseline.metrics):
        broken.append(f"baseline: values are not those of its last change, of {baseline.changes[-1].commit}")
    return broken


def unchecked(folder: Path) -> str:
    """Why Git cannot say whether a baseline's commit is there, "" where it can."""
    shallow = _output(folder, "rev-parse", "--is-shallow-repository")
    if shallow is None:
        return "no Git here"
    return "a shallow clone" if shallow.strip() == "true" else ""


def disagreements(baseline: MetricBaseline, folder: Path) -> list[str]:
    """One line per value that is not that of its commit's metrics, or one that says that this commit is not in the
    history. Empty where Git cannot say (`unchecked`)."""
    commit, wrong = baseline.changes[-1].commit, []
    if unchecked(folder):
        return []
    if _output(folder, "merge-base", "--is-ancestor", commit, "HEAD") is None:
        return [f'baseline: commit {commit} is not in the history, expected it (`make baseline REASON="..."`)']
    for stage, values in baseline.metrics.items():
        text = _output(folder, "show", f"{commit}:./artifacts/{stage}/metrics.json")
        metrics = None if text is None else json.loads(text)
        for key, value in values.items():
            if rounded(lookup(metrics, key)) != value:
                wrong.append(f"{stage}: {key}: baseline {value:g}, expected that of {commit}: {lookup(metrics, key)!r}")
    return wrong


def company(path: Path) -> list[str]:
    """One line if the commit that last changed the baseline at `path` changed more than baselines, limits, goals and
    docs. Merges are not looked at; empty where Git cannot say, and where the baseline is not committed."""
    if unchecked(path.parent):
        return []
    last = (_output(path.parent, "log", "-1", "--no-merges", "--format=%h", "--", path.name) or "").strip()
    files = _output(path.parent, "show", "--name-only", "--format=", last) if last else None
    others = [name for name in (files or "").splitlines() if not _beside(Path(name))]
    if not others:
        return []
    more = f" and {len(others) - 1} more" if others[1:] else ""
    return [f"baseline: commit {last} changed {others[0]}{more} too, expected a commit of its own"]


def _beside(name: Path) -> bool:
    """Whether a file may be in the commit of a baseline: `make readme` belongs to it, and rows are where it begins."""
    rows = ("baseline.json", "limits.yaml", "release.yaml", "release.json")
    return name.name in rows or name.suffix in (".md", ".png")


def unrun(limits: Limits, baseline: MetricBaseline, folder: Path) -> list[str]:
    """Stages that have neither metrics in `folder` nor a row in the baseline."""
    return [
        stage
        for stage in limits
        if stage not in baseline.metrics and not (folder / "artifacts" / stage / "metrics.json").exists()
    ]


def renewed(before: MetricBaseline | None, limits: Limits, folder: Path, commit: str, reason: str) -> MetricBaseline:
    """The baseline after `before`, of the metrics in `folder`.

    Raises:
        InputError: metrics are missing, miss their goals, or are of the split `test`.
    """
    values: dict[str, dict[str, float]] = {}
    worse = []
    never = [] if before is None else unrun(limits, before, folder)
    for stage, rows in limits.items():
        if stage in never:
            continue
        metrics = read_metrics(folder, stage)
        for key, limit in rows.items():
            refuse_test(stage, key)
            if problems := limit.problems(metrics, key, None):
                raise InputError(f"{stage}: {key}: {problems[0]}")
            if limit.equals is not None:
                continue  # it is its own baseline
            value = rounded(lookup(metrics, key))
            values.setdefault(stage, {})[key] = value
            old = None if before is None else before.metrics.get(stage, {}).get(key)
            if old is not None and (value > old if limit.rises else value < old):
                worse.append(f"{stage}: {key}: {old:g}, now {value:g}")
    changes = [] if before is None else before.changes
    parent = changes[-1].hash if changes else root_hash([])
    change = linked(parent, commit, reason, worse, values)
    return MetricBaseline(changes=[*changes, change], metrics=values, unchained=before.unchained if before else [])


def _output(folder: Path, *arguments: str) -> str | None:
    """What a Git command in `folder` prints; None where it fails or there is no Git."""
    try:
        done = subprocess.run(["git", *arguments], cwd=folder, capture_output=True, encoding="utf-8", check=False)
    except FileNotFoundError:
        return None
    return None if done.returncode else done.stdout


def _wanted(before: MetricBaseline, after: MetricBaseline, limits: Path) -> bool:
    """Whether `after` says anything new: other values, or the same ones of a commit that is in the history.

    Raises:
        InputError: the chain is broken, which no renewal may hide.
    """
    path = baseline_file(limits)
    if broken := breaks(before):
        raise InputError(f"{path}: {broken[0]}")
    return before.metrics != after.metrics or bool(disagreements(before, metrics_folder(limits)) or company(path))


@in_one_line
def main(root: Path = Path("."), words: list[str] | None = None) -> int:
    parser = ArgumentParser(prog="upkeep.baseline", description="Make the committed metrics the baseline.")
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
    written = {}
    for file in limit_files(root):
        path = baseline_file(file)
        before = read_baseline(path) if path.is_file() else None
        after = renewed(before, read_limits(file), metrics_folder(file), commit.strip(), reason)
        if before is not None and not _wanted(before, after, file):
            print(f"baseline: {path.relative_to(root)}: nothing changed")
            continue
        written[path] = after
    for path, after in written.items():  # all or none
        write_json(path, TypeAdapter(MetricBaseline).dump_python(after))
        print(f"baseline: wrote {path.relative_to(root)}")
        for line in after.changes[-1].worse:
            print(f"baseline: worse: {line}")
    return 0


if __name__ == "__main__":
    sys.exit(main())
