"""A certificate of a small arm that is known: `python -m tests.report.certificate.sample FILE` writes its page."""

import sys
from dataclasses import replace
from pathlib import Path

import mujoco

from tests.support.matched_plant import curl, markers_of, release, small_model, static_pull, tilt
from tests.support.twins import twin_of
from trunkline.identification.evaluation.baselines import references
from trunkline.identification.evaluation.evaluation import Prediction, replay
from trunkline.identification.results.scoring import fingerprints
from trunkline.identification.simulate.experiment import prepare
from trunkline.recordings.trials.experiments import EXPERIMENTS
from trunkline.recordings.trials.splits import DECIDING, IDENTIFY, TEST
from trunkline.recordings.trials.trial import Trial
from trunkline.report.certificate.certificate import Certificate, CertificateSettings, certify
from trunkline.report.certificate.page import page
from trunkline.report.certificate.words import Use
from trunkline.report.figures.certificate import pose_figure, uncertainty_figure
from trunkline.report.figures.style import save_figure

ASKED = CertificateSettings(
    arm="small arm <of tests>", session="sample", seed=1, poses=12, arms=6, each=20, covered=12, frames=40, factor=3.0,
    uses=[Use(1.0, "previewing reaches"), Use(3.0, "showing how it moves")],
)  # fmt: skip
INGESTED = {"trials": 9, "coverage": 0.99, "position_noise_mm": 0.3, "repairs": {"total": 0}}


def sample_trials(model: mujoco.MjModel) -> list[Trial]:
    """Of the splits that may decide."""
    trials = [tilt(model, angle) for angle in (0, 30, 60)]
    trials += [static_pull(model, pull) for pull in ([20, 0, 0], [0, 9, 9])]
    validation = [tilt(model, angle, DECIDING[1]) for angle in (20, 45)]
    validation.append(static_pull(model, [0, 15, 0], split=DECIDING[1]))
    moving = [release(model, 0.2, split, frames=40) for split in DECIDING] + [curl(model, 15, frames=40)]
    return [*trials, *validation, *moving]


def sample(model: mujoco.MjModel | None = None, trials: list[Trial] | None = None) -> Certificate:
    """Of a model whose parameters are near the truth of its trials."""
    truth = small_model(4)
    trials = sample_trials(truth) if trials is None else trials
    if model is None:
        model = truth.__copy__()
        model.jnt_stiffness[:] *= 1.05
    return certify(ASKED, twin_of(model, {"identify_stiffness": table(trials)}), trials, metrics(model, trials))


def table(trials: list[Trial]) -> dict:
    """parameters.json of a stage that told one parameter well and left one open."""

    def row(value: float, half: float, low: float, high: float, is_open: bool = False) -> dict:
        return {"value": value, "unit": "rad", "interval_95_given_model": [value - half, value + half],
                "range": [low, high], "at_bound": False, "undetermined": is_open}  # fmt: skip

    rows = {"mount_tilt_x": row(0.0, 0.004, -0.1, 0.1), "mount_tilt_y": row(0.0, 0.1, -0.1, 0.1, is_open=True)}
    return {
        "parameters": rows,
        "correlation": {a: {b: 1.0 if a == b else 0.95 for b in rows} for a in rows},
        "weakest_direction": "mount_tilt_x and mount_tilt_y trade off",
        "fitted_to": fingerprints(trials),
        "compared": {"experiments": list(EXPERIMENTS), "frames": 40, "command_delay": 0.0},
    }


def metrics(model: mujoco.MjModel, trials: list[Trial]) -> dict:
    """As the stages write them; those of the last score are of the same trials under another name."""

    def of(subset: list[Trial]) -> dict:
        experiments = [prepare(trial, model, 40) for trial in subset]
        replayed = replay(model, experiments, markers_of(model))
        predictions = {"identified": Prediction(replayed, experiments), "cad": Prediction(replayed, experiments)}
        predictions |= references(subset, experiments, model, replayed)
        return {name: prediction.scores() for name, prediction in predictions.items()}

    scored = [*trials[:1], *(replace(trial, split=TEST) for trial in trials if trial.split != IDENTIFY)]
    return {"identify_stiffness": of(trials), "score": {"identify_stiffness": {name: {TEST: row[TEST]} for name, row in
            of(scored).items()}}, "ingest": INGESTED, "filter": {"gap_share": 0.01}}  # fmt: skip


def write(file: Path) -> None:
    certificate = sample()
    facts = certificate.facts | {"files": {"artifacts/identify_control/arm.xml": "0" * 64}, "code": "0" * 64}
    uncertainty = uncertainty_figure(certificate.budget.tips, certificate.budget.radius)
    figures, pictures = {"uncertainty": uncertainty, "poses": pose_figure(certificate.shapes)}, {}
    for name, figure in figures.items():
        save_figure(figure, file.with_suffix(".png"), 60)
        pictures[name] = file.with_suffix(".png").read_bytes()
    file.with_suffix(".png").unlink()
    file.write_text(page(facts, certificate.replays, pictures), encoding="utf-8")


if __name__ == "__main__":
    write(Path(sys.argv[1]))
