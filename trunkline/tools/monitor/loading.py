"""From the logs of a session that are there to filtered trials, as the stages `ingest` and `filter` make them."""

import os
import tempfile
from collections.abc import Iterator
from contextlib import contextmanager
from dataclasses import dataclass, field
from pathlib import Path

from omegaconf import OmegaConf

from trunkline.errors import InputError
from trunkline.pipeline.config import settings_of
from trunkline.recordings.cleaning.loading import load_raw_trials
from trunkline.recordings.cleaning.session_checks import check_session
from trunkline.recordings.filtering.filter import filter_raw_trial
from trunkline.recordings.session.session import Session, read_session
from trunkline.recordings.trials.trial import Trial
from trunkline.settings import read_yaml


@dataclass
class Intake:
    """trials: by name. refused: why a trial cannot be used, by name."""

    trials: dict[str, Trial] = field(default_factory=dict)
    refused: dict[str, str] = field(default_factory=dict)


def take(session: Path, files: set[str], root: Path) -> Intake:
    """The trials of those of a session's logs that are there; what a motors' clock or a vertical is, all of them say.

    Args:
        files: names of the logs. root: holds the params.yaml that says how to take logs in and to filter them.

    Raises:
        InputError: session.yaml has a mistake.
    """
    with _so_far(session, files) as (folder, read):
        ingest, settings = settings_of("ingest", root), settings_of("filter", root)
        taken = list(load_raw_trials(folder, read, ingest.limits))
        found = Intake(refused={trial.name: str(one) for trial, one, _ in taken if isinstance(one, InputError)})
        if len(found.refused) < len(taken):
            gathered = check_session(taken, read, ingest.plausible, "leave_out", f"{session}")
            found.refused |= gathered.refused
            for one, findings in zip(gathered.takes, gathered.findings, strict=True):
                one.repairs = len(findings.repairs)
                try:
                    found.trials[one.name] = filter_raw_trial(one, settings)[0]
                except InputError as error:
                    found.refused[one.name] = str(error)
        found.refused = {name: said.replace(f"{folder}", f"{session}") for name, said in found.refused.items()}
        return found


@contextmanager
def _so_far(session: Path, files: set[str]) -> Iterator[tuple[Path, Session]]:
    """A folder with links to a session's logs that are there and a session.yaml of their trials alone."""
    path = session / "session.yaml"
    content = OmegaConf.to_container(read_yaml(path), resolve=False)
    assert isinstance(content, dict)  # as `incoming.planned` has seen
    content["trials"] = [trial for trial in content["trials"] if trial["file"] in files]
    with tempfile.TemporaryDirectory(prefix="trunkline-watch-") as name:
        folder = Path(name) / session.resolve().name
        folder.mkdir()
        for file in sorted(files):
            os.symlink((session / file).resolve(), folder / file)
        OmegaConf.save(OmegaConf.create(content), folder / "session.yaml")
        try:
            yield folder, read_session(folder)
        except InputError as error:
            raise InputError(str(error).replace(f"{folder}", f"{session}")) from error
