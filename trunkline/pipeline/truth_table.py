"""What was identified in the demo session, and how far off it is, beside the stand-in lab's truth: Markdown tables."""

import json
from pathlib import Path

import numpy as np

from trunkline.trials.splits import TEST, VALIDATE

STAGES = ("identify_stiffness", "identify_damping", "identify_control")
TRUTH = Path("data/raw/demo.truth.json")
# whose errors: of the identified model, and of what it stands beside
BESIDE = {"identified": "", "cad": ": CAD", "null": ": null model", "noise_floor": ": noise floor"}
# identified parameter: what the lab has, and the model has not, that acts in the same trials
LACKING = {
    "stiffness": "scatter from unit to unit, masses off",
    "hardening": "two joints in every unit, dry friction in them, scatter from unit to unit",
    "damping": "two joints in every unit, dry friction in them, masses off, another integrator",
    "tendon_friction": "dry friction in the joints, masses off",
    "friction_time": "dry friction in the joints",
    "kp": "a motor with a limited rate and a delay, two joints in every unit, masses off",
    "kv": "a motor with a limited rate and a delay, dry friction in the joints, masses off",
    "force_range": "masses off",
    "time_constant": "a motor with a limited rate and a delay, which has no time constant",
}


def truth_table(root: Path) -> str:
    """A row for each identified parameter: truth, what is expected, what was found, and whether the interval holds it.

    Motion tells forces only up to a common factor, which the masses set. So what is to be expected of a force is the
    truth over the factor by which the lab's masses exceed those of the CAD model.
    """
    truth = _json(root / TRUTH)
    lines = [
        "| parameter | truth | expected | found | 95 % interval, given the model | holds it | the model lacks |",
        "|---|---:|---:|---:|---:|---|---|",
    ]
    for name, row in identified(root).items():
        expected = expectation(truth, name)
        cells = [f"`{name}`, {row['unit']}", _number(truth.get("parameters", {}).get(name)), _number(expected)]
        low, high = row.get("interval_95_given_model", (None, None))
        interval = "undetermined" if row["undetermined"] else f"{_number(low)} … {_number(high)}"
        held = {True: "yes", False: "**no**", None: ""}[holds(row, expected)]
        cells += [_number(row["value"]), interval, held, LACKING.get(name, "")]
        lines.append(f"| {' | '.join(cells)} |")
    return "\n".join([*lines, "", _factors(root, truth)])


def identified(root: Path) -> dict[str, dict]:
    """The rows of all stages' parameters.json, by name; of a parameter that two stages identify, the later one."""
    found = {}
    for stage in STAGES:
        found |= _json(root / "artifacts" / stage / "parameters.json").get("parameters", {})
    return found


def expectation(truth: dict, name: str) -> float | None:
    """What a parameter would come out as if the model were the lab's arm but for its masses; None if it has none."""
    value = truth.get("parameters", {}).get(name)
    return value / truth["mass_factor"] if value is not None and name in truth["forces"] else value


def holds(row: dict, expected: float | None) -> bool | None:
    """Whether a parameter's interval holds what is expected; None where one of them is not there."""
    interval = row.get("interval_95_given_model")
    if row["undetermined"] or expected is None or interval is None:
        return None
    return bool(interval[0] <= expected <= interval[1])


def _factors(root: Path, truth: dict) -> str:
    """How the joints' factors of stiffness compare with the lab's scatter, in a sentence."""
    table = _json(root / "artifacts/identify_stiffness/parameters.json").get("per_joint", {}).get("stiffness")
    real = truth.get("stiffness_factors")
    if not table or not real or "half_width_95_given_model" not in table:
        return "Factors of single joints: –"
    found, real = np.array(table["factor"]), np.array(real)
    halves = np.array([np.inf if half is None else half for half in table["half_width_95_given_model"]])
    inside = int(np.sum(np.abs(found - real) <= halves))
    correlation = np.corrcoef(found, real)[0, 1]
    return (
        f"Factors of single joints' stiffness: correlation with the lab's own scatter {correlation:.2f}; "
        f"{inside} of {len(real)}\nof their intervals hold it."
    )


def error_table(root: Path) -> str:
    """Every known source of error for itself: of trials by kind, of starts, clocks, poses and the time step."""
    metrics = {stage: _json(root / "artifacts" / stage / "metrics.json") for stage in (*STAGES, "score", "filter")}
    lines = ["| error | mean | largest | of |", "|---|---:|---:|---|"]
    for stage, kind in zip(STAGES, ("static_tilt", "release", "curl"), strict=True):
        words = {"static_tilt": "static tilts", "release": "releases", "curl": "curls"}[kind]
        for split, table in ((VALIDATE, metrics[stage]), (TEST, metrics["score"].get(stage, {}))):
            for model, of in BESIDE.items():
                row = _at(table, model, split, "by_experiment", kind)
                count = f"{row.get('trials', '–')} trials, `{stage}`"
                lines.append(_row(f"position / tip, {words} of `{split}`{of}", row, count))
        fit = _at(metrics[stage], "start_fit", "by_experiment", kind)
        mean, largest = (f"{_number(fit.get(key))} mm" for key in ("mean_mm", "max_mm"))
        lines.append(f"| pose from which {words} start | {mean} | {largest} | segments, `identify` and `validate` |")
    for stage in STAGES[1:]:
        step = _at(metrics[stage], "halved_step").get("max_mm")
        lines.append(f"| time step, against half of it, `{stage}` | | {_number(step)} mm | one segment in one frame |")
    return "\n".join([*lines, *_start_rows(root, metrics["filter"])])


def _start_rows(root: Path, filtered: dict) -> list[str]:
    """Detected starts and the clock's offset against the truth."""
    truth, moving, rows = _json(root / TRUTH), filtered.get("moving", {}), []
    starts = truth.get("starts_s", {})
    for kind in ("release", "curl"):
        late = [1e3 * (moving[name]["start_s"] - start) for name, start in starts.items()
                if name.startswith(kind) and name in moving]  # fmt: skip
        cells = [f"{np.mean(late):+.2f} ms", f"{max(late, key=abs):+.2f} ms"] if late else ["–", "–"]
        rows.append(f"| detected start of a {kind}, late | {cells[0]} | {cells[1]} | {len(late)} trials, all splits |")
    found = _json(root / "artifacts/ingest/metrics.json").get("clock_offset_ms")
    error = None if found is None or "clock_offset_s" not in truth else abs(found + 1e3 * truth["clock_offset_s"])
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


def _number(value: float | None) -> str:
    return "–" if value is None else f"{value:.4g}"
