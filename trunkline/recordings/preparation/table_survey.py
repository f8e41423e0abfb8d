"""What a table holds, by a guess at its columns: as `survey` has it of a log, a trial each."""

from pathlib import Path

import yaml
from pydantic import ValidationError

from trunkline.errors import InputError, first_problem
from trunkline.recordings.preparation.survey import LogSurvey
from trunkline.recordings.session.session import Session
from trunkline.recordings.signals.units import METRES_PER
from trunkline.recordings.tables.guess import guess
from trunkline.recordings.tables.source import TableReader
from trunkline.recordings.trials.splits import IDENTIFY


def survey_table(path: Path) -> list[LogSurvey]:
    """Look through a table; the first survey has what was guessed, and why.

    Raises:
        InputError: it cannot be read, or has no columns of positions.
    """
    guessed = guess(path)
    text = "\n".join(guessed.tables)
    labels = guessed.labels or [None]
    entries = [
        {"name": str(number), "file": path.name, "label": label, "experiment": "motion", "split": IDENTIFY}
        for number, label in enumerate(labels)
    ]
    content = {"frame": {"up": [0, 0, 1]}, "base": {"position": [0, 0, 0]}, "tables": yaml.safe_load(text)}
    try:
        session = Session.model_validate(content | {"trials": entries})
    except ValidationError as error:
        raise InputError(f"{path}: guessed {' '.join(text.split())}: {first_problem(error)}") from error
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
                stream.positions *= guessed.metres
    surveys[0].notes = guessed.why
    for survey in surveys:
        survey.tables = ["tables:", *(f"  {line}" for line in guessed.tables), *guessed.motors]
        survey.unit = guessed.unit if guessed.unit in METRES_PER else None
    return surveys
