"""Figures of an identification stage."""

import matplotlib.pyplot as plt
import numpy as np
import pandas as pd
from matplotlib.figure import Figure
from matplotlib.ticker import MaxNLocator

from trunkline.identification.evaluation.error_tables import LABELS
from trunkline.identification.evaluation.evaluation import Prediction
from trunkline.identification.fit.identify import Identification
from trunkline.identification.fit.problem import Bounds
from trunkline.identification.parameters.parameters import parameter_named
from trunkline.identification.results.curves import widest_motion
from trunkline.recordings.trials.experiments import is_static
from trunkline.recordings.trials.splits import VALIDATE
from trunkline.report.figures.scoring import MODELS, marker_figure
from trunkline.report.figures.style import DOUBTFUL, IDENTIFIED, LEAST_WIDTH, MEASURED

LEAST_FALL = 4.0  # highest over lowest value of an axis of losses, at least
NARROWEST = 60.0  # mm, of an axis: noise shall not look like motion
COLORS = {label: color for label, (color, *_) in MODELS.items()}


def stage_figures(
    tables: dict[str, pd.DataFrame], result: Identification, bounds: dict[str, Bounds], undetermined: list[str],
    validate: dict[str, Prediction],
) -> dict[str, Figure]:  # fmt: skip
    """By name; `tables` as `stage_tables` gives them, and `validate` as it takes it."""
    figures = {
        "convergence": convergence_figure(result),
        "parameters": parameter_figure(result, bounds, undetermined),
        "markers": marker_figure({"validate split": tables["markers"]}),
    }
    if "shapes" in tables:
        figures["shapes"] = shape_figure(tables["shapes"])
    if "errors" in tables:
        moving = validate["noise_floor"].of(lambda e: not is_static(e.kind))
        widest = widest_motion(validate)
        figures["errors"] = error_figure(tables["errors"], moving.scores()[VALIDATE])
        figures["distances"] = distance_figure(tables["distances"], widest["identified"].experiments[0].name)
        figures["paths"] = path_figure(widest)
    return figures


def convergence_figure(identification: Identification) -> Figure:
    """Best and mean loss of every phase, which each have a loss of their own: of other trials, or frames."""
    phases = identification.convergence
    figure, axes = plt.subplots(1, len(phases), figsize=(max(3.4 * len(phases), LEAST_WIDTH), 3.6), squeeze=False)
    for axis, (phase, history) in zip(axes[0], phases.items(), strict=True):
        axis.semilogy(history.best, color=IDENTIFIED, marker="o", markersize=3, label="best")
        if history.mean != history.best:
            axis.semilogy(history.mean, color=DOUBTFUL, label="mean of a generation's trials", zorder=1)
        axis.set_title(f"{phase.replace('_', ' ')}: {history.best[0]:.4g} to {history.best[-1]:.4g}")
        axis.set_xlabel("generation" if history.mean != history.best else "iteration")
        axis.xaxis.set_major_locator(MaxNLocator(integer=True))
        low, high = axis.get_ylim()
        spare = max(1.0, np.sqrt(LEAST_FALL * low / high))  # ticks of a flat curve would all be the same
        axis.set_ylim(low / spare, high * spare)
    axes[0, 0].set_ylabel("loss")
    entries = {name: line for axis in axes[0] for line, name in zip(*axis.get_legend_handles_labels(), strict=True)}
    if len(entries) > 1:
        figure.legend(list(entries.values()), list(entries), loc="outside lower center", ncols=2)
    return figure


def error_figure(curves: pd.DataFrame, floor: dict[str, float]) -> Figure:
    """Position and velocity error over time as (d) and (e) of the paper's figure, and the tip error.

    Args:
        floor: errors that noise alone leaves, as `scores` gives them for a split.
    """
    panels = {
        "position_error_mm": ("error of distances (mm)", "Shape error, by distances", floor["e_internal_mm"]),
        "velocity_error_mm_s": ("error of their rate (mm/s)", "Velocity error, by distances", None),
        "tip_error_mm": ("distance of the tip (mm)", "Tip error", floor.get("e_tip_mm")),
    }
    figure, axes = plt.subplots(1, len(panels), figsize=(4.5 * len(panels), 3.4))
    for axis, (column, (label, title, least)) in zip(axes, panels.items(), strict=True):
        for model, rows in curves.groupby("model", sort=False):
            color, line, *_ = MODELS[model]
            axis.semilogy(rows.time_s, rows[column], line, color=color, label=model)
        if least is not None:
            axis.axhline(least, color=MEASURED, linestyle=":", label=LABELS["noise_floor"])
        axis.set(xlabel="time (s)", ylabel=label, title=f"{title}, validate split")
    figure.legend(*axes[0].get_legend_handles_labels(), loc="outside lower center", ncols=5, fontsize=8)
    return figure


