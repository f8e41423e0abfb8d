"""The edge of the three identification stages: read model and trials, identify, write model, numbers, figures."""

from collections.abc import Sequence
from dataclasses import dataclass
from pathlib import Path

import mujoco

from trunkline.errors import InputError
from trunkline.identification.diagnostics.cross_validation import cross_validate
from trunkline.identification.diagnostics.trial_diagnostics import trial_diagnostics
from trunkline.identification.evaluation.baselines import references
from trunkline.identification.evaluation.error_tables import TABLED, trial_table
from trunkline.identification.evaluation.evaluation import Prediction, halved_step, replay
from trunkline.identification.evaluation.repeatability import repeatability
from trunkline.identification.fit.considered import Earlier
from trunkline.identification.fit.fit import Fit
from trunkline.identification.fit.identify import Identification, identify, with_parameters
from trunkline.identification.fit.problem import Bounds
from trunkline.identification.fit.settings import IdentificationSettings
from trunkline.identification.fit.setup import check_parameters, set_up, with_every, with_sessions
from trunkline.identification.parameters.parameters import MASS
from trunkline.identification.parameters.per_session import make_room, names_in
from trunkline.identification.parameters.saving import save_model
from trunkline.identification.results.parameter_table import parameter_table, undetermined
from trunkline.identification.results.scoring import Compared, fingerprints, predict, start_fit
from trunkline.identification.simulate.checks import check_trials
from trunkline.identification.simulate.experiment import Experiment
from trunkline.identification.stages import MODEL, SCALARS, STAGES, TABLE, contradicted, read_table, read_tables
from trunkline.model.arm_model import BACKLASH, CAPSTAN_FRICTION, RATE_LIMIT, ArmModel
from trunkline.model_files import read_spec
from trunkline.pipeline.stage import output_folder, write_json, write_metrics
from trunkline.recordings.trials.experiments import EXPERIMENTS, is_static
from trunkline.recordings.trials.splits import DECIDING, IDENTIFY, VALIDATE
from trunkline.recordings.trials.trial import Trial, read_trials

ARTIFACTS = Path("artifacts")
CAD_MODEL = ARTIFACTS / "build_mjcf/arm.xml"
TRIALS = Path("data/processed/filter")
CSV = {"index": False, "float_format": "%.6g"}
WARN_PCT, REFUSE_PCT = 5.0, 25.0  # of the arm's length by which bodies may be off after a fit


@dataclass
class FitInputs:
    """What a stage identifies from.

    spec, model: MJCF that the stage begins with, with room for per-session parameters. from_cad: whether it is the CAD
        model.
    trials, experiments: those that are reported, the same ones in the same order.
    """

    spec: mujoco.MjSpec
    model: mujoco.MjModel
    from_cad: bool
    config: IdentificationSettings
    trials: list[Trial]
    experiments: list[Experiment]
    fit: Fit

    @property
    def fitted(self) -> list[Experiment]:
        """Experiments of the kinds that the parameters are fitted to."""
        return [e for e in self.experiments if e.kind in self.config.experiments]


def run(stage: str, config: IdentificationSettings, model_path: Path, whole: tuple[str, ...] = ()) -> None:
    """Identify and write `artifacts/<stage>/`.

    Args:
        model_path: MJCF that the stage begins with.
        whole: earlier stages whose scalars, with this stage's, make the whole arm: the CAD model with all scalars and
            no joint's own factor is then scored on the same trials too.
    """
    inputs = load(stage, config, model_path)
    result, mjcf = fit(stage, inputs)
    predictions, metrics = compare(stage, inputs, result, mjcf, whole)
    save(stage, inputs, result, mjcf, predictions, metrics)


def load(stage: str, config: IdentificationSettings, model_path: Path) -> FitInputs:
    """Read the model and the trials, and check the settings against both.

    Raises:
        InputError: if parameters, trials or folds do not fit together.
    """
    print(f"{stage}: reading the model and the trials", flush=True)
    spec = read_spec(model_path)
    model = spec.compile()
    config = with_every(config, model)
    check_parameters(stage, config, model)  # first: an arm without a part lacks the trials of it too
    reported, every = read_reported(config), read_trials(TRIALS, DECIDING)
    model = with_sessions(stage, config, spec, every)
    # of an arm with tendons also the trials of later stages: a wrong name is an error now, not after minutes
    check_trials(every if model.nu else reported, model)
    model, experiments, settings = set_up(config, reported, model)
    if model_path != CAD_MODEL and not config.considered.none:
        before = read_tables(ARTIFACTS, STAGES[: STAGES.index(stage)])
        settings.earlier = [Earlier.from_table(name, table) for name, table in before.items()]
    inputs = FitInputs(spec, model, model_path == CAD_MODEL, config, reported, experiments, settings)
    folds, most = config.cross_validation_folds, sum(e.split == IDENTIFY for e in inputs.fitted)
    if folds > most:
        raise InputError(f"{stage}.cross_validation_folds: found {folds}, expected at most {most}, one a trial")
    return inputs


