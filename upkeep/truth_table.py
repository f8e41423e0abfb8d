"""What was identified in the demo session, and how far off it is, beside the stand-in lab's truth: Markdown tables."""

import json
from collections.abc import Collection
from dataclasses import dataclass
from functools import partial
from pathlib import Path

import numpy as np
from scipy.special import ndtri

from trunkline.identification.evaluation.error_tables import number
from trunkline.identification.parameters.parameters import parameter_named
from trunkline.identification.stages import STAGES, interval_words, last_stages, read_tables, stated_interval
from trunkline.recordings.trials.experiments import EXPERIMENTS
from trunkline.recordings.trials.splits import TEST, VALIDATE

TRUTH = Path("data/raw/demo.truth.json")


_number = partial(number, digits=4)
KINDS = {name: kind.plural for name, kind in EXPERIMENTS.items()}  # what trials of a kind are called
SHIPPED = STAGES[-1]  # the stage whose model is shipped
# whose errors: of the identified model, and of what it stands beside
BESIDE = {"identified": "", "cad": ": CAD", "null": ": null model", "noise_floor": ": noise floor"}


@dataclass(frozen=True)
class Unmodeled:
    """What a plant of the lab has that acts in the trials from which the parameters `on` come.

    unless: the model has it too if this parameter is identified, or one that differs by a number at its end.
    count: key of the list in the truth that says how many of these the plant has.
    """

    words: str
    on: tuple[str, ...]
    unless: str = ""
    count: str = ""

    def lacking(self, truth: dict, identified: Collection[str]) -> str:
        """What of it a model lacks of which these parameters are identified; empty if nothing."""
        modelled = len({self.unless, f"{self.unless}_2", f"{self.unless}_3"} & set(identified))
        if not self.count:
            return "" if modelled else self.words
        present = len(truth[self.count])
        return f"{self.words} (it has {modelled} of {present})" if modelled < present else ""


SPRINGS = ("stiffness", "hardening", "joint_place")
LEAN = ("mount_tilt_x", "mount_tilt_y")
BENDS = ("rest_bend_x", "rest_bend_y")
REST = (*BENDS, "rest_gradient_x", "rest_gradient_y")
RELAXING = tuple(f"{name}{end}" for end in ("", "_2", "_3") for name in ("relaxation", "relaxation_time"))
MEMORY = ("hysteresis", "yield_bend", "hysteresis_2", "yield_bend_2", "hysteresis_3", "yield_bend_3")
CURLED = ("kp", "capstan_friction")
RUBBING = ("tendon_friction", "friction_time")
MOTORS = (*CURLED, "kv", "time_constant", "dead_time", "rate_limit", "backlash")
LACKING = {
    "cousin": (
        Unmodeled("a motor with a limited rate and a delay", ("kp", "kv")),
        Unmodeled("a motor with a limited rate and a delay, which has no time constant", ("time_constant",)),
        Unmodeled("two joints in every unit", ("hardening", "damping", "kp")),
        Unmodeled("dry friction in the joints", ("hardening", "damping", *RUBBING, "kv"), unless="joint_friction"),
        Unmodeled("scatter from unit to unit", SPRINGS),
        Unmodeled("masses off", ("stiffness", "damping", "tendon_friction", "kp", "kv", "force_range")),
        Unmodeled("another integrator", ("damping",)),
    ),
    "stranger": (
        Unmodeled("a limited rate of the motors", MOTORS, unless="rate_limit"),
        Unmodeled("backlash of the motors", MOTORS, unless="backlash"),
        Unmodeled("cables that differ", MOTORS),
        Unmodeled("dead time of the motors", MOTORS, unless="dead_time"),
        Unmodeled("friction on its holes", (*SPRINGS, *RUBBING, "kp", "kv", "force_range"), "capstan_friction"),
        Unmodeled("Maxwell branches", ("damping", *RELAXING, *MEMORY, *RUBBING, "kp", "kv"), "relaxation", "branches"),
        Unmodeled("sliders", (*SPRINGS, "damping", *RELAXING, *MEMORY, *RUBBING, *CURLED), "hysteresis", "sliders"),
        Unmodeled("a rest shape", (*SPRINGS, *LEAN), unless="rest_bend_x"),
        Unmodeled("a rest shape that grows towards the tip", (*BENDS, *LEAN), unless="rest_gradient_x"),
        Unmodeled("a mount that leans", (*SPRINGS, *REST), unless="mount_tilt_x"),
        Unmodeled("several links in every unit", (*SPRINGS, "damping", "kp"), unless="joint_place"),
        Unmodeled("scatter from link to link", (*SPRINGS, *REST, *LEAN)),
        Unmodeled("masses off", ("stiffness", "damping", "tendon_friction", "kp", "kv", "force_range")),
    ),
}


