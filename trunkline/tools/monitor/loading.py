"""From the logs of a session that are there to filtered trials, as the stages `ingest` and `filter` make them."""

from dataclasses import dataclass, field
from pathlib import Path

from trunkline.errors import InputError
from trunkline.pipeline.config import settings_of
from trunkline.recordings.cleaning.described_arm import Places
from trunkline.recordings.cleaning.loading import load_raw_trials
from trunkline.recordings.cleaning.session_checks import check_session
from trunkline.recordings.filtering.filter import filter_raw_trial
from trunkline.recordings.session.session import read_session
from trunkline.recordings.trials.trial import Trial


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
    ingest, settings, read = settings_of("ingest", root), settings_of("filter", root), read_session(session, files)
    taken = list(load_raw_trials(session, read, ingest.limits, arm))
    loaded = LoadedTrials(refused={t.name: str(result) for t, result, _ in taken if isinstance(result, InputError)})
    if len(loaded.refused) == len(taken):
        return loaded
    gathered = check_session(taken, read, ingest.plausible, "leave_out", f"{session}", arm)
    loaded.refused |= gathered.refused
    for raw, findings in zip(gathered.raw_trials, gathered.findings, strict=True):
        raw.repairs = len(findings.repairs)
        try:
            loaded.trials[raw.name] = filter_raw_trial(raw, settings)[0]
        except InputError as error:
            loaded.refused[raw.name] = str(error)
    return loaded
