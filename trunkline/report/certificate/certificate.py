"""A certificate from what the pipeline found: errors, parameters, the uncertainty of the tip, and replays."""

import hashlib
from dataclasses import dataclass
from importlib.metadata import version
from pathlib import Path
from typing import Annotated

import mujoco
import numpy as np
from pydantic import Field

from trunkline.errors import InputError
from trunkline.identification.evaluation.evaluation import Prediction, replay
from trunkline.identification.results.scoring import fingerprint
from trunkline.identification.simulate.checks import check_trials
from trunkline.identification.simulate.experiment import prepare
from trunkline.recordings.trials.conditions import conditions_of
from trunkline.recordings.trials.inventory import missing_lines, recorded_of_each
from trunkline.recordings.trials.splits import DECIDING, VALIDATE
from trunkline.recordings.trials.trial import Trial, sessions_of
from trunkline.report.certificate.arms import arm_of
from trunkline.report.certificate.budget import Budget, Inputs, budget, held_out, left_by_map, sure_pulls
from trunkline.report.certificate.coverage import Bring, covered
from trunkline.report.certificate.facts import error_rows, parameter_facts, uncertainty_facts
from trunkline.report.certificate.held_out import at_rest, learnt_from, tip_residuals
from trunkline.report.certificate.poses import draw_poses, posed
from trunkline.report.certificate.replays import packed
from trunkline.report.certificate.words import Use, limits_of, next_step, verdict
from trunkline.settings import Seed
from trunkline.twin.discrepancy import SURE, Lacking
from trunkline.twin.twin import Twin
from trunkline.version import __version__

LIBRARIES = ("mujoco", "numpy", "scipy")
COMMAND = "dvc repro report"
FEWEST = 3  # held-out trials at rest, below which nothing is told of what the model lacks


@dataclass
class CertificateSettings:
    """See conf/report/config.yaml."""

    arm: str
    session: str
    seed: Seed
    poses: Annotated[int, Field(ge=1, le=10_000)]
    arms: Annotated[int, Field(ge=2, le=10_000)]
    each: Annotated[int, Field(ge=1, le=1000)]
    covered: Annotated[int, Field(ge=8, le=10_000)]
    frames: Annotated[int, Field(ge=2, le=10_000)]
    factor: Annotated[float, Field(ge=1, le=100)]
    uses: Annotated[list[Use], Field(min_length=1)]


@dataclass
class Certificate:
    """facts: as facts.json has them. metrics: a few of them. replays: as `packed` has them. shapes: name, measured and
    simulated points of held-out trials, for a picture. lacking: of the twin's model, None where too few trials tell it.
    """

    facts: dict
    metrics: dict
    replays: dict
    shapes: list[tuple[str, np.ndarray, np.ndarray]]
    budget: Budget
    lacking: Lacking | None