def fit(stage: str, inputs: FitInputs) -> tuple[Identification, str]:
    """Identify the parameters; returns the result and the MJCF of the identified model."""
    kinds = inputs.config.experiments
    if inputs.from_cad and MASS not in inputs.config.parameters and not any(map(is_static, kinds)):
        sources = " and ".join(EXPERIMENTS[kind].plural for kind in kinds)
        print(f"{stage}: without trials at rest, stiffness comes from {sources}, as a ratio to the masses")
    result = identify(stage, inputs.model, inputs.fitted, inputs.fit)
    return result, save_model(inputs.spec, result.models["identified"])


def compare(
    stage: str, inputs: FitInputs, result: Identification, mjcf: str, whole: tuple[str, ...]
) -> tuple[dict[str, Prediction], dict]:
    """Predictions of all models and baselines, and the metrics; prints what a user should know of the result.

    Raises:
        InputError: the identified model is nowhere near what it was fitted to.
    """
    config, experiments, settings = inputs.config, inputs.experiments, inputs.fit
    models = compared_models(inputs, result, mjcf, whole)
    predictions = predict(models, inputs.trials, experiments, inputs.model)
    metrics: dict = {"diverged_trials": {name: prediction.replay.diverged for name, prediction in predictions.items()}}
    like = predictions["identified"].replay
    predictions |= references(inputs.trials, predictions["identified"].experiments, models["identified"], like)
    metrics |= {name: prediction.scores(settings.loss, settings.weights) for name, prediction in predictions.items()}
    metrics |= {
        "noise_floor_mm": metrics["noise_floor"][VALIDATE]["e_position_mm"],
        "repeatability_mm": repeatability(inputs.trials, like.tip),
        "evaluations": result.evaluations,
        "diverged": result.diverged,
        "at_bound": len(result.at_bound),
        "undetermined": len(undetermined(result, settings.parameters)),
        "converged": result.converged,
        "starts_agreeing": {"agreeing": result.agreeing, "of": result.starts},
        "deciding_trials": len(result.influence.deciding()),
        "start_fit": start_fit(experiments),
    }
    if doubt := misfit(metrics["identified"][IDENTIFY]["by_experiment"], config.experiments):
        print(f"{stage}: warning: {doubt}")
    full = predictions["identified"].of(lambda e: not is_static(e.kind))  # a shape at rest has no time step
    if full.experiments:
        halved = replay(models["identified"], full.experiments, settings.markers, step_factor=0.5)
        metrics["halved_step"] = halved_step(full, Prediction(halved, full.experiments))
    if result.factors or whole:
        metrics["per_joint_gain"] = _gain(metrics)
    if config.cross_validation_folds:
        folds = config.cross_validation_folds
        metrics["cross_validation"] = cross_validate(stage, result, inputs.fitted, settings, folds)
    diagnostics = {
        trial.name: trial_diagnostics(trial, experiment, inputs.fitted, models["identified"], settings)
        for trial, experiment in zip(inputs.trials, experiments, strict=True)
        if trial.name in result.influence.deciding()
    }
    for doubt in doubts(result, settings.parameters, diagnostics):
        print(f"{stage}: {doubt}")
    if not inputs.from_cad:
        before = read_tables(ARTIFACTS, STAGES[: STAGES.index(stage)])
        for line in contradicted(before, parameter_table(result, settings.parameters)):
            print(f"{stage}: warning: {line}")
    return predictions, metrics


def misfit(by_experiment: dict[str, dict], kinds: Sequence[str]) -> str:
    """That the identified model is far from what it was fitted to, by kind of experiment, in words; empty where not.

    Raises:
        InputError: it is so far that the fit tells nothing.
    """
    worst = max((kind for kind in kinds if kind in by_experiment), key=lambda k: by_experiment[k]["e_position_pct"])
    off, share = (by_experiment[worst][f"e_position_{unit}"] for unit in ("mm", "pct"))
    problem = f"after the fit, bodies are {off:.3g} mm off in the mean of {EXPERIMENTS[worst].plural}, "
    problem += f"{share:.2g} % of the arm's length"
    if share > REFUSE_PCT:
        causes = "unit, `frame.up`, base and names in session.yaml, the arm under build_mjcf, ranges of parameters"
        raise InputError(f"{problem}, expected at most {REFUSE_PCT:g} %: nothing is identified; look at {causes}")
    return f"{problem}: values below are of an arm that does not fit" if share > WARN_PCT else ""


