"""Read the session's MCAP logs: trials as Parquet, and a report on the quality of the data."""

import sys
from dataclasses import field
from functools import partial
from pathlib import Path

from trunkline.compute.progress import progress
from trunkline.errors import InputError
from trunkline.model.places import marker_places
from trunkline.model_files import read_spec
from trunkline.pipeline.stage import output_folder, run_stage, write_json, write_metrics
from trunkline.recordings.cleaning.checks import TrialLimits
from trunkline.recordings.cleaning.described_arm import Places
from trunkline.recordings.cleaning.loading import load_raw_trials
from trunkline.recordings.cleaning.quality import by_sentence, clock_facts, judge, remarks, report, summary
from trunkline.recordings.cleaning.same_arm import check_each_session
from trunkline.recordings.cleaning.sanity_checks import SanityLimits
from trunkline.recordings.cleaning.session_checks import (
    CheckedSession,
    Refusal,
    check_session,
    require_enough,
    together,
)
from trunkline.recordings.session.session import OneFolder, Session, SomeSessions, session_folders
from trunkline.recordings.trials.raw_trial import write_raw_trials
from trunkline.report.figures.data import quality_figure
from trunkline.report.figures.style import save_figure
from trunkline.settings import settings

ARM = Path("artifacts/build_mjcf/arm.xml")
RAW, PROCESSED, ARTIFACTS = Path("data/raw"), Path("data/processed/ingest"), Path("artifacts/ingest")


@settings
class Config:
    """only: of several sessions in the folder `session` those to read, in this order; by default all."""

    session: OneFolder
    refused_trials: Refusal
    limits: TrialLimits
    plausible: SanityLimits
    only: SomeSessions = field(default_factory=list)


def main(config: Config) -> None:
    folders = session_folders(RAW / config.session, config.only)
    arm = marker_places(read_spec(ARM).compile()) if ARM.is_file() else None
    sessions = check_each_session(folders, partial(gathered_of, config=config, arm=arm), config.plausible.distance)
    gathered = together(list(sessions.values()))
    qualities = [judge(raw, sessions) for raw, sessions in zip(gathered.raw_trials, gathered.findings, strict=True)]
    for raw, finding in zip(gathered.raw_trials, gathered.findings, strict=True):
        raw.repairs = len(finding.repairs)
    for line in remarks(qualities):
        print(f"ingest: {line}")
    clocks = {name: clock_facts(session.clock) for name, session in sessions.items()} if len(sessions) > 1 else None
    with output_folder(PROCESSED) as processed, output_folder(ARTIFACTS) as artifacts:
        write_raw_trials(processed, gathered.raw_trials)
        write_json(artifacts / "quality.json", report(qualities, gathered) | ({"clocks": clocks} if clocks else {}))
        write_metrics(artifacts, summary(qualities, gathered))
        save_figure(quality_figure(qualities, gathered), artifacts / "quality.png")
    for reason in gathered.refused.values():
        print(f"ingest: warning: left out: {reason}", file=sys.stderr)
    for line in by_sentence(qualities, lambda sessions: sessions.repairs):
        print(f"ingest: repaired: {line}", file=sys.stderr)
    for line in by_sentence(qualities, lambda sessions: sessions.warnings):
        print(f"ingest: warning: {line}", file=sys.stderr)


def gathered_of(folder: Path, session: Session, config: Config, arm: Places | None = None) -> CheckedSession:
    """The raw trials of one session, whose clock and vertical are its own. arm: the described one, if there is one."""
    with progress(len(session.trials), "ingest", "trials") as bar:
        taken = []
        for trial, raw, findings in load_raw_trials(folder, session, config.limits, arm):
            if isinstance(raw, InputError) and config.refused_trials == "stop":
                raise raw
            taken.append((trial, raw, findings))
            bar.update(1, trial=trial.name)
    gathered = check_session(taken, session, config.plausible, config.refused_trials, f"{folder}", arm)
    require_enough(gathered, session.trials)
    return gathered


if __name__ == "__main__":
    run_stage("ingest", Config, main)
