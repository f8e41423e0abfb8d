"""What a certificate says in sentences, each from numbers."""

from collections.abc import Collection
from dataclasses import dataclass
from typing import Annotated

import numpy as np
from pydantic import Field

from trunkline.identification.diagnostics.identifiability import Identifiability
from trunkline.identification.parameters.parameters import parameter_named
from trunkline.identification.stages import stated_interval
from trunkline.recordings.trials.conditions import Conditions
from trunkline.recordings.trials.experiments import EXPERIMENTS
from trunkline.report.certificate.budget import FRICTION, NOISE

FEW_TILTS = 10.0  # deg, up to which a mount counts as upright
STRONG = 0.9  # of a correlation, from which on it is named
NOTHING = "nothing yet: it is not far better than knowing nothing of forces"


@dataclass
class Use:
    """up_to_pct: of the arm's length, the largest mean position error with which the twin does for `words`."""

    up_to_pct: Annotated[float, Field(gt=0, le=100)]
    words: str


def verdict(
    where: str, identified: dict, null: dict, uses: list[Use], factor: float, radius_mm: float, limits: list[str],
    next_step: str,
) -> dict[str, str]:  # fmt: skip
    """What the twin is good for and what not, and what to do next: a sentence each, with its numbers in mm.

    Args:
        where: which trials the errors are of, in words.
        identified, null: errors as `scores` has them, of the twin and of the mean shape at rest.
        factor: by which the twin must be nearer than that to be good for anything.
        radius_mm: within which a tip at rest is in 95 of 100 cases, in the median pose.
        limits: what it is not good for.
        next_step: as the function of that name has it.
    """
    off, share = identified["e_position_mm"], identified["e_position_pct"]
    fit = [use.words for use in sorted(uses, key=lambda use: use.up_to_pct) if share <= use.up_to_pct]
    better = off * factor <= null["e_position_mm"]
    tip = f", tips {identified['e_tip_mm']:.2g} mm" if "e_tip_mm" in identified else ""
    good = fit[0] if fit and better else NOTHING
    errors = f"{where}, markers are {off:.2g} mm off in the mean, {share:.2g} % of length{tip}"
    rest = f"at rest, in the median pose, the tip is within {radius_mm:.2g} mm of the twin's in 95 of 100 cases"
    nearer = f"what needs the tip nearer than {radius_mm:.2g} mm"
    return {
        "good_for": f"{good}. {errors}; {rest}.",
        "not_for": f"{_listed([nearer, *limits])}.",
        "next": next_step,
    }


def next_step(lines: list[dict], parameters: Collection[str]) -> str:
    """What lowers the largest line of the tip's uncertainty.

    Args:
        lines: as `uncertainty_facts` has them. parameters: which sources are parameters of the model.
    """
    largest = max(lines, key=lambda line: line["contribution_mm"])
    source = largest["source"]
    if source == NOISE:
        step = "calibrate the cameras"
    elif source == FRICTION:
        step = "reach each pose from the side from which it was recorded"
    elif source in parameters:
        step = f"record more {_listed([EXPERIMENTS[kind].plural for kind in telling(source)])}"
    else:
        step = "record more trials at rest with split validate, in the poses that are needed"
    return f"{step}: {source} adds the most to the tip's uncertainty, {largest['contribution_mm']:.2g} mm."


def limits_of(conditions: Conditions, loads: list[float]) -> list[str]:
    """What no trial of the session, but for those of the last score, tells anything of. loads: at their tips, kg."""
    heaviest = max(loads, default=0.0)
    limits = [f"loads above {1e3 * heaviest:.3g} g" if heaviest else "loads at the tip"]
    if conditions.pull:
        limits.append(f"pulls above {1e3 * conditions.pull:.0f} mm at rest")
        if conditions.pulled_tilt_deg < FEW_TILTS:
            limits.append("pulls while the mount is tilted")
        else:
            limits.append(f"pulls while the mount is tilted by more than {conditions.pulled_tilt_deg:.0f}°")
    if conditions.tilt_deg < FEW_TILTS:
        limits.append("a tilted mount")
    return [*limits, "whatever touches the arm"]


def certainty_words(name: str, row: dict) -> str:
    """How well a parameter of `parameters.json` is told, in the words of `trunkline.tools.check`."""
    axis = parameter_named(name).coordinate
    low, high = axis(stated_interval(row))
    searched = np.diff(axis(row["range"]))[0]
    half = float(high - low) / 2
    return Identifiability(name, half, 1.0 if row["undetermined"] else min(2 * half / searched, 0.999)).words()


def open_lines(table: dict) -> list[str]:
    """What a stage's trials leave open, and which experiment would tell it."""
    lines = []
    for name, row in (table["parameters"] | table.get("per_session", {})).items():
        if why := _open(row):
            lines.append(f"{name} {why}; told by {_listed([EXPERIMENTS[kind].plural for kind in telling(name)])}")
    return lines


def _open(row: dict) -> str:
    if row["at_bound"]:
        return "ended on a bound of its range"
    if row["undetermined"]:
        return "is not determined"
    (low, high), (least, most) = stated_interval(row), row["range"]
    return "is told to one side alone: its interval ends with its range" if low <= least or high >= most else ""


def telling(name: str) -> list[str]:
    """The kinds of experiment that tell a parameter."""
    return [kind for kind, experiment in EXPERIMENTS.items() if parameter_named(name).identifiable_from(experiment)]


def strong_pairs(table: dict) -> list[str]:
    """Parameters that a stage's trials hardly tell apart, with the correlation of their estimates."""
    names, pairs = list(table["parameters"]), []
    for i, name in enumerate(names):
        for other in names[i + 1 :]:
            correlation = table["correlation"][name][other]
            if abs(correlation) >= STRONG:
                trend = "rise together" if correlation > 0 else "trade off"
                pairs.append(f"{name} and {other} {trend} ({correlation:+.2f})")
    return pairs


def _listed(words: list[str]) -> str:
    return words[0] if len(words) == 1 else f"{', '.join(words[:-1])} or {words[-1]}"