def truth_table(root: Path) -> str:
    """A row for each identified parameter: truth, what is expected, what was found, and whether the interval holds it.

    Motion tells forces only up to a common factor, which the masses set. So what is to be expected of a force is the
    truth over the factor by which the lab's masses exceed those of the CAD model. Of a parameter that several stages
    identify the last one counts.
    """
    truth, rows = _json(root / TRUTH), identified(root)
    lines = [
        f"| parameter | truth | expected | found | {interval_words(rows.values())} | holds it | the model lacks |",
        "|---|---:|---:|---:|---:|---|---|",
    ]
    for name, row in rows.items():
        expected = expectation(truth, name)
        unit = f", {row['unit']}" if row["unit"] else ""
        cells = [f"`{name}`{unit}", _number(truth.get("parameters", {}).get(name)), _number(expected)]
        low, high = stated_interval(row) or (None, None)
        interval = "undetermined" if row["undetermined"] else f"{_number(low)} … {_number(high)}"
        verdict = {True: "yes", False: "**no**", None: ""}[holds(row, expected)]
        effects = [effect for effect in LACKING.get(truth.get("plant", ""), ()) if name in effect.on]
        lacking = [words for effect in effects if (words := effect.lacking(truth, rows))]
        cells += [_number(row["value"]), interval, verdict, ", ".join(lacking)]
        lines.append(f"| {' | '.join(cells)} |")
    return "\n".join([*lines, "", _widths(rows, truth), _factors(root, truth), *_unanswered(truth)])


def identified(root: Path) -> dict[str, dict]:
    """The rows of all stages' parameters.json, by name; of a parameter that two stages identify, the later one."""
    tables = read_tables(root / "artifacts")
    return {name: tables[stage]["parameters"][name] for name, stage in last_stages(tables, "parameters").items()}


def expectation(truth: dict, name: str) -> float | None:
    """What a parameter would come out as if the model were the lab's arm but for its masses; None if it has none."""
    value = truth.get("parameters", {}).get(name)
    return value / truth["mass_factor"] if value is not None and name in truth["forces"] else value


def holds(row: dict, expected: float | None) -> bool | None:
    """Whether a parameter's interval holds what is expected; None where one of them is not there."""
    interval = stated_interval(row)
    if row["undetermined"] or expected is None or not interval:
        return None
    return bool(interval[0] <= expected <= interval[1])


def _widths(rows: dict[str, dict], truth: dict) -> str:
    """How many intervals hold the truth, and whether they are as wide as errors ask for, in a sentence."""
    ratios, verdicts, plain = [], [], []
    for name, row in rows.items():
        expected = expectation(truth, name)
        if (verdict := holds(row, expected)) is not None:
            low, high, value, truly = parameter_named(name).coordinate([*stated_interval(row), row["value"], expected])
            ratios.append((value - truly) / (high - low) * 2)
            verdicts.append(verdict)
            plain.append(bool(holds(row | {"interval_95": row.get("interval_95_given_model", [])}, expected)))
    inside, rms = sum(verdicts), np.sqrt(np.mean(np.square(ratios or [np.nan])))
    counts = f"{inside} of {len(ratios)}; given the model alone, {sum(plain)}"
    return (
        f"Intervals that hold what is expected: {counts}. Error over half\nwidth: {rms:.2f} (root mean square; "
        f"{1 / ndtri(0.975):.2f} where they are as wide as they have to be, less where wider)."
    )


