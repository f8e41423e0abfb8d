"""What a metric is held to: a goal that is written, and a bound near its value in the baseline."""

import json
import math
from pathlib import Path
from typing import Annotated, Any, Literal

from omegaconf import OmegaConf
from pydantic import Field, NonNegativeFloat, PositiveFloat, TypeAdapter, ValidationError

from trunkline.errors import InputError
from trunkline.pipeline.mistakes import describe
from trunkline.settings import settings


@settings
class Below:
    """The value times `factor` must not exceed the metric `key` of the same stage."""

    key: str
    factor: PositiveFloat


@settings
class Limit:
    """Bounds of one metric. Exactly one of `max`, `min`, `better` and `equals` is given, which also says what is worse.

    max, min: the goal. better: without a goal, what is better. equals: the one value that passes.
    factor: how many times worse than the baseline it may be; for a share (from 0 to 1) of which more is better, how
        many times as much may be missing from 1.
    slack: how much worse than the baseline, in the metric's own unit; the larger of the two counts.
    interval: of a share of trials, the key of its interval's better end: the share falls short only if that end does.
    """

    max: float | None = None
    min: float | None = None
    better: Literal["lower", "higher"] | None = None
    equals: bool | int | None = None
    factor: Annotated[float, Field(ge=1, le=3)] = 1.3
    slack: NonNegativeFloat = 0.0
    below: Below | None = None
    interval: str | None = None

    def __post_init__(self):
        given = [name for name in ("max", "min", "better", "equals") if getattr(self, name) is not None]
        if len(given) != 1:
            raise ValueError(f"found {' and '.join(given) or 'no bound'}, expected one of max, min, better, equals")

    @property
    def rises(self) -> bool:
        """Whether more is worse."""
        return self.max is not None or self.better == "lower"

    def near(self, before: float) -> float:
        """The worst value that `before`, of the baseline, leaves."""
        if self.rises:
            return before + max((self.factor - 1) * abs(before), self.slack)
        room = (self.factor - 1) * (1 - before) if 0 <= before <= 1 else (1 - 1 / self.factor) * abs(before)
        return before - max(room, self.slack)

    def bound(self, before: float) -> float:
        """The goal or what `before` leaves, whichever is nearer."""
        goal = self.max if self.max is not None else self.min
        ends = [self.near(before), *([] if goal is None else [goal])]
        return min(ends) if self.rises else max(ends)

    def problems(self, metrics: Any, key: str, before: float | None) -> list[str]:
        """What is wrong with `key` of a stage's metrics, a line each; without `before` they are held to goals alone."""
        value = lookup(metrics, key)
        if value is None:
            return [f"{'null' if _present(metrics, key) else 'missing'}, expected a value"]
        if self.equals is not None:
            same = type(value) is type(self.equals) and value == self.equals
            return [] if same else [f"found {value!r}, expected {self.equals!r}"]
        if not is_finite(value):
            return [f"found {value!r}, expected a finite number"]
        end = value if self.interval is None else lookup(metrics, self.interval)
        if not is_finite(end):
            return [f"{self.interval}: found {end!r}, expected the better end of its interval"]
        told = f"{value:g}" if self.interval is None else f"{value:g}, its interval to {end:g}"
        found = []
        if self.max is not None and end > self.max:
            found.append(f"found {told}, expected at most {self.max:g}")
        if self.min is not None and end < self.min:
            found.append(f"found {told}, expected at least {self.min:g}")
        if self.below is not None:
            found += self._not_below(value, lookup(metrics, self.below.key), self.below)
        if before is not None:
            near = self.near(before)
            if end > near if self.rises else end < near:
                word = "at most" if self.rises else "at least"
                found.append(f"found {told}, baseline {before:g}, expected {word} {near:g}")
        return found

    @staticmethod
    def _not_below(value: float, other: Any, below: Below) -> list[str]:
        if not is_finite(other):
            return [f"{below.key}: found {other!r}, expected a finite number to compare with"]
        if value * below.factor > other:
            return [f"found {value:g}, expected {below.factor:g} times below {below.key}, {other:g}"]
        return []


# stage: dotted key: limit; an empty file or stage would pass everything, so neither is allowed
Limits = Annotated[dict[str, Annotated[dict[str, Limit], Field(min_length=1)]], Field(min_length=1)]


def limit_files(root: Path) -> list[Path]:
    """The project's, and each example's beside its metrics."""
    return [root / "tests" / "limits.yaml", *sorted(root.glob("examples/*/limits.yaml"))]


def metrics_folder(limits: Path) -> Path:
    """In whose `artifacts/` lie the metrics that the file `limits` names."""
    return limits.parents[1] if limits.parent.name == "tests" else limits.parent


def read_limits(path: Path) -> Limits:
    """The limits in the file at `path`; InputError where it is malformed or empty."""
    if not path.is_file():
        raise InputError(f"{path}: no such file, expected the limits of the gate")
    return checked(path, json.dumps(OmegaConf.to_container(OmegaConf.load(path))), TypeAdapter(Limits))


def checked(path: Path, text: str, adapter: TypeAdapter) -> Any:
    """What the JSON `text` holds, as the adapter's type; InputError that names the key in the file at `path`."""
    try:
        return adapter.validate_json(text, strict=True)
    except ValidationError as error:
        first = error.errors()[0]
        place = "".join(f": {part}" if n < 2 else f".{part}" for n, part in enumerate(first["loc"]))
        raise InputError(f"{path}{place}: {describe(first, adapter)}") from error


def read_metrics(folder: Path, stage: str) -> Any:
    """`artifacts/<stage>/metrics.json` in `folder`.

    Raises:
        InputError: it is missing, is no JSON, or holds a number that is not finite, under whatever key.
    """
    name = f"artifacts/{stage}/metrics.json"
    try:
        metrics = json.loads((folder / name).read_text(encoding="utf-8"))
    except FileNotFoundError:
        raise InputError(f"{name} is missing") from None
    except ValueError as error:
        raise InputError(f"{name} is not JSON: {error}") from None
    if bad := _not_finite(metrics, ""):
        raise InputError(f"{bad[0][1:]}: found {bad[1]}, expected a finite number")
    return metrics


def lookup(metrics: Any, key: str) -> Any:
    """The value at the dotted `key` of nested mappings; None where there is none."""
    for part in key.split("."):
        metrics = metrics.get(part) if isinstance(metrics, dict) else None
    return metrics


def is_finite(value: Any) -> bool:
    return isinstance(value, int | float) and not isinstance(value, bool) and math.isfinite(value)


def _present(metrics: Any, key: str) -> bool:
    parent, _, last = key.rpartition(".")
    holder = lookup(metrics, parent) if parent else metrics
    return isinstance(holder, dict) and last in holder


def _not_finite(value: Any, key: str) -> tuple[str, float] | None:
    """The first number of nested mappings and lists that is not finite, with its dotted key."""
    if isinstance(value, float) and not math.isfinite(value):
        return key, value
    items = value.items() if isinstance(value, dict) else enumerate(value) if isinstance(value, list) else ()
    return next((bad for part, held in items if (bad := _not_finite(held, f"{key}.{part}"))), None)
