"""`python -m trunkline.pipeline.gate`: do the metrics keep within tests/limits.yaml, and an example's within its own?

Each metric has an absolute bound and, where it makes sense, an allowed regression against the value committed
before. The earlier value is HEAD's, or, where the file is as in HEAD (a fresh clone, CI), the one before the
last commit that changed it. The gate fails closed: what is missing, null, not a number or not finite fails, and
so does an earlier value that cannot be had (no Git, a shallow clone, an earlier file without the key). Only a
file without another version in a whole history has none; a new key gets its `regression` one commit later.
"""

import json
import math
import subprocess
import sys
from pathlib import Path
from typing import Annotated, Any

from omegaconf import OmegaConf
from pydantic import Field, NonNegativeFloat, PositiveFloat, TypeAdapter, ValidationError

from trunkline.errors import InputError
from trunkline.settings import settings


@settings
class Below:
    """The value times `factor` must not exceed the metric `key` of the same stage."""

    key: str
    factor: PositiveFloat


@settings
class Limit:
    """Bounds of one metric. At least one of `max`, `min` and `equals` must be given.

    regression: how much worse than the earlier value it may be, as a share of that value.
    slack: and in the metric's own unit, for values near zero; the larger of the two counts.
    """

    max: float | None = None
    min: float | None = None
    equals: bool | int | None = None
    regression: NonNegativeFloat | None = None
    slack: NonNegativeFloat = 0.0
    below: Below | None = None

    def __post_init__(self):
        if self.max is None and self.min is None and self.equals is None:
            raise ValueError("no bound, expected `max`, `min` or `equals`")
        if self.regression is not None and (self.max is None) == (self.min is None):
            raise ValueError("found `regression`, expected it beside either `max` or `min`")


# stage: dotted key: limit; an empty file or stage would pass everything, so neither is allowed
Limits = Annotated[dict[str, Annotated[dict[str, Limit], Field(min_length=1)]], Field(min_length=1)]


def read_limits(path: Path) -> Limits:
    """The limits in the file at `path`; InputError where it is malformed or empty."""
    try:
        content = json.dumps(OmegaConf.to_container(OmegaConf.load(path)))
        return TypeAdapter(Limits).validate_json(content, strict=True)
    except FileNotFoundError:
        raise InputError(f"{path}: no such file, expected the limits of the gate") from None
    except ValidationError as error:
        first = error.errors()[0]
        raise InputError(f"{path}: {'.'.join(map(str, first['loc']))}: {first['msg']}") from error


def failures(limits: Limits, root: Path) -> list[str]:
    """One line per metric that breaks its limit, naming stage and key; empty if all is well."""
    found = []
    for stage, keys in limits.items():
        name = f"artifacts/{stage}/metrics.json"
        try:
            metrics = json.loads((root / name).read_text(encoding="utf-8"))
        except FileNotFoundError:
            found += [f"{stage}: {key}: {name} is missing" for key in keys]
            continue
        except ValueError as error:
            found += [f"{stage}: {key}: {name} is not JSON: {error}" for key in keys]
            continue
        earlier = None
        if any(limit.regression is not None for limit in keys.values()):
            try:
                earlier = earlier_metrics(name, root)
            except InputError as error:
                found.append(f"{stage}: {error}")
        for key, limit in keys.items():
            found += [f"{stage}: {key}: {problem}" for problem in _problems(limit, key, metrics, earlier)]
    return found


