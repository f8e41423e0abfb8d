"""Read the session's MCAP logs: trials as Parquet, and a report on the quality of the data."""

from pathlib import Path
from typing import Literal

from pydantic import Field

from trunkline.errors import InputError
from trunkline.figures.data import quality_figure
from trunkline.figures.style import save_figure
from trunkline.pipeline.stage import output_folder, run_stage, write_json
from trunkline.progress import progress
from trunkline.sessions.session import read_session
from trunkline.settings import settings
from trunkline.takes.agreement import align_clocks, settle_vertical
from trunkline.takes.checks import Limits
from trunkline.takes.intake import take_in
from trunkline.takes.quality import judge, report, summary
from trunkline.trials.take import write_takes

RAW, PROCESSED, ARTIFACTS = Path("data/raw"), Path("data/processed/ingest"), Path("artifacts/ingest")


@settings
class Config:
    session: str = Field(min_length=1)
    refused_trials: Literal["stop", "leave_out"]
    limits: Limits


def main(config: Config) -> None:
    folder = RAW / config.session
    session = read_session(folder)
    takes, findings, refused = [], [], {}
    with progress(len(session.trials), "ingest", "trials") as bar:
        for trial, take, found in take_in(folder, session, config.limits):
            if isinstance(take, InputError):
                if config.refused_trials == "stop":
                    raise take
                refused[trial.name] = str(take)
            else:
                takes.append(take)
                findings.append(found)
            bar.update(1, trial=trial.name)
    if not takes:
        raise InputError(f"{folder}: all {len(refused)} trials refused, the first: {next(iter(refused.values()))}")
    settle_vertical(takes, findings, session)
    offset, spread = align_clocks(takes, [found.offset for found in findings])
    qualities = [judge(take, found) for take, found in zip(takes, findings, strict=True)]
    for take, found in zip(takes, findings, strict=True):
        take.repairs = len(found.repairs)
    with output_folder(PROCESSED) as processed, output_folder(ARTIFACTS) as artifacts:
        write_takes(processed, takes)
        write_json(artifacts / "quality.json", report(qualities, refused, offset, spread))
        write_json(artifacts / "metrics.json", summary(qualities, refused, offset, spread))
        save_figure(quality_figure(qualities, refused, offset, spread), artifacts / "quality.png")


if __name__ == "__main__":
    run_stage("ingest", Config, main)
