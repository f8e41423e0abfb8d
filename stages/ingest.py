"""Read the session's MCAP logs: trials as Parquet, and a report on the quality of the data."""

import sys
from dataclasses import field
from functools import partial
from pathlib import Path

from trunkline.compute.progress import progress
from trunkline.errors import InputError
from trunkline.pipeline.stage import output_folder, run_stage, write_json, write_metrics
from trunkline.recordings.cleaning.checks import Limits
from trunkline.recordings.cleaning.loading import take_in
from trunkline.recordings.cleaning.quality import by_sentence, clock_facts, judge, remarks, report, summary
from trunkline.recordings.cleaning.same_arm import gather_each
from trunkline.recordings.cleaning.sanity_checks import Plausible
from trunkline.recordings.cleaning.session_checks import Gathered, Refusal, gather, require_enough, together
from trunkline.recordings.session.session import OneFolder, Session, SomeSessions, session_folders
from trunkline.recordings.trials.raw_trial import write_takes
from trunkline.report.figures.data import quality_figure
from trunkline.report.figures.style import save_figure
from trunkline.settings import settings

RAW, PROCESSED, ARTIFACTS = Path("data/raw"), Path("data/processed/ingest"), Path("artifacts/ingest")


@settings
class Config:
    """only: of several sessions in the folder `session` those to read, in this order; by default all."""

    session: OneFolder
    refused_trials: Refusal
    limits: Limits
    plausible: Plausible
    only: SomeSessions = field(default_factory=list)


def main(config: Config) -> None:
    folders = session_folders(RAW / config.session, config.only)
    found = gather_each(folders, partial(gathered_of, config=config), config.plausible.distance)
    gathered = together(list(found.values()))
    qualities = [judge(take, found) for take, found in zip(gathered.takes, gathered.findings, strict=True)]
    for take, said in zip(gathered.takes, gathered.findings, strict=True):
        take.repairs = len(said.repairs)
    for line in remarks(qualities):
        print(f"ingest: {line}")
    clocks = {name: clock_facts(one.clock) for name, one in found.items()} if len(found) > 1 else None
    with output_folder(PROCESSED) as processed, output_folder(ARTIFACTS) as artifacts:
        write_takes(processed, gathered.takes)
        write_json(artifacts / "quality.json", report(qualities, gathered) | ({"clocks": clocks} if clocks else {}))
        write_metrics(artifacts, summary(qualities, gathered))
        save_figure(quality_figure(qualities, gathered), artifacts / "quality.png")
    for reason in gathered.refused.values():
        print(f"ingest: warning: left out: {reason}", file=sys.stderr)
    for line in by_sentence(qualities, lambda found: found.repairs):
        print(f"ingest: repaired: {line}", file=sys.stderr)
    for line in by_sentence(qualities, lambda found: found.warnings):
        print(f"ingest: warning: {line}", file=sys.stderr)


def gathered_of(folder: Path, session: Session, config: Config) -> Gathered:
    """The takes of one session, whose clock and vertical are its own."""
    with progress(len(session.trials), "ingest", "trials") as bar:
        taken = []
        for trial, take, found in take_in(folder, session, config.limits):
            if isinstance(take, InputError) and config.refused_trials == "stop":
                raise take
            taken.append((trial, take, found))
            bar.update(1, trial=trial.name)
    gathered = gather(taken, session, config.plausible, config.refused_trials, f"{folder}")
    require_enough(gathered, session.trials)
    return gathered


if __name__ == "__main__":
    run_stage("ingest", Config, main)