def _problems(limit: Limit, key: str, metrics: Any, earlier: Any) -> list[str]:
    value = lookup(metrics, key)
    if value is None:
        return [f"{'null' if _present(metrics, key) else 'missing'}, expected a value"]
    if limit.equals is not None:
        same = type(value) is type(limit.equals) and value == limit.equals
        return [] if same else [f"found {value!r}, expected {limit.equals!r}"]
    if not _finite(value):
        return [f"found {value!r}, expected a finite number"]
    problems = []
    if limit.max is not None and value > limit.max:
        problems.append(f"found {value:g}, expected at most {limit.max:g}")
    if limit.min is not None and value < limit.min:
        problems.append(f"found {value:g}, expected at least {limit.min:g}")
    if limit.below is not None:
        other, factor = lookup(metrics, limit.below.key), limit.below.factor
        if not _finite(other):
            problems.append(f"{limit.below.key}: found {other!r}, expected a finite number to compare with")
        elif value * factor > other:
            problems.append(f"found {value:g}, expected {factor:g} times below {limit.below.key}, {other:g}")
    if limit.regression is not None and earlier is not None:
        before = lookup(earlier, key)
        if not _finite(before):
            return [*problems, f"earlier {before!r}, expected a finite number to compare with"]
        allowed = max(limit.regression * abs(before), limit.slack)
        worse = value - before if limit.max is not None else before - value
        if worse > allowed:
            problems.append(f"found {value:g}, earlier {before:g}, expected at most {allowed:.3g} worse")
    return problems


def lookup(metrics: Any, key: str) -> Any:
    """The value at the dotted `key` of nested mappings; None where there is none."""
    for part in key.split("."):
        metrics = metrics.get(part) if isinstance(metrics, dict) else None
    return metrics


def _present(metrics: Any, key: str) -> bool:
    parent, _, last = key.rpartition(".")
    holder = lookup(metrics, parent) if parent else metrics
    return isinstance(holder, dict) and last in holder


def _finite(value: Any) -> bool:
    return isinstance(value, int | float) and not isinstance(value, bool) and math.isfinite(value)


def earlier_metrics(name: str, root: Path) -> Any:
    """The metrics committed before those in the working tree; None if there never was another version.

    Raises:
        InputError: if the history cannot be read or is cut short, or the earlier file is not JSON.
    """
    now = (root / name).read_text(encoding="utf-8")
    for commit in _git(root, name, "log", "--diff-filter=AM", "--format=%H", "--", name).split():
        text = _git(root, name, "show", f"{commit}:./{name}")
        if text == now:
            continue
        try:
            return json.loads(text) or {}
        except ValueError as error:
            raise InputError(f"{name}: the version of {commit[:10]} is not JSON: {error}") from None
    if _git(root, name, "rev-parse", "--is-shallow-repository").strip() != "false":
        raise InputError(f"{name}: no earlier version in a shallow clone, expected the whole history "
                         f"(`git fetch --unshallow`)")
    return None


def _git(root: Path, name: str, *arguments: str) -> str:
    """Output of a git command in `root`; InputError, naming the metrics `name`, where it fails."""
    try:
        done = subprocess.run(["git", *arguments], cwd=root, capture_output=True, encoding="utf-8",
                              errors="replace", check=False)  # fmt: skip
    except FileNotFoundError:
        raise InputError(f"{name}: no earlier version without Git, found no `git` command") from None
    if done.returncode:
        raise InputError(f"{name}: no earlier version, `git {arguments[0]}` says: {done.stderr}")
    return done.stdout


def main(root: Path = Path(".")) -> int:
    files = [root / "tests" / "limits.yaml", *sorted(root.glob("examples/*/limits.yaml"))]
    count, stages, found = 0, 0, 0
    for file in files:
        try:
            limits = read_limits(file)
        except InputError as error:
            print(f"gate: error: {error}", file=sys.stderr)
            return 1
        example = file.parent.name if file.parent.name != "tests" else ""
        problems = failures(limits, file.parent if example else root)
        for problem in problems:
            print(f"gate: FAIL {example}{': ' * bool(example)}{problem}")
        count, stages = count + sum(len(keys) for keys in limits.values()), stages + len(limits)
        found += len(problems)
    print(f"gate: {count} metrics in {stages} stages, {found} problems")
    return 1 if found else 0


if __name__ == "__main__":
    sys.exit(main())
