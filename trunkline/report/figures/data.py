"""Pictures of the data: the quality page of a session, and what the filter did to it."""

import textwrap
from collections.abc import Sequence
from itertools import cycle

import matplotlib.pyplot as plt
import numpy as np
from matplotlib.axes import Axes
from matplotlib.colors import ListedColormap
from matplotlib.figure import Figure
from matplotlib.patches import Patch
from matplotlib.ticker import MaxNLocator

from trunkline.recordings.cleaning.clock_offset import MotorClock
from trunkline.recordings.cleaning.quality import Quality, by_sentence
from trunkline.recordings.cleaning.session_checks import CheckedSession
from trunkline.recordings.signals.base_frame import average_base, to_base_frame
from trunkline.recordings.signals.runs import stretches
from trunkline.recordings.trials.experiments import EXPERIMENTS, is_stepwise
from trunkline.recordings.trials.raw_trial import RawTrial
from trunkline.recordings.trials.trial import Trial
from trunkline.report.figures.style import IDENTIFIED, INITIAL, MEASURED, PARTLY, SEEN, UNSEEN, VALIDATE

BIN = 1 / 30  # s, of the coverage picture
LEAST_JITTER = 0.1  # ms, of the axis: less is none
SHADES = (MEASURED, IDENTIFIED, VALIDATE, INITIAL, "#cc79a7", "#009e73")  # the last two of Okabe and Ito's palette
COLORS = dict(zip(EXPERIMENTS, cycle(SHADES), strict=False))  # more kinds than shades begin anew


def quality_figure(qualities: list[Quality], gathered: CheckedSession) -> Figure:
    """The quality page: coverage over time, gaps, noise, rates, clock fit, repairs and refusals; panels with something
    to show. Of poses in steps, the time between them says nothing: they are counted."""
    numbered = dict(enumerate(qualities))
    stepwise = {number: quality for number, quality in numbered.items() if is_stepwise(quality.raw.experiment)}
    timed = {number: quality for number, quality in numbered.items() if number not in stepwise}
    fits = [fit for q in qualities for fit in (q.findings.by_motion, q.findings.by_log_times) if fit is not None]
    panels = [_gaps, _noise, _stamps] * bool(timed)
    figure = plt.figure(figsize=(14, 13))
    left, right = figure.subfigures(1, 2, squeeze=False, width_ratios=(3, 2))[0]
    _coverage(left.subplots(), qualities)
    count = len(panels) + bool(stepwise) + bool(fits)
    *axes, words = right.subplots(count + 1, 1, height_ratios=[1] * count + [max(1.4, 5.4 - count)])
    for panel in panels:
        panel(axes.pop(0), timed)
    if stepwise:
        _poses(axes.pop(0), stepwise)
    if fits:
        _clock(axes.pop(0), qualities, gathered.clock)
    _words(words, qualities, gathered.refused)
    return figure


def _gaps(axis: Axes, qualities: dict[int, Quality]) -> None:
    lengths = 1e3 * np.concatenate([quality.gaps for quality in qualities.values()])
    if len(lengths):
        axis.hist(lengths, bins=40, color=IDENTIFIED)
    scale = "log" if len(lengths) > 100 else "linear"
    axis.set(title=f"Gaps: {len(lengths)}", xlabel="length (ms)", ylabel="count", yscale=scale)


def _noise(axis: Axes, qualities: dict[int, Quality]) -> None:
    markers = next(iter(qualities.values())).raw.markers
    axis.boxplot(
        [[1e3 * quality.position_noise[i] for quality in qualities.values()] for i in range(len(markers))],
        tick_labels=[marker.removeprefix("unit_") for marker in markers],
        showfliers=False,
    )
    axis.set(title="Noise per marker", xlabel="marker", ylabel="position (mm)", ylim=(0, 1.1 * axis.get_ylim()[1]))


def _stamps(axis: Axes, qualities: dict[int, Quality]) -> None:
    """Jitter of the stamps over frame numbers; where there is none, how many frames are missing."""
    rates, dropped = zip(*[(1 / quality.interval, quality.dropped) for quality in qualities.values()], strict=True)
    frames = [quality.findings.frames for quality in qualities.values()]
    jitters = [np.nan if timing is None else 1e3 * timing.jitter for timing in frames]
    uneven = np.nanmax([0, *jitters]) > LEAST_JITTER / 100
    _bars(axis, qualities, jitters if uneven else dropped, LEAST_JITTER if uneven else 1)
    axis.set_title(f"Frame stamps: {np.median(rates):.1f} Hz, {sum(dropped)} frames dropped")
    axis.set_ylabel("jitter (ms)" if uneven else "frames dropped")


def _poses(axis: Axes, qualities: dict[int, Quality]) -> None:
    counts = [len(quality.raw.time) for quality in qualities.values()]
    _bars(axis, qualities, counts, 1)
    axis.set(title=f"At rest in steps: {sum(counts)} poses", ylabel="poses")


def _bars(axis: Axes, qualities: dict[int, Quality], values: Sequence[float], least: float) -> None:
    """A bar a trial at its number, coloured by its kind; the axis ends above `least`."""
    kinds = [quality.raw.experiment for quality in qualities.values()]
    axis.bar(list(qualities), values, color=[COLORS[kind] for kind in kinds])
    axis.set(xlim=(min(qualities) - 1, max(qualities) + 1), ylim=(0, max(1.4 * np.nanmax([0, *values]), least)))
    axis.set_xlabel("trial")
    axis.xaxis.set_major_locator(MaxNLocator(integer=True))
    axis.yaxis.set_major_locator(MaxNLocator(5, integer=least >= 1))
    axis.legend(handles=[Patch(color=COLORS[name], label=name) for name in COLORS if name in kinds], ncols=3)