def compared_models(
    inputs: FitInputs, result: Identification, mjcf: str, whole: tuple[str, ...]
) -> dict[str, mujoco.MjModel]:
    """The models that metrics.json compares, by their names there."""
    # score what is written, not what was in memory: MJCF keeps six digits
    models = result.models | {"identified": mujoco.MjModel.from_xml_string(mjcf)}
    models["cad"] = read_spec(CAD_MODEL).compile()
    if inputs.from_cad and inputs.config.markers == "unchanged":
        models["initial"] = models["cad"]
    earlier = [read_table(ARTIFACTS / stage / TABLE) for stage in whole]
    if not result.factors and not any(table.get("per_joint") for table in earlier):
        models["coarse"] = models["identified"]
    elif whole:
        extended = read_spec(CAD_MODEL)
        make_room(extended, names_in(inputs.model))
        rows = {name: row for table in earlier for key in SCALARS for name, row in table.get(key, {}).items()}
        values = {name: row["value"] for name, row in rows.items()}
        models["coarse"] = with_parameters(extended.compile(), values | result.values)
        # rest shape and markers are no matter of scalars
        for field in ("qpos_spring", "tendon_lengthspring", "site_pos", "site_sameframe"):
            getattr(models["coarse"], field)[:] = getattr(inputs.model, field)
    # as in MuJoCo alone and in Unity: tendons without friction in their guide holes, winches without rate limit or play
    for name, numbers in {"smooth": (CAPSTAN_FRICTION,), "prompt": (RATE_LIMIT, BACKLASH)}.items():
        arm = ArmModel(mujoco.MjModel.from_xml_string(mjcf))
        if arm.switch_off(*numbers):
            models[name] = arm.model
    return models


def save(
    stage: str, inputs: FitInputs, result: Identification, mjcf: str, predictions: dict[str, Prediction], metrics: dict
) -> None:
    """Write model, parameters, metrics, tables and figures to `artifacts/<stage>/`."""
    config, bounds, markers = inputs.config, inputs.fit.parameters, inputs.fit.markers
    rests = any(EXPERIMENTS[kind].static or EXPERIMENTS[kind].hangs for kind in config.reported)
    with output_folder(ARTIFACTS / stage) as folder:
        (folder / MODEL).write_text(mjcf)
        table = parameter_table(result, bounds) | {"compared": vars(Compared.of(config))}
        table["fitted_to"] = fingerprints([t for t in inputs.trials if t.experiment in config.experiments])
        write_json(folder / TABLE, table)
        write_metrics(folder, metrics)
        write_tables(folder, result, bounds, markers, predictions, shapes=inputs.from_cad and rests)


def doubts(
    result: Identification, bounds: dict[str, Bounds], diagnostics: dict[str, list[str]] | None = None
) -> list[str]:
    """What a user should know before trusting the result, a line each.

    Args:
        diagnostics: likely faults of trials with too much influence, by trial.
    """
    lone = f"{result.agreeing} of {result.starts} distinct starts ended at the least loss that the coarse search found"
    unfinished = [search.replace("_", " ") for search, converged in result.converged.items() if not converged]
    return (
        [f"the {search} search ended before it had converged" for search in unfinished]
        + [lone] * (result.starts > 0 and result.agreeing < 2)
        + [
            f"{trial} {'; '.join([*sentences, *(diagnostics or {}).get(trial, [])])}"
            for trial, sentences in result.influence.deciding().items()
        ]
        + [f"{name} ended on a bound of its range" for name in result.at_bound]
        + [f"{name} is not determined: its 95 % interval spans its range" for name in undetermined(result, bounds)]
        + result.unconsidered
    )


def _gain(metrics: dict) -> dict[str, float]:
    """Share of E_internal that per-joint tuning removes from the coarse result, per split."""
    return {
        split: 1 - metrics["identified"][split]["e_internal_mm"] / metrics["coarse"][split]["e_internal_mm"]
        for split in metrics["coarse"]
    }


def write_tables(
    folder: Path, result: Identification, bounds, markers, predictions: dict[str, Prediction], shapes: bool
) -> None:
    """Errors of every trial, and along the arm those of `validate`, beside baseline, CAD and noise floor; PNGs for
    people and CSV for `dvc plots`, of one shape a trial (`shapes`), or of motions."""
    # pyplot and scipy.signal take long to import, so not before the first line
    from trunkline.identification.results.curves import stage_tables
    from trunkline.report.figures.identification import stage_figures
    from trunkline.report.figures.style import save_figure

    trial_table({name: predictions[name] for name in TABLED}).to_csv(folder / "trials.csv", **CSV)
    validate = {name: prediction.of(lambda e: e.split == VALIDATE) for name, prediction in predictions.items()}
    tables = stage_tables(result, validate, markers, shapes)
    for name, table in tables.items():
        table.to_csv(folder / f"{name}.csv", **CSV)
    for name, figure in stage_figures(tables, result, bounds, undetermined(result, bounds), validate).items():
        save_figure(figure, folder / f"{name}.png")


def read_reported(config: IdentificationSettings) -> list[Trial]:
    """The session's trials of the reported kinds, which all track the same markers; none of the split test."""
    trials = [t for t in read_trials(TRIALS, DECIDING) if t.experiment in config.reported]
    for kind in config.experiments:
        for split in DECIDING:
            if not any(t.experiment == kind and t.split == split for t in trials):
                reason, way_out = f"found no {kind} trial with split {split}", EXPERIMENTS[kind].without
                otherwise = f", or in params.yaml {way_out}: data/raw/README.md" if way_out else ""
                raise InputError(f"session.yaml: {reason}, expected at least one{otherwise}")
    markers = trials[0].markers
    for trial in trials:
        if trial.markers != markers:
            raise InputError(
                f"trial {trial.name}: found {len(trial.markers)} markers, expected the {len(markers)} of "
                f"{trials[0].name}"
            )
    return trials