def distance_figure(table: pd.DataFrame, trial: str) -> Figure:
    """Measured against simulated distances of a few markers over time."""
    figure, axes = plt.subplots(1, 2, figsize=(10, 4), sharey=True)
    models = [name for name in table.source.unique() if name != "measured"]
    for axis, model in zip(axes, models, strict=True):
        for source, style in (
            ("measured", {"color": MEASURED, "linewidth": 2.2, "alpha": 0.45}),
            (model, {"color": COLORS[model], "linewidth": 1.2}),
        ):
            for number, (_, rows) in enumerate(table[table.source == source].groupby("marker", sort=False)):
                axis.plot(rows.time_s, rows.distance_mm, label=source if number == 0 else None, **style)
        axis.set(xlabel="time (s)", title=f"{trial}: {model} model", ylim=0)
        axis.legend(loc="lower right")
    axes[0].set_ylabel("distance from the base (mm)")
    return figure


def path_figure(predictions: dict[str, Prediction]) -> Figure:
    """The tip's coordinates over time: where distances are blind, this shows the swing. Of one trial."""
    figure, axes = plt.subplots(3, 1, figsize=(8, 6), sharex=True)
    first = next(iter(predictions.values()))
    (experiment,), tip = first.experiments, first.replay.tip
    time = np.arange(experiment.frames) * experiment.frame_step
    for axis, name in zip(axes, "xyz", strict=True):
        number = "xyz".index(name)
        measured = experiment.positions[:, tip, number]
        axis.plot(time, measured * 1e3, color=MEASURED, alpha=0.45, lw=2.5, label="measured")
        for model, prediction in predictions.items():
            simulated = prediction.replay.positions[0][:, tip, number]
            axis.plot(time, simulated * 1e3, color=COLORS[LABELS[model]], lw=1.2, label=LABELS[model])
        axis.set_ylabel(f"{name} (mm)")
        low, high = axis.get_ylim()
        spare = max(0.0, NARROWEST - (high - low)) / 2
        axis.set_ylim(low - spare, high + spare)
    axes[0].set_title(f"Last marker in the base frame, {experiment.name}")
    axes[-1].set_xlabel("time (s)")
    figure.legend(*axes[0].get_legend_handles_labels(), loc="outside lower center", ncols=3)
    return figure


def shape_figure(table: pd.DataFrame) -> Figure:
    """Measured and simulated shape of each trial, side view in the base frame; a number is the mount's tilt, where
    trials differ in it."""
    figure, axis = plt.subplots(figsize=(6.5, 6))
    several = table.tilt_deg.round().nunique() > 1
    for (_, source), rows in table.groupby(["trial", "source"], sort=False):
        x, z, tilt = np.append(0, rows.x_mm), np.append(0, rows.z_mm), rows.tilt_deg.iloc[0].round()
        if source == "measured":
            axis.plot(x, z, "o", color=MEASURED, markersize=4, alpha=0.6)
            if several and tilt:
                axis.annotate(f"{tilt:.0f}°", (x[-1], z[-1]), xytext=(6, 0), textcoords="offset points")
        else:
            axis.plot(x, z, color=COLORS[source], linewidth=1.6 if source == "identified" else 1.1)
    for source in table.source.unique():
        axis.plot([], [], "o" if source == "measured" else "-", color=COLORS.get(source, MEASURED), label=source)
    figure.legend(loc="outside lower center", ncols=3)
    title = "Shapes, validate split" + ("; numbers: the mount's tilt, where it is tilted" if several else "")
    axis.set(aspect="equal", xlabel="x (mm)", ylabel="z (mm)", title=title)
    return figure


def parameter_figure(identification: Identification, bounds: dict[str, Bounds], undetermined: list[str]) -> Figure:
    """Each scalar with its 95 % interval within its range, grey if that is open or a bound, and per-joint factors."""
    panels, count = 1 + bool(identification.factors), len(identification.values)
    widths = identification.half_width
    promise = "with the model's tolerances" if identification.considered else "given the model"
    figure, axes = plt.subplots(1, panels, figsize=(6.5 * panels, max(1.4 + 0.42 * count, 2.4)), squeeze=False)
    for row, (name, value) in enumerate(identification.values.items()):
        low, high, place = parameter_named(name).coordinate([bounds[name].low, bounds[name].high, value])
        place = (place - low) / (high - low)
        width = widths[row] / (high - low)
        doubt = "not determined" if name in undetermined else "on a bound" if name in identification.at_bound else ""
        axes[0, 0].errorbar(place, row, xerr=width, fmt="o", color=DOUBTFUL if doubt else IDENTIFIED, capsize=4)
        side = "left" if place < 0.2 else "right" if place > 0.8 else "center"
        axes[0, 0].annotate(
            f"{value:.4g} {parameter_named(name).unit} {doubt}".strip(),
            (place, row),
            xytext=(0, 7),
            textcoords="offset points",
            ha=side,
            fontsize=9,
        )
    axes[0, 0].set(
        xlim=(0, 1),
        ylim=(count - 0.6, -0.8),
        xlabel="place in the range searched",
        yticks=range(count),
        yticklabels=list(identification.values),
        title=f"Parameters, 95 % intervals {promise}",
    )
    for name, factors in identification.factors.items():
        axes[0, 1].bar(np.arange(1, len(factors) + 1), (factors - 1) * 100, color=IDENTIFIED)
        axes[0, 1].set(xlabel="unit, from the base", ylabel="%", title=f"Per-joint factors of {name}, minus 1")
    return figure
