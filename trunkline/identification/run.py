"""The edge of the three identification stages: read model and trials, identify, write model, numbers, figures."""

from pathlib import Path

import mujoco
import numpy as np

from trunkline.arm.parameters import PARAMETERS, save_model
from trunkline.errors import InputError
from trunkline.identification import plots
from trunkline.identification.certainty import weakest_in_words
from trunkline.identification.evaluation import arm_length, replay, scores
from trunkline.identification.experiment import Experiment, prepare
from trunkline.identification.identify import Coarse, Fine, Identification, identify
from trunkline.identification.loss import LossWeights
from trunkline.identification.problem import Bounds
from trunkline.identification.settings import IdentificationSettings
from trunkline.plots import save_figure
from trunkline.recording.trial import read_trials
from trunkline.stage import output_folder, write_json

TRIALS = Path("data/processed/filter")
CAD_MODEL = Path("artifacts/build_mjcf/arm.xml")


def run(stage: str, config: IdentificationSettings, model_path: Path, report_cad: bool = False) -> None:
    """Identify and write `artifacts/<stage>/`.

    Args:
        model_path: MJCF that the stage begins with.
        report_cad: also score the untouched initial model on the same trials.
    """
    spec = read_spec(model_path)
    model = spec.compile()
    experiments, segments = read_experiments(config, model)
    fitted = [e for e in experiments if e.kind in config.experiments]
    weights = LossWeights(**{k: v for k, v in vars(config.loss).items() if k != "kind"})
    bounds = {name: Bounds(r.low, r.high) for name, r in config.parameters.items()}
    result = identify(
        stage, model, fitted, segments, bounds, tuple(config.per_joint), config.loss.kind, weights,
        Coarse(**vars(config.coarse)), Fine(**vars(config.fine)), config.seed,
    )  # fmt: skip
    identified = save_model(spec, result.models["identified"])
    # score what is written, not what was in memory: MJCF keeps six digits
    models = result.models | {"identified": mujoco.MjModel.from_xml_string(identified)}
    if report_cad:
        models["cad"] = read_spec(CAD_MODEL).compile()
    replays = {name: replay(m, experiments, segments) for name, m in models.items()}
    length = arm_length(model)
    metrics = {
        name: scores(replayed, experiments, config.loss.kind, weights, length) for name, replayed in replays.items()
    }
    metrics |= {
        "evaluations": result.evaluations,
        "diverged": result.diverged,
        "at_bound": len(result.at_bound),
        "converged": result.converged,
        "start_fit": _start_fit(experiments),
    }
    if result.factors:
        metrics["per_joint_gain"] = _gain(metrics)
    for name in result.at_bound:
        print(f"{stage}: {name} ended on a bound of its range")
    artifacts = Path("artifacts") / stage
    with output_folder(artifacts) as folder:
        (folder / "arm.xml").write_text(identified)
        write_json(folder / "parameters.json", parameter_table(result, bounds))
        write_json(folder / "metrics.json", metrics)
        write_plots(folder, result, bounds, experiments, segments, replays)


def _start_fit(experiments: list[Experiment]) -> dict[str, float]:
    """How far the poses from which simulations start are from the measured ones."""
    residuals = [e.fit.residuals[np.isfinite(e.fit.residuals)] * 1e3 for e in experiments]
    return {
        "mean_mm": float(np.mean([r.mean() for r in residuals])),
        "max_mm": float(np.max([r.max() for r in residuals])),
        "unconverged": sum(not e.fit.converged for e in experiments),
    }


def read_spec(path: Path) -> mujoco.MjSpec:
    """The MJCF at `path`.

    Raises:
        InputError: if there is none, or MuJoCo refuses it.
    """
    if not path.is_file():
        raise InputError(f"{path}: no such file, expected the model of an earlier stage")
    try:
        return mujoco.MjSpec.from_file(str(path))
    except ValueError as error:
        raise InputError(f"{path}: not a model that MuJoCo reads: {str(error).splitlines()[0]}") from error


def read_experiments(
    config: IdentificationSettings, model: mujoco.MjModel
) -> tuple[list[Experiment], tuple[str, ...]]:
    """The session's trials of the reported kinds, set up for `model`, and the segments they track."""
    trials = [t for t in read_trials(TRIALS) if t.experiment in config.reported]
    for kind in config.experiments:
        for split in ("identify", "validate"):
            if not any(t.experiment == kind and t.split == split for t in trials):
                raise InputError(f"session.yaml: found no {kind} trial with split {split}, expected at least one")
    segments = trials[0].segments
    for trial in trials:
        if trial.segments != segments:
            raise InputError(
                f"trial {trial.name}: found {len(trial.segments)} segments, expected the {len(segments)} of "
                f"{trials[0].name}"
            )
    return [prepare(trial, model, config.frames) for trial in trials], segments