def certify(
    config: CertificateSettings, twin: Twin, trials: list[Trial], metrics: dict[str, dict], bring: Bring | None = None
) -> Certificate:  # fmt: skip
    """Of the `twin` that the stages identified.

    Args:
        trials: that may decide.
        metrics: of the stages that identified, and of `score`, `ingest` and `filter`.
        bring: the arm that the model is of, to see how often its tip is where the certificate says; None for none.

    Raises:
        InputError: the trials are of another arm, or of another session than the model was fitted to.
    """
    model, tables = twin.arm.model, twin.provenance.tables
    check_trials(trials, model)
    check_fitted(tables, trials)
    rng = np.random.default_rng(config.seed)
    conditions, length = conditions_of(trials), arm_of(model).chain.length
    inputs = inputs_of(twin, trials, metrics["ingest"], config.arms, rng)
    poses = draw_poses(arm_of(model).chain, conditions, config.poses, rng)
    tip_budget = budget(inputs, poses, config.arms, config.each, rng)
    uncertainty = uncertainty_facts(tip_budget, conditions, length, config.arms * config.each)
    uncertainty["held_out_trials"] = inputs.lacking.trials if inputs.lacking else 0
    if inputs.lacking:
        constant, *shares = inputs.lacking.rms
        uncertainty["lacking_constant_mm"] = 1e3 * constant
        uncertainty["lacking_pct"] = {"of_what_gravity_moves": 100 * shares[0], "of_what_cables_move": 100 * shares[1]}
    if inputs.residual_map is not None:
        uncertainty["residual_map"] = inputs.residual_map.errors_mm()
    if len(sessions := sessions_of(trials)) > 1:
        uncertainty["mounted_as_in"] = sessions[0]
    uncertainty["measured"] = None
    if bring:
        drawn = draw_poses(arm_of(model).chain, conditions, config.covered, rng)
        stated = budget(inputs, drawn, config.arms, config.each, rng)
        coverage = covered(arm_of(model).chain, drawn, stated, bring, rng)
        uncertainty["measured"] = coverage.metrics() if len(coverage.inside) else None
    rows = error_rows({stage: metrics[stage] for stage in tables}, metrics["score"])
    limits = limits_of(conditions, [trial.load for trial in trials])
    headline = headline_of(list(tables), metrics)
    radius = uncertainty["radius_mm"]["median"]
    following = next_step(uncertainty["lines"], twin.posterior.names)
    prediction = replayed(model, trials, tables, config.frames)
    facts = {
        "arm": {"name": config.arm, "length_m": length, "markers": len(trials[0].markers), "tendons": model.nu},
        "session": {
            "name": config.session,
            "recorded": recorded_of_each(trials, DECIDING),
            "missing": missing_lines(trials),
        },
        "verdict": verdict(*headline, config.uses, config.factor, radius, limits, following),
        "errors": rows,
        "parameters": parameter_facts(tables),
        "uncertainty": uncertainty,
        "data": data_facts(metrics["ingest"], metrics["filter"]),
        "versions": {"trunkline": __version__} | {name: version(name) for name in LIBRARIES},
        "trials": digest_of_trials(trials),
        "command": COMMAND,
    }
    numbers = {"radius_mm": uncertainty["radius_mm"], "combined_mm": uncertainty["combined_mm"],
               "held_out_trials": uncertainty["held_out_trials"], "without_rest": uncertainty["without_rest"],
               "open": sum(len(stage["open"]) for stage in facts["parameters"].values())}  # fmt: skip
    if "residual_map" in uncertainty:
        numbers["residual_map"] = uncertainty["residual_map"]
    if uncertainty["measured"]:
        numbers["coverage"] = uncertainty["measured"]
    replays = packed(prediction, model, trials[0].markers)
    lacking = None
    if inputs.lacking:
        pulls = np.maximum(arm_of(model).chain.straight_lengths - poses.commands, 0).sum(axis=1)
        sure = sure_pulls(pulls, tip_budget.radius, SURE * length)
        uncertainty["sure_pulls_mm"] = 1e3 * sure
        lacking = Lacking(
            twin.provenance.digest, inputs.lacking, **vars(conditions), sure_pulls=sure,
            residual_map=inputs.residual_map, left=inputs.left,
        )
    return Certificate(facts, numbers, replays, held_out_shapes(prediction), tip_budget, lacking)


def inputs_of(twin: Twin, trials: list[Trial], ingested: dict, arms: int, rng: np.random.Generator) -> Inputs:
    """Of the budget. ingested: metrics of the stage `ingest`."""
    model, parameters, noise = twin.arm.model, twin.posterior, ingested["position_noise_mm"] / 1e3
    rested = at_rest(trials)
    tip = replay(model, [], trials[0].markers).tip
    residuals = tip_residuals(model, rested, tip)
    usable = np.isfinite(residuals).all(axis=1)
    if usable.sum() < FEWEST:
        return Inputs(model, parameters, None, noise)
    poses, residuals = posed(rested, model)[usable], residuals[usable]
    learnt, missed = learnt_from(model, poses, residuals)
    lacking = held_out(model, parameters, noise, poses, np.linalg.norm(residuals, axis=1), arms, rng)
    if learnt is None:
        return Inputs(model, parameters, lacking, noise)
    left = left_by_map(arm_of(model), noise, poses, np.linalg.norm(missed, axis=1))
    return Inputs(model, parameters, lacking, noise, learnt, left)


