"""Filter every trial: gaps, outliers, noise; one clock, the base frame, and when each trial begins."""

from pathlib import Path

import numpy as np

from trunkline.compute.progress import progress
from trunkline.pipeline.stage import output_folder, run_stage, write_metrics
from trunkline.recordings.filtering.effect import summary
from trunkline.recordings.filtering.filter import Filter, filter_raw_trial
from trunkline.recordings.trials.raw_trial import read_raw_trials
from trunkline.recordings.trials.splits import SPLITS
from trunkline.recordings.trials.trial import write_trials
from trunkline.report.figures.data import filter_figure
from trunkline.report.figures.style import save_figure
from trunkline.settings import settings

INGEST, PROCESSED, ARTIFACTS = Path("data/processed/ingest"), Path("data/processed/filter"), Path("artifacts/filter")

Config = settings(Filter)


def main(config: Filter) -> None:
    raw_trials = read_raw_trials(INGEST, SPLITS)
    trials, effects = [], []
    with progress(len(raw_trials), "filter", "trials") as bar:
        for raw in raw_trials:
            trial, effect = filter_raw_trial(raw, config)
            trials.append(trial)
            effects.append(effect)
            bar.update(1, trial=raw.name)
    with output_folder(PROCESSED) as processed, output_folder(ARTIFACTS) as artifacts:
        write_trials(processed, trials)
        write_metrics(artifacts, summary(trials, effects))
        farthest = max(range(len(trials)), key=lambda i: np.ptp(trials[i].positions, axis=0).sum())
        save_figure(filter_figure(raw_trials[farthest], trials[farthest]), artifacts / "filter.png")


if __name__ == "__main__":
    run_stage("filter", Config, main)
