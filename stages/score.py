"""Score the identified models on the trials of the split `test`: the only stage that reads them."""

from pathlib import Path
from typing import Annotated, Literal

import pandas as pd
from pydantic import Field

from trunkline.compute.progress import progress
from trunkline.identification.evaluation.error_tables import marker_table, trial_table
from trunkline.identification.results.scoring import Compared, score
from trunkline.identification.stages import MODEL, TABLE, model_name, read_table
from trunkline.model_files import read_spec
from trunkline.pipeline.stage import output_folder, run_stage, write_metrics
from trunkline.recordings.trials.splits import IDENTIFY, TEST
from trunkline.recordings.trials.trial import read_trials, sessions_of
from trunkline.report.figures.scoring import marker_figure, trial_figure
from trunkline.report.figures.style import save_figure
from trunkline.settings import settings

ARTIFACTS, TRIALS = Path("artifacts"), Path("data/processed/filter")
Stage = Literal["identify_stiffness", "identify_damping", "identify_control"]


@settings
class Config:
    stages: list[Stage] = Field(min_length=1)
    floor_poses: Annotated[int, Field(ge=1, le=10_000)]


def main(config: Config) -> None:
    trials = read_trials(TRIALS, (IDENTIFY, TEST))
    cad = initial = read_spec(ARTIFACTS / "build_mjcf/arm.xml").compile()
    for session in sessions_of(trials):
        if not any(trial.split == IDENTIFY for trial in trials if trial.session == session):
            print(f"score: session {session}: found no trial with split {IDENTIFY}: what it has for itself is unknown")
    metrics, of_trials, along = {}, {}, {}
    reported = read_table(ARTIFACTS / config.stages[-1] / TABLE)["compared"]["experiments"]
    with progress(len(config.stages), "score", "stages") as bar:
        for stage in config.stages:
            identified = read_spec(ARTIFACTS / stage / MODEL).compile()
            compared = Compared(**read_table(ARTIFACTS / stage / TABLE)["compared"])
            models = {"cad": cad, "initial": initial, "identified": identified}
            metrics[stage], predictions = score(models, trials, compared, config.floor_poses)
            name = model_name(stage, config.stages)
            of_trials[name], along[name] = trial_table(predictions), marker_table(predictions, trials[0].markers)
            if not metrics[stage]:
                print(f"score: {stage}: found no {' or '.join(compared.experiments)} with split {TEST}, expected one")
            initial = identified
            bar.update(1, stage=stage)
    for kind in sorted({trial.experiment for trial in trials if trial.split == TEST} - set(reported)):
        print(f"score: {kind}: not in `reported` of {config.stages[-1]}, so the shipped model is not scored on it")
    with output_folder(ARTIFACTS / "score") as folder:
        write_metrics(folder, metrics)
        for name, tables in (("trials", of_trials), ("markers", along)):
            whole = pd.concat([table.assign(stage=stage) for stage, table in tables.items()])
            whole.to_csv(folder / f"{name}.csv", index=False, float_format="%.6g")
        save_figure(trial_figure(of_trials), folder / "errors.png")
        save_figure(marker_figure(along), folder / "markers.png")


if __name__ == "__main__":
    run_stage("score", Config, main)