def _clock(axis: Axes, qualities: list[Quality], agreed: MotorClock) -> None:
    axis.axhline(1e3 * agreed.offset, color=MEASURED, lw=1)
    for label, fill, fits in (
        ("by motion, the arm's lag in it", "none", [q.findings.by_motion for q in qualities]),
        ("by log times", VALIDATE, [q.findings.by_log_times for q in qualities]),
    ):
        if any(fit is not None for fit in fits):
            offsets = [np.nan if fit is None else 1e3 * fit.offset for fit in fits]
            axis.scatter(np.arange(len(fits)), offsets, s=18, facecolor=fill, edgecolor=VALIDATE, label=label)
    axis.legend()
    uncertain = "" if agreed.uncertainty is None else f" ± {1e3 * agreed.uncertainty:.1f}"
    offset = "no trial tells" if agreed.by is None else f"{1e3 * agreed.offset:.1f}{uncertain} ms, by {agreed.by}"
    title = f"Cameras' clock − motors' clock:\n{offset}"
    axis.set(title=title, xlabel="trial", ylabel="offset (ms)", xlim=(-1, len(qualities)))
    axis.xaxis.set_major_locator(MaxNLocator(integer=True))


def _words(axis: Axes, qualities: list[Quality], refused: dict[str, str]) -> None:
    axis.axis("off")
    lines = [f"refused {name}: {reason}" for name, reason in refused.items()]
    lines += by_sentence(qualities, lambda quality: [f"check {line}" for line in quality.warnings] + quality.repairs)
    wrapped = [part for line in lines for part in textwrap.wrap(line, 78)] or ["nothing"]
    more = [f"… and {len(wrapped) - 14} lines more in quality.json"] if len(wrapped) > 14 else []
    axis.set_title("Refused, repaired, and to be checked")
    axis.text(0, 1, "\n".join(wrapped[:14] + more), va="top", fontsize=8, transform=axis.transAxes)


def _coverage(axes: Axes, qualities: list[Quality]) -> None:
    """A band a trial, in it a row a marker: what was seen when. Of poses in steps each stands until the next."""
    bins = int(max(quality.raw.time[-1] for quality in qualities) / BIN) + 1
    bands, ticks, row = [], [], 0
    for quality in qualities:
        raw = quality.raw
        place = (raw.time / BIN).astype(int)
        frames = np.bincount(place, minlength=bins)
        pose = np.searchsorted(place, np.arange(bins), side="right") - 1
        tall = 1 + 4 // len(raw.markers)  # rows a marker
        apart = 1 + len(raw.markers) // 10  # empty rows to the next band
        band = np.full((tall * len(raw.markers) + apart, bins), np.nan)
        for index in range(len(raw.markers)):
            good = np.isfinite(raw.positions[:, index, 0])
            if is_stepwise(raw.experiment):
                share = good[pose]
            else:
                share = np.bincount(place, weights=good, minlength=bins) / np.maximum(frames, 1)
            level = np.where(share == 0, 0, np.where(share < 1, 1, 2)).astype(float)
            level[place[-1] + 1 :] = np.nan
            band[tall * index : tall * (index + 1)] = level
        bands.append(band)
        ticks.append(row + tall * len(raw.markers) / 2)
        row += len(band)
    extent = (0, bins * BIN, row, 0)
    colors = ListedColormap([UNSEEN, PARTLY, SEEN])
    axes.imshow(
        np.vstack(bands),
        aspect="auto",
        extent=extent,
        cmap=colors,
        vmin=0,
        vmax=2,
        interpolation="nearest",
    )
    axes.set_yticks(ticks, [quality.raw.name for quality in qualities], fontsize=7)
    axes.set(xlabel="time (s)")
    axes.set_title("Coverage: each trial's markers, base on top; red where unseen, yellow where in part")
    axes.grid(False)


def filter_figure(raw: RawTrial, trial: Trial) -> Figure:
    """One moving trial before and after the filter, at the marker that moves most."""
    base = average_base(raw.base_positions, raw.base_quaternions)
    moved, _ = to_base_frame(base, raw.positions, None)
    figure, axes = plt.subplots(2, 1, figsize=(9, 6), sharex=True)
    last = int(np.argmax(np.ptp(trial.positions, axis=0).sum(axis=1)))
    for axis, color in zip(range(3), (MEASURED, IDENTIFIED, VALIDATE), strict=True):
        axes[0].plot(raw.time, 1e3 * moved[:, last, axis], ".", ms=2, color=color, alpha=0.5)
        axes[0].plot(trial.time, 1e3 * trial.positions[:, last, axis], color=color, label="xyz"[axis])
        rest = moved[:, last, axis] - np.interp(raw.time, trial.time, trial.positions[:, last, axis])
        axes[1].plot(raw.time, 1e3 * rest, ".", ms=2, color=color)
    for panel in axes:
        panel.axvline(trial.start, color=INITIAL, lw=1)
        for begin, end in stretches(~trial.measured[:, last]):
            panel.axvspan(trial.time[begin], trial.time[end], color=INITIAL, alpha=0.15, lw=0)
    title = f"{trial.name}, marker {trial.markers[last]}: measured and filtered"
    axes[0].set(title=title, ylabel="position (mm)")
    figure.legend(*axes[0].get_legend_handles_labels(), loc="outside lower center", ncols=3)
    axes[1].set(xlabel="time (s), line: detected start, shaded: not measured", ylabel="removed (mm)", ylim=(-2, 2))
    return figure