def _gain(metrics: dict) -> dict[str, float]:
    """Share of E_internal that per-joint tuning removes from the coarse result, per split."""
    return {
        split: 1 - metrics["identified"][split]["e_internal_mm"] / metrics["coarse"][split]["e_internal_mm"]
        for split in metrics["coarse"]
    }


def parameter_table(result: Identification, bounds: dict[str, Bounds]) -> dict:
    """parameters.json: values, 95 % intervals, correlations, factors, and what the data leave open.

    A value is the scalar of the scaling law; the model's joint i has that times α^{3(i-1)} times its factor.
    Intervals are given what earlier stages found, and those of factors given the scalars.
    """
    names, certainty = list(result.values), result.certainty
    initial = result.models["initial"]
    scalars = {
        name: {
            "value": value,
            "unit": PARAMETERS[name].unit,
            "initial": PARAMETERS[name].read(initial),
            "interval_95": [value * float(np.exp(sign * certainty.half_width[i])) for sign in (-1, 1)],
            "range": [bounds[name].low, bounds[name].high],
            "at_bound": name in result.at_bound,
            "undetermined": bool(certainty.half_width[i] > 0.5 * np.log(bounds[name].high / bounds[name].low)),
        }
        for i, (name, value) in enumerate(result.values.items())
    }
    return {
        "parameters": scalars,
        "correlation": {a: dict(zip(names, certainty.correlation[i], strict=True)) for i, a in enumerate(names)},
        "condition": certainty.condition,
        "weakest_direction": weakest_in_words(names, certainty.weakest),
        "per_joint": _factor_table(result),
        "at_bound": result.at_bound,
    }


def _factor_table(result: Identification) -> dict:
    """Factors on top of the scaling law, unit by unit, with the half width of their 95 % intervals."""
    if not result.factors:
        return {}
    widths = result.factor_certainty.half_width.reshape(len(result.factors), -1)
    return {
        name: {"factor": factors, "half_width_95": width}
        for (name, factors), width in zip(result.factors.items(), widths, strict=True)
    }


def write_plots(folder: Path, result: Identification, bounds, experiments, segments, replays) -> None:
    """PNGs for people and CSV for `dvc plots`."""
    first = {"CAD": replays["cad"]} if "cad" in replays else {"initial": replays["initial"]}
    shown = first | {"identified": replays["identified"]}
    plots.convergence_table(result).to_csv(folder / "convergence.csv", index=False, float_format="%.6g")
    save_figure(plots.convergence_figure(result), folder / "convergence.png")
    units = {name: PARAMETERS[name].unit for name in result.values}
    save_figure(plots.parameter_figure(result, bounds, units), folder / "parameters.png")
    static = [i for i, e in enumerate(experiments) if e.frames == 1 and e.split == "validate"]
    moving = [i for i, e in enumerate(experiments) if e.frames > 1 and e.split == "validate"]
    if static:
        chosen = [experiments[i] for i in static]
        table = plots.shape_table(chosen, _select(shown, static), segments)
        table.to_csv(folder / "shapes.csv", index=False, float_format="%.6g")
        save_figure(plots.shape_figure(table), folder / "shapes.png")
    if moving:
        curves = plots.error_curves([experiments[i] for i in moving], _select(shown, moving))
        curves.to_csv(folder / "errors.csv", index=False, float_format="%.6g")
        save_figure(plots.error_figure(curves), folder / "errors.png")
        kinds = [i for i in moving if experiments[i].kind == experiments[moving[-1]].kind]
        widest = max(kinds, key=lambda i: float(np.ptp(experiments[i].positions, axis=0).max()))
        table = plots.distance_table(experiments[widest], widest, shown, segments)
        table.to_csv(folder / "distances.csv", index=False, float_format="%.6g")
        save_figure(plots.distance_figure(table, experiments[widest].name), folder / "distances.png")
        save_figure(plots.path_figure(experiments[widest], widest, shown), folder / "paths.png")


def _select(replays: dict, indices: list[int]) -> dict:
    return {name: type(r)([r.positions[i] for i in indices]) for name, r in replays.items()}
