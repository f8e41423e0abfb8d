"""The stages that identify, by their names everywhere, and the files that each writes."""

import json
from collections.abc import Iterable
from pathlib import Path

from trunkline.errors import InputError, existing

STAGES = ("identify_stiffness", "identify_damping", "identify_control")  # in their order: each goes on from the last
MODEL, TABLE = "arm.xml", "parameters.json"
SCALARS = ("parameters", "per_session")  # a table's tables of parameters of one number
COMPARED = {"experiments", "frames", "command_delay"}  # what a table has of how trials were compared, see `Compared`


def model_name(stage: str, stages: Iterable[str]) -> str:
    """What a table calls the model of `stage`: that of the last of `stages` is shipped, all others are intermediate."""
    *_, last = stages
    return stage if stage == last else f"{stage} (intermediate model)"


def final_model(artifacts: Path) -> Path | None:
    """The model of the last stage that has run, which has all that was identified; None where none has."""
    models = (artifacts / stage / MODEL for stage in reversed(STAGES))
    return next(filter(Path.is_file, models), None)


def read_tables(artifacts: Path, stages: Iterable[str] = STAGES) -> dict[str, dict]:
    """What `stages` wrote into parameters.json, by stage and in their order; those that have not run are left out.

    Raises:
        InputError: a file is no such table.
    """
    files = {stage: artifacts / stage / TABLE for stage in stages}
    return {stage: read_table(file) for stage, file in files.items() if file.is_file()}


def last_stages(tables: dict[str, dict], *keys: str) -> dict[str, str]:
    """By name of a parameter in tables' `keys`, the stage that is the last to identify it: the model has its value."""
    return {name: stage for stage, table in tables.items() for key in keys for name in table.get(key, {})}


def stated_interval(row: dict) -> list[float]:
    """The 95 % interval of a parameter's row in a table: with what the model fixes, where that was considered, else
    given the model. Empty where the row has neither."""
    return row.get("interval_95", row.get("interval_95_given_model", []))


def contradicted(tables: dict[str, dict], table: dict) -> list[str]:
    """A line for each parameter of a stage whose 95 % interval has no value in common with an earlier stage's.

    Args:
        tables: of the earlier stages, as `read_tables`. table: of the stage.
    """
    lines = []
    for before, earlier in tables.items():
        rows, rows_before = ({name: row for key in SCALARS for name, row in t.get(key, {}).items()}
                             for t in (table, earlier))  # fmt: skip
        for name in [name for name in rows if name in rows_before]:
            ends = [stated_interval(some[name]) for some in (rows_before, rows)]
            if all(ends) and (ends[0][0] > ends[1][1] or ends[1][0] > ends[0][1]):
                (low, high), (least, most) = ends
                lines.append(
                    f"{name}: found {least:.3g} to {most:.3g} here and {low:.3g} to {high:.3g} in {before}, expected "
                    "intervals that overlap: are commands, loads and gravity alike in the trials of both?"
                )
    return lines


def interval_words(rows: Iterable[dict]) -> str:
    """What the `stated_interval` of rows is called; of stages that differ in what they consider, no more than that."""
    wide = {"interval_95" in row for row in rows}
    promise = ", with the model's tolerances" if wide == {True} else ", given the model" if wide == {False} else ""
    return f"95 % interval{promise}"


def read_table(file: Path) -> dict:
    """`parameters`, `fitted_to` and `compared` are in it, whoever reads it.

    Raises:
        InputError: there is no such file, or it is no such table.
    """
    try:
        table = json.loads(existing(file).read_text(encoding="utf-8"))
        table["parameters"].items()
        table["fitted_to"].items()
        if lacking := COMPARED - table["compared"].keys():
            raise KeyError(f"compared: {min(lacking)}")
        return table
    except (ValueError, KeyError, TypeError, AttributeError) as error:
        raise InputError(f"{file}: {error!r}, expected what a stage of identification writes") from error
