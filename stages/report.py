"""Certify what the twin is good for: one page and the same facts as JSON."""

import json
from pathlib import Path

from trunkline.errors import existing
from trunkline.identification.stages import STAGES
from trunkline.pipeline.inputs import load_rig, read_model
from trunkline.pipeline.stage import output_folder, run_stage, write_json, write_metrics
from trunkline.recordings.trials.splits import DECIDING
from trunkline.recordings.trials.trial import read_trials
from trunkline.report.certificate.certificate import CertificateSettings, certify, digest_of_code, digests
from trunkline.report.certificate.page import page
from trunkline.report.figures.certificate import pose_figure, uncertainty_figure
from trunkline.report.figures.style import save_figure
from trunkline.settings import read_yaml, settings

ARTIFACTS, TRIALS = Path("artifacts"), Path("data/processed/filter")
MODEL = ARTIFACTS / "identify_control/arm.xml"
CHECKOUT = Path(__file__).resolve().parent.parent


@settings
class Config(CertificateSettings):
    """See conf/report/config.yaml."""

    rig: str | None


def main(config: Config) -> None:
    def told(stage: str, name: str = "metrics") -> dict:
        return json.loads(existing(ARTIFACTS / stage / f"{name}.json").read_text())

    bring = None if config.rig is None else load_rig("report.rig", config.rig, "bring")
    tables = {stage: told(stage, "parameters") for stage in STAGES}
    metrics = {stage: told(stage) for stage in (*STAGES, "score", "ingest", "filter")}
    found = certify(config, read_model(MODEL), read_trials(TRIALS, DECIDING), tables, metrics, bring)
    facts = found.facts | {
        "files": digests([MODEL, *(ARTIFACTS / s / "parameters.json" for s in STAGES)]),
        "code": digest_of_code(CHECKOUT, code()),
    }
    with output_folder(ARTIFACTS / "report") as folder:
        save_figure(uncertainty_figure(found.budget.tips, found.budget.radius), folder / "uncertainty.png", 110)
        save_figure(pose_figure(found.shapes), folder / "poses.png", 110)
        pictures = {name: (folder / f"{name}.png").read_bytes() for name in ("uncertainty", "poses")}
        (folder / "certificate.html").write_text(page(facts, found.replays, pictures), encoding="utf-8")
        write_json(folder / "facts.json", facts)
        write_metrics(folder, found.metrics)


def code() -> list[str]:
    """Files and folders of the checkout whose code makes the certificate: those by which DVC makes it again."""
    deps = read_yaml(CHECKOUT / "dvc.yaml").stages.report.deps
    return [dep for dep in deps if dep.startswith(("demo/", "stages/", "trunkline/"))]


if __name__ == "__main__":
    run_stage("report", Config, main)