def _factors(root: Path, truth: dict) -> str:
    """How the joints' factors of stiffness compare with the lab's scatter, in a sentence."""
    table = read_tables(root / "artifacts").get(STAGES[0], {}).get("per_joint", {}).get("stiffness")
    real = truth.get("stiffness_factors")
    if not table or not real or "half_width_95_given_model" not in table:
        return "Factors of single joints: –"
    factors, real = np.array(table["factor"]), np.array(real)
    halves = np.array([np.inf if half is None else half for half in table["half_width_95_given_model"]])
    inside = int(np.sum(np.abs(factors - real) <= halves))
    correlation = np.corrcoef(factors, real)[0, 1]
    return (
        f"Factors of single joints' stiffness: correlation with the lab's own scatter {correlation:.2f}; "
        f"{inside} of {len(real)}\nof their intervals hold it."
    )


def _unanswered(truth: dict) -> list[str]:
    """What the lab has that no single parameter answers to, in a sentence."""
    if "branches" not in truth:
        return []
    branches = ", ".join(f"{_number(row['ratio'])} for {_number(row['time_s'])} s" for row in truth["branches"])
    sliders = ", ".join(f"{_number(row['ratio'])} up to {_number(row['bend_rad'])} rad" for row in truth["sliders"])
    return [
        f"The lab's Maxwell branches, over its springs: {branches}.\nIts sliders: {sliders}.\n"
        f"Its motors wind at most {_number(truth['rate_limit_m_s'])} m/s, with "
        f"{_number(1e3 * truth['backlash_m'])} mm of backlash."
    ]


def error_table(root: Path) -> str:
    """Every known source of error for itself: of the shipped model by kind of trial, of starts, clocks, poses and the
    time step."""
    metrics = {stage: _json(root / "artifacts" / stage / "metrics.json") for stage in (*STAGES, "score", "filter")}
    lines = ["| error | mean | largest | of |", "|---|---:|---:|---|"]
    for kind, words in KINDS.items():
        if not _at(metrics[SHIPPED], "identified", VALIDATE, "by_experiment", kind):
            continue
        for split, table in ((VALIDATE, metrics[SHIPPED]), (TEST, metrics["score"].get(SHIPPED, {}))):
            for model, of in BESIDE.items():
                row = _at(table, model, split, "by_experiment", kind)
                count = f"{row.get('trials', '–')} trials, `{SHIPPED}`"
                lines.append(_row(f"position / tip, {words} of `{split}`{of}", row, count))
        fit = _at(metrics[SHIPPED], "start_fit", "by_experiment", kind)
        mean, largest = (f"{_number(fit.get(key))} mm" for key in ("mean_mm", "max_mm"))
        lines.append(f"| pose from which {words} start | {mean} | {largest} | markers, `identify` and `validate` |")
    for stage in STAGES[1:]:
        step = _at(metrics[stage], "halved_step").get("max_mm")
        lines.append(f"| time step, against half of it, `{stage}` | | {_number(step)} mm | one marker in one frame |")
    return "\n".join([*lines, *_start_rows(root, metrics["filter"])])


def _start_rows(root: Path, filtered: dict) -> list[str]:
    """Detected starts and the clock's offset against the truth."""
    truth, moving, rows = _json(root / TRUTH), filtered.get("moving", {}), []
    starts = truth.get("starts_s", {})
    for kind in EXPERIMENTS:  # of one at rest no trial is moving; the lab names its trials by their kind
        late = [1e3 * (moving[name]["start_s"] - start) for name, start in starts.items()
                if name.startswith(kind) and name in moving]  # fmt: skip
        if late:
            cells = f"{np.mean(late):+.2f} ms | {max(late, key=abs):+.2f} ms | {len(late)} trials, all splits"
            rows.append(f"| detected start of a {kind}, late | {cells} |")
    offset = _json(root / "artifacts/ingest/metrics.json").get("clock_offset_ms")
    error = None if offset is None or "clock_offset_s" not in truth else abs(offset + 1e3 * truth["clock_offset_s"])
    return [*rows, f"| clock of the motors against the cameras' | | {_number(error)} ms | the session |"]


def _row(what: str, row: dict, count: str) -> str:
    mean, worst = (
        " / ".join(_number(row.get(f"{error}{end}_mm")) for error in ("e_position", "e_tip")) for end in ("", "_worst")
    )
    return f"| {what} | {mean} mm | {worst} mm | {count} |"


def _at(table: dict, *keys: str) -> dict:
    for key in keys:
        table = table.get(key, {})
    return table


def _json(path: Path) -> dict:
    return json.loads(path.read_text(encoding="utf-8")) if path.is_file() else {}
