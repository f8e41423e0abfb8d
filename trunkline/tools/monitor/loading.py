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
from trunkline.recordings.cleaning.described_arm import Places
from trunkline.recordings.cleaning.loading import load_raw_trials
from trunkline.recordings.cleaning.session_checks import check_session
from trunkline.recordings.filtering.filter import filter_raw_trial
from trunkline.recordings.session.session import Session, read_session
from trunkline.recordings.trials.trial import Trial
from trunkline.settings import read_yaml


@dataclass
class LoadedTrials:
    """trials: by name. refused: why a trial cannot be used, by name."""

    trials: dict[str, Trial] = field(default_factory=dict)
    refused: dict[str, str] = field(default_factory=dict)


def load_logs(session: Path, files: set[str], root: Path, arm: Places | None = None) -> LoadedTrials:
    """The trials of those of a session's logs that are there; what a motors' clock or a vertical is, all of them say.

    Args:
        files: names of the logs. root: holds the params.yaml that says how to take logs in and to filter them.
        arm: the described one, by which logs are checked; None where nobody describes it.

    Raises:
        InputError: session.yaml has a mistake, or the logs cannot be of the arm.
    """
    with _so_far(session, files) as (folder, read):
        ingest, settings = settings_of("ingest", root), settings_of("filter", root)
        taken = list(load_raw_trials(folder, read, ingest.limits, arm))
        unreadable = {trial.name: str(result) for trial, result, _ in taken if isinstance(result, InputError)}
        loaded = LoadedTrials(refused=unreadable)
        if len(loaded.refused) < len(taken):
            gathered = check_session(taken, read, ingest.plausible, "leave_out", f"{session}", arm)
            loaded.refused |= gathered.refused
            for raw, findings in zip(gathered.raw_trials, gathered.findings, strict=True):
                raw.repairs = len(findings.repairs)
                try:
                    loaded.trials[raw.name] = filter_raw_trial(raw, settings)[0]
                except InputError as error:
                    loaded.refused[raw.name] = str(error)
        loaded.refused = {name: reason.replace(f"{folder}", f"{session}") for name, reason in loaded.refused.items()}
        return loaded


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
            (folder / file).parent.mkdir(exist_ok=True)
            os.symlink((session / file).resolve(), folder / file)
        OmegaConf.save(OmegaConf.create(content), folder / "session.yaml")
        try:
            yield folder, read_session(folder)
        except InputError as error:
            raise InputError(str(error).replace(f"{folder}", f"{session}")) from error
