"""Certify what the twin is good for: one page and the same facts as JSON."""

import json
from pathlib import Path

from trunkline.errors import existing
from trunkline.identification.stages import STAGES
from trunkline.pipeline.inputs import load_rig
from trunkline.pipeline.stage import output_folder, run_stage, write_json, write_metrics
from trunkline.recordings.trials.splits import DECIDING
from trunkline.recordings.trials.trial import read_trials
from trunkline.report.certificate.certificate import CertificateSettings, certify, digest_of_code
from trunkline.report.certificate.page import page
from trunkline.report.figures.certificate import pose_figure, uncertainty_figure
from trunkline.report.figures.style import save_figure
from trunkline.settings import read_yaml, settings
from trunkline.twin.discrepancy import FILE
from trunkline.twin.twin import Twin

ARTIFACTS, TRIALS = Path("artifacts"), Path("data/processed/filter")
CHECKOUT = Path(__file__).resolve().parent.parent


@settings
class Config(CertificateSettings):
    """See conf/report/config.yaml."""

    rig: str | None


def main(config: Config) -> None:
    bring = None if config.rig is None else load_rig("report.rig", config.rig, "bring")
    files = {stage: ARTIFACTS / stage / "metrics.json" for stage in (*STAGES, "score", "ingest", "filter")}
    metrics = {stage: json.loads(existing(file).read_text()) for stage, file in files.items()}
    twin = Twin.load(ARTIFACTS)
    twin.arm.require_lengths("report")
    certificate = certify(config, twin, read_trials(TRIALS, DECIDING), metrics, bring)
    facts = certificate.facts | {"files": twin.provenance.files, "code": digest_of_code(CHECKOUT, code())}
    with output_folder(ARTIFACTS / "report") as folder:
        budget = certificate.budget
        save_figure(uncertainty_figure(budget.tips, budget.radius), folder / "uncertainty.png", 110)
        save_figure(pose_figure(certificate.shapes), folder / "poses.png", 110)
        pictures = {name: (folder / f"{name}.png").read_bytes() for name in ("uncertainty", "poses")}
        (folder / "certificate.html").write_text(page(facts, certificate.replays, pictures), encoding="utf-8")
        write_json(folder / "facts.json", facts)
        write_json(folder / FILE.name, certificate.lacking.table() if certificate.lacking else {})
        write_metrics(folder, certificate.metrics)


def code() -> list[str]:
    """Files and folders of the checkout whose code makes the certificate: those by which DVC makes it again."""
    deps = read_yaml(CHECKOUT / "dvc.yaml").stages.report.deps
    return [dep for dep in deps if dep.startswith(("demo/", "stages/", "trunkline/"))]


if __name__ == "__main__":
    run_stage("report", Config, main)
