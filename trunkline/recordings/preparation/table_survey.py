"""What a table holds, by a guess at its columns: as `survey` has it of a log, a trial each."""

from pathlib import Path

import yaml

from trunkline.errors import InputError
from trunkline.recordings.preparation.survey import LogSurvey
from trunkline.recordings.session.session import Session
from trunkline.recordings.signals.units import METRES_PER
from trunkline.recordings.tables.guess import guess
from trunkline.recordings.tables.source import TableReader


def survey_table(path: Path) -> list[LogSurvey]:
    """Look through a table; the first survey has what was guessed, and why.

    Raises:
        InputError: it cannot be read, or has no columns of positions.
    """
    seen = guess(path)
    text = "\n".join(seen.tables)
    labels = seen.labels or [None]
    entries = [
        {"name": str(number), "file": path.name, "label": label, "experiment": "motion", "split": "identify"}
        for number, label in enumerate(labels)
    ]
    session = Session.model_validate(
        {"frame": {"up": [0, 0, 1]}, "base": {"position": [0, 0, 0]}, "tables": yaml.safe_load(text), "trials": entries}
    )
    reader, surveys = TableReader(path.parent, session), []
    for label, trial in zip(labels, session.trials, strict=True):
        try:
            source = reader.open(trial)
        except InputError as error:
            raise InputError(f"{error}; guessed: {' '.join(text.split())}") from error
        surveys.append(LogSurvey(source.log, poses=source.poses, commands=source.commands,
                                 tendon_positions=source.tendon_positions, label=label))  # fmt: skip
        for stream in (source.commands, source.tendon_positions):
            if stream is not None:
                stream.positions *= seen.metres
    surveys[0].notes = seen.why
    for survey in surveys:
        survey.tables = ["tables:", *(f"  {line}" for line in seen.tables), *seen.motors]
        survey.unit = seen.unit if seen.unit in METRES_PER else None
    return surveys