def check_fitted(tables: dict[str, dict], trials: list[Trial]) -> None:
    """Refuse a model that was fitted to trials of another session."""
    digest_of = {trial.name: fingerprint(trial) for trial in trials}
    for stage, table in tables.items():
        for name, digest in table["fitted_to"].items():
            if digest_of.get(name) != digest:
                here = digest_of.get(name)
                actual = f"no trial {name}" if here is None else f"trial {name} with digest {here}"
                raise InputError(
                    f"artifacts/{stage}/parameters.json: fitted to trial {name} with digest {digest}, found {actual} "
                    "in data/processed/filter, expected the session that the model was fitted to: run `dvc repro`"
                )


def headline_of(stages: list[str], metrics: dict[str, dict]) -> tuple[str, dict, dict]:
    """Which trials the verdict is of, in words, and of them the errors of the twin and of the mean shape at rest: those
    of the last stage that was scored, or else of the last one's trials for choices."""
    for stage in reversed(stages):
        for split, errors in metrics["score"].get(stage, {}).get("identified", {}).items():
            return f"On trials that decided nothing ({split})", errors, metrics["score"][stage]["null"][split]
    last = metrics[stages[-1]]
    return f"On trials that no fit has seen ({VALIDATE})", last["identified"][VALIDATE], last["null"][VALIDATE]


def replayed(model: mujoco.MjModel, trials: list[Trial], tables: dict[str, dict], frames: int) -> Prediction:
    """What the model says of the trials that it was compared with when it was identified."""
    compared = list(tables.values())[-1]["compared"]
    kinds = {kind for table in tables.values() for kind in table["compared"]["experiments"]}
    delay = compared["command_delay"]
    experiments = [prepare(trial, model, frames, delay) for trial in trials if trial.experiment in kinds]
    return Prediction(replay(model, experiments, trials[0].markers), experiments)


def held_out_shapes(prediction: Prediction) -> list[tuple[str, np.ndarray, np.ndarray]]:
    """Of each held-out trial the frame in which the arm is furthest from straight, the widest trials first."""
    rows = []
    order = np.argsort(np.linalg.norm(prediction.replay.straight, axis=1))
    for experiment, positions in zip(prediction.experiments, prediction.replay.positions, strict=True):
        if experiment.split == VALIDATE:
            away = np.linalg.norm(positions[:, order[-1]] - prediction.replay.straight[order[-1]], axis=-1)
            frame = int(np.nanargmax(away))
            measured = np.where(experiment.measured[frame][:, None], experiment.positions[frame], np.nan)
            whole = [np.concatenate([np.zeros((1, 3)), points[order]]) for points in (measured, positions[frame])]
            rows.append((float(away[frame]), (experiment.name, *whole)))
    return [row for _, row in sorted(rows, key=lambda row: -row[0])]


def data_facts(ingested: dict, filtered: dict) -> dict:
    """What the first two stages say of the logs."""
    keys = ("trials", "refused", "coverage", "dropped_frames", "gaps", "longest_gap_ms", "rate_hz", "position_noise_mm",
            "orientation_noise_deg", "clock_uncertainty_ms", "warnings")  # fmt: skip
    facts = {key: ingested[key] for key in keys if ingested.get(key) is not None}
    facts["repairs"] = ingested["repairs"]["total"]
    return facts | {key: filtered[key] for key in ("gap_share", "filled_share") if key in filtered}


def digest_of_trials(trials: list[Trial]) -> str:
    """Of all trials' positions to the micrometre."""
    return hashlib.sha256("".join(fingerprint(trial) for trial in trials).encode()).hexdigest()[:16]


def digest_of_code(root: Path, parts: list[str]) -> str:
    """SHA-256 of all files of `parts`, files or folders in `root`, with their paths; not of what Python keeps there."""
    total = hashlib.sha256()
    inside = {file for part in parts for file in (root / part, *(root / part).rglob("*")) if file.is_file()}
    for name in sorted(file.relative_to(root).as_posix() for file in inside if "__pycache__" not in file.parts):
        total.update(name.encode() + b"\0" + (root / name).read_bytes() + b"\0")
    return total.hexdigest()
