"""Rehearse the experiments on the stand-in robot as often as the committed metrics are of; resumes where it was
stopped."""

from pathlib import Path
from typing import Annotated

from pydantic import Field

from rehearsal.experiments.registry import EXPERIMENTS
from rehearsal.experiments.result import Result, rewrite_results, summary
from rehearsal.experiments.stated import scores
from rehearsal.report import draw
from rehearsal.runs import RunSource, make, source_of, wanted
from trunkline.ar.preview.package import only_package
from trunkline.compute.threads import thread_count
from trunkline.errors import nearest
from trunkline.pipeline.stage import run_stage, write_metrics
from trunkline.settings import settings
from upkeep.limits import read_limits
from upkeep.rehearsal_table import rehearsal_table

OUT, TABLE = Path("artifacts/rehearse"), "runs.csv"


@settings
class Config:
    """runs: of each experiment. of_variants: of each variant of them."""

    runs: dict[str, Annotated[int, Field(ge=1, le=100_000)]]
    of_variants: Annotated[int, Field(ge=0, le=100_000)]

    def __post_init__(self):
        for name in self.runs:
            if name not in EXPERIMENTS:
                raise ValueError(f"runs: found {name!r}, expected experiments{nearest(name, list(EXPERIMENTS))}")


def main(config: Config) -> None:
    package = only_package()
    source = source_of(package)
    results = make(wanted(config.runs, config.of_variants), package, source, OUT / TABLE, thread_count())
    rewrite_results(OUT / TABLE, results)
    metrics = metrics_of(source, results)
    write_metrics(OUT, metrics)
    draw(results, OUT / "rehearsal.png")
    goals = read_limits(Path("tests/limits.yaml"))["rehearse"]
    print(rehearsal_table(metrics, goals, f"with package `{source.package}`", variants=True))


def metrics_of(source: RunSource, results: list[Result]) -> dict:
    """metrics.json: digests of what runs are made of, each experiment's `summary`, and in `preview` what `scores` says,
    where anything was stated."""
    stated = {"preview": preview} if (preview := scores(results)) else {}
    return {"package": source.package, "code": source.code, **summary(results), **stated}


if __name__ == "__main__":
    run_stage("rehearse", Config, main, root="rehearsal")
