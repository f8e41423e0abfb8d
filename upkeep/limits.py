"""What a metric is held to: a goal that is written, and a bound near its value in the baseline."""

import json
import math
from pathlib import Path
from typing import Annotated, Any, Literal

from omegaconf import OmegaConf
from pydantic import Field, NonNegativeFloat, PositiveInt, TypeAdapter, ValidationError

from trunkline.errors import InputError
from trunkline.pipeline.validation_errors import describe
from trunkline.recordings.trials.splits import TEST
from trunkline.settings import settings

SCORING = "score"  # the stage that alone reads the split `test`


@settings
class Below:
    """The value times `factor` must not exceed the metric `key` of the same stage: 4 is four times below."""

    key: str
    factor: Annotated[float, Field(ge=1)]


@settings
class Trials:
    """Of how many trials a share is: the metric `key` of the same stage, `least` of them."""

    key: str
    least: PositiveInt


@settings
class Limit:
    """Bounds of one metric. Exactly one of `max`, `min`, `better` and `equals` is given, which also says what is worse.

    max, min: the goal. better: without a goal that is met, what is better. equals: the one value that passes.
    goal: beside `better`, what is asked for and was missed when the row was written. It holds as max or min do as soon
        as the baseline meets it.
    factor: how many times worse than the baseline it may be; for a share (from 0 to 1) of which more is better, how
        many times as much may be missing from 1, if that is nearer.
    slack: how much worse than the baseline, in the metric's own unit; the larger of the two counts.
    below, reaches: the other metric of the same stage that it must be below, and that it must at least be.
    trials: how many a share must be of, or a few of them would do.
    """

    max: float | None = None
    min: float | None = None
    better: Literal["lower", "higher"] | None = None
    equals: bool | int | None = None
    goal: float | None = None
    factor: Annotated[float, Field(ge=1, le=3)] = 1.3
    slack: NonNegativeFloat = 0.0
    below: Below | None = None
    reaches: str | None = None
    trials: Trials | None = None

    def __post_init__(self):
        bounds = [name for name in ("max", "min", "better", "equals") if getattr(self, name) is not None]
        if len(bounds) != 1:
            raise ValueError(f"found {' and '.join(bounds) or 'no bound'}, expected one of max, min, better, equals")
        if self.goal is not None and self.better is None:
            raise ValueError(f"found goal and {bounds[0]}, expected a goal that is missed beside better")

    @property
    def rises(self) -> bool:
        """Whether more is worse."""
        return self.max is not None or self.better == "lower"

    @property
    def target(self) -> float | None:
        """The goal, met or missed."""
        return next((goal for goal in (self.max, self.min, self.goal) if goal is not None), None)

    @property
    def others(self) -> list[str]:
        """Keys of metrics that it compares with."""
        keys = [self.below and self.below.key, self.reaches, self.trials and self.trials.key]
        return [key for key in keys if key]

    def misses(self, value: float, goal: float) -> bool:
        return value > goal if self.rises else value < goal

    def near(self, before: float) -> float:
        """The worst value that `before`, of the baseline, leaves."""
        if self.rises:
            return before + max((self.factor - 1) * abs(before), self.slack)
        room = (1 - 1 / self.factor) * abs(before)
        if 0 <= before <= 1:
            room = min(room, (self.factor - 1) * (1 - before))
        return before - max(room, self.slack)

    def demanded(self, before: float | None) -> float | None:
        """The goal that holds: one that was missed holds from the baseline on that meets it."""
        if self.goal is not None and (before is None or self.misses(before, self.goal)):
            return None
        return self.target

    def bound(self, before: float) -> float:
        """The goal that holds or what `before` leaves, whichever is nearer."""
        goal = self.demanded(before)
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
        word, broken = "at most" if self.rises else "at least", []
        goal = self.demanded(before)
        if goal is not None and self.misses(value, goal):
            broken.append(f"found {value:g}, expected {word} {goal:g}")
        if self.below is not None:
            broken += self._not_below(value, lookup(metrics, self.below.key), self.below)
        if self.reaches is not None:
            broken += self._not_reached(value, lookup(metrics, self.reaches), self.reaches)
        if self.trials is not None:
            broken += self._too_few(lookup(metrics, self.trials.key), self.trials)
        if before is not None and self.misses(value, near := self.near(before)):
            broken.append(f"found {value:g}, baseline {before:g}, expected {word} {near:g}")
        return broken

    @staticmethod
    def _not_below(value: float, other: Any, below: Below) -> list[str]:
        if not is_finite(other):
            return [f"{below.key}: found {other!r}, expected a finite number to compare with"]
        if value * below.factor > other:
            return [f"found {value:g}, expected {below.factor:g} times below {below.key}, {other:g}"]
        return []

    @staticmethod
    def _not_reached(value: float, other: Any, key: str) -> list[str]:
        if not is_finite(other):
            return [f"{key}: found {other!r}, expected a finite number to compare with"]
        return [f"found {value:g}, expected at least {key}, {other:g}"] if value < other else []

    @staticmethod
    def _too_few(count: Any, trials: Trials) -> list[str]:
        if not is_finite(count) or count < trials.least:
            return [f"{trials.key}: found {count!r}, expected at least {trials.least} trials"]
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
    """The limits in the file at `path`.

    Raises:
        InputError: it is malformed or empty, or a row of it is of the split `test`, by which nothing is decided.
    """
    limits = read_rows(path, TypeAdapter(Limits))
    for stage, rows in limits.items():
        for key, limit in rows.items():
            for name in (key, *limit.others):
                refuse_test(stage, name, f"{path}: ")
    return limits


def read_rows(path: Path, adapter: TypeAdapter) -> Any:
    """What the YAML at `path` holds, as the adapter's type; InputError where it is missing or malformed."""
    if not path.is_file():
        raise InputError(f"{path}: no such file, expected limits or goals of metrics")
    return checked(path, json.dumps(OmegaConf.to_container(OmegaConf.load(path))), adapter)


def of_test(stage: str, key: str) -> bool:
    """Whether a metric is of the split `test`, as all of `score` are."""
    return stage == SCORING or TEST in key.split(".")


def refuse_test(stage: str, key: str, where: str = "") -> None:
    """Raise InputError, which begins with `where`, for a metric of the split `test`, by which nothing is decided."""
    if of_test(stage, key):
        raise InputError(f"{where}{stage}: {key}: found a metric of `{TEST}`, expected one of a split that decides")


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
    return next((bad for part, item in items if (bad := _not_finite(item, f"{key}.{part}"))), None)
