"""Suggestions in words: a table, why each, what to do, and what goes into session.yaml."""

import numpy as np
import yaml

from trunkline.identification.diagnostics.identifiability import TWO_SIDED, Identifiability
from trunkline.identification.parameters.parameters import parameter_named
from trunkline.program import aligned
from trunkline.recordings.trials.experiments import EXPERIMENTS
from trunkline.recordings.trials.splits import IDENTIFY
from trunkline.tools.suggest.candidates import Candidate
from trunkline.tools.suggest.goals import Goal
from trunkline.tools.suggest.information import StageInformation
from trunkline.tools.suggest.ranking import Suggestion

LEAST = 0.15  # of what a trial gains, from which on the parameter by which it does is named
NAMED = 3  # parameters that are named, at most
PERCENT = 0.2  # half-width of a logarithm, below which percent say it
TITLES: dict[Goal, str] = {
    "intervals": "root mean square of the 95 % intervals over their ranges",
    "tip": "standard uncertainty of the tip at rest by the parameters, over the workspace",
    "grasp": "standard uncertainty of the tip by the parameters where the arm is wound up, in place of a grasp's odds",
}


def loss_words(goal: Goal, loss: float) -> str:
    """The root of an expected loss Φ in the goal's unit."""
    if goal == "intervals":
        return f"{100 * TWO_SIDED * np.sqrt(loss):.3g} %"
    return f"{1e3 * np.sqrt(loss):.3g} mm"


def widest_words(stages: list[StageInformation], chosen: list[str]) -> str:
    """The widest interval over its range, as the last stage that identifies a parameter leaves it."""
    last = {estimate.name: (estimate, stage.stage) for stage in stages for estimate in stage.identifiability(chosen)}
    widest, stage = max(last.values(), key=lambda pair: pair[0].share)
    return f"{widest.words()} ({stage})"


def table_lines(goal: Goal, suggestions: list[Suggestion]) -> list[str]:
    """A line a suggestion, in their order: what it leaves, by how much it shrinks that, and what it costs."""
    rows = [["", "trial", "expected after it", "gain", "minutes", "gain a minute"]]
    for number, suggestion in enumerate(suggestions, 1):
        candidate, left = suggestion.candidate, loss_words(goal, suggestion.after)
        rows.append([f"{number}", candidate.name, left, *_numbers(suggestion.gain, candidate)])
    return aligned(rows, 2)


def kind_lines(goal: Goal, before: float, after: np.ndarray, offered: list[Candidate]) -> list[str]:
    """Of every kind of experiment, with and without a load, the one that gains most if it is recorded alone.

    Args:
        before, after: Φ now, and with each of `offered` alone. after: shape (C,).
    """
    rows = [["", "best by itself", "expected after it", "gain", "minutes", "gain a minute"]]
    gains = 1 - np.sqrt(after / before)
    groups: dict[tuple[str, bool], int] = {}
    for index in np.argsort(-gains, kind="stable").tolist():
        groups.setdefault((offered[index].kind, offered[index].load > 0), index)
    for (kind, loaded), index in groups.items():
        label = EXPERIMENTS[kind].plural + (", loaded" if loaded else "")
        numbers = _numbers(float(gains[index]), offered[index])
        rows.append([label, offered[index].name, loss_words(goal, after[index]), *numbers])
    return aligned(rows, 2)


def why_words(stages: list[StageInformation], weights: list[np.ndarray], suggestion: Suggestion) -> str:
    """The parameters by which a suggestion shrinks the loss the most, once those before it are recorded."""
    shares: list[tuple[float, Identifiability, Identifiability]] = []
    for stage, weight in zip(stages, weights, strict=True):
        old, new = stage.identifiability(suggestion.chosen[:-1]), stage.identifiability(suggestion.chosen)
        for before, now, counts in zip(old, new, np.diag(weight), strict=True):
            shares.append((float(counts) * (before.share**2 - now.share**2), before, now))
    shares.sort(key=lambda row: -row[0])
    total = sum(max(share, 0.0) for share, *_ in shares)
    changes = [_change(before, now) for share, before, now in shares[:NAMED] if share > LEAST * total]
    return "; ".join(changes) if changes else "tells a little of everything"


def _change(before: Identifiability, now: Identifiability) -> str:
    return f"{before.name} {_width(before)} now, then {_width(now)}"


def _width(estimate: Identifiability) -> str:
    """Of an interval: a number in its unit, a factor, or percent where that is as good."""
    parameter = parameter_named(estimate.name)
    if estimate.share >= 1:
        return "undetermined"
    if parameter.signed:
        return f"± {estimate.half_width * parameter.scale:.2g} {parameter.unit}".rstrip()
    if estimate.half_width < PERCENT:
        return f"± {100 * estimate.half_width:.2g} %"
    return f"within a factor of {np.exp(estimate.half_width):.2f}"


def entry_lines(chosen: list[Candidate], taken: set[str]) -> list[str]:
    """Entries of `trials` in session.yaml, a line each, with names that are not `taken` yet."""
    lines, taken = [], set(taken)
    for candidate in chosen:
        name = candidate.name
        while name in taken:
            name = f"{name}_again"
        taken.add(name)
        entry: dict[str, str | float] = {"file": f"{name}.mcap", "experiment": candidate.kind}
        if candidate.level is not None:
            entry["level"] = int(candidate.level) if candidate.level == int(candidate.level) else candidate.level
        if candidate.load:
            entry["load"] = candidate.load
        text = yaml.safe_dump(entry | {"split": IDENTIFY}, default_flow_style=True, sort_keys=False, width=1000)
        lines.append(f"  - {text.strip()}")
    return lines


def _numbers(gain: float, candidate: Candidate) -> list[str]:
    return [f"{100 * gain:.1f} %", f"{candidate.minutes:g}", f"{100 * gain / candidate.minutes:.1f} %"]
