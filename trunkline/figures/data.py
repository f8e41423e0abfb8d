"""Pictures of the data: the quality page of a session, and what the filter did to it."""

import textwrap
from itertools import cycle

import matplotlib.pyplot as plt
import numpy as np
from matplotlib.colors import ListedColormap
from matplotlib.figure import Figure
from matplotlib.patches import Patch

from trunkline.figures.style import IDENTIFIED, INITIAL, MEASURED, PARTLY, SEEN, UNSEEN, VALIDATE
from trunkline.signals.base_frame import average_base, to_base_frame
from trunkline.signals.runs import stretches
from trunkline.takes.gathering import Gathered
from trunkline.takes.quality import Quality, by_sentence
from trunkline.trials.experiments import EXPERIMENTS
from trunkline.trials.take import Take
from trunkline.trials.trial import Trial

BIN = 1 / 30  # s, of the coverage picture
LEAST_JITTER = 0.1  # ms, of the axis: less is none
COLORS = dict(zip(EXPERIMENTS, cycle((MEASURED, IDENTIFIED, VALIDATE, INITIAL)), strict=False))


def quality_figure(qualities: list[Quality], gathered: Gathered) -> Figure:
    """The quality page: coverage over time, gaps, noise, rates, clock fit, repairs and refusals."""
    refused, agreed = gathered.refused, gathered.clock
    figure = plt.figure(figsize=(14, 13))
    left, right = figure.subfigures(1, 2, squeeze=False, width_ratios=(3, 2))[0]
    _coverage(left.subplots(), qualities)
    gaps, noise, jitter, clock, words = right.subplots(5, 1, height_ratios=(1, 1, 1, 1, 1.4))

    lengths = 1e3 * np.concatenate([quality.gaps for quality in qualities])
    if len(lengths):
        gaps.hist(lengths, bins=40, color=IDENTIFIED)
    gaps.set(
        title=f"Gaps: {len(lengths)}",
        xlabel="length (ms)",
        ylabel="count",
        yscale="log" if len(lengths) > 100 else "linear",
    )

    segments = qualities[0].take.segments
    noise.boxplot(
        [[1e3 * quality.position_noise[i] for quality in qualities] for i in range(len(segments))],
        tick_labels=[segment.removeprefix("unit_") for segment in segments],
        showfliers=False,
    )
    noise.set(title="Noise per segment", xlabel="segment", ylabel="position (mm)", ylim=(0, None))

    numbers = np.arange(len(qualities))
    colors = [COLORS[quality.take.experiment] for quality in qualities]
    jitters = [np.nan if q.findings.frames is None else 1e3 * q.findings.frames.jitter for q in qualities]
    jitter.bar(numbers, jitters, color=colors)
    rates = [1 / quality.interval for quality in qualities]
    title = f"Frame stamps: {np.median(rates):.1f} Hz, {sum(q.dropped for q in qualities)} frames dropped"
    jitter.set(title=title, xlabel="trial", ylabel="jitter (ms)")
    jitter.set_ylim(0, max(1.4 * np.nanmax([0, *jitters]), LEAST_JITTER))

    clock.axhline(1e3 * agreed.offset, color=MEASURED, lw=1)
    clock.set_visible(any(len(quality.take.tendons) for quality in qualities))
    for label, fill, fits in (
        ("by motion, the arm's lag in it", "none", [q.findings.by_motion for q in qualities]),
        ("by log times", VALIDATE, [q.findings.by_log_times for q in qualities]),
    ):
        offsets = [np.nan if fit is None else 1e3 * fit.offset for fit in fits]
        clock.scatter(numbers, offsets, s=18, facecolor=fill, edgecolor=VALIDATE, label=label)
    clock.legend()
    uncertain = "" if agreed.uncertainty is None else f" ± {1e3 * agreed.uncertainty:.1f}"
    found = "no trial tells" if agreed.by is None else f"{1e3 * agreed.offset:.1f}{uncertain} ms, by {agreed.by}"
    clock.set(title=f"Cameras' clock − motors' clock: {found}", xlabel="trial", ylabel="offset (ms)")

    words.axis("off")
    lines = [f"refused {name}: {reason}" for name, reason in refused.items()]
    lines += by_sentence(qualities, lambda found: [f"check {said}" for said in found.warnings] + found.repairs)
    wrapped = [part for line in lines for part in textwrap.wrap(line, 78)] or ["nothing"]
    more = [f"… and {len(wrapped) - 14} lines more in quality.json"] if len(wrapped) > 14 else []
    words.set_title("Refused, repaired, and to be checked")
    words.text(0, 1, "\n".join(wrapped[:14] + more), va="top", fontsize=8, transform=words.transAxes)
    for panel in (jitter, clock):
        panel.set_xlim(-1, len(qualities))
        panel.xaxis.get_major_locator().set_params(integer=True)
    kinds = {quality.take.experiment for quality in qualities}
    jitter.legend(handles=[Patch(color=COLORS[name], label=name) for name in COLORS if name in kinds], ncols=3)
    return figure


def _coverage(axes, qualities: list[Quality]) -> None:
    """A band a trial, in it a row a segment: what was seen when."""
    bins = int(max(quality.take.time[-1] for quality in qualities) / BIN) + 1
    bands, ticks, row = [], [], 0
    for quality in qualities:
        take = quality.take
        place = (take.time / BIN).astype(int)
        frames = np.bincount(place, minlength=bins)
        apart = 1 + len(take.segments) // 10  # empty rows to the next band
        band = np.full((len(take.segments) + apart, bins), np.nan)
        for index in range(len(take.segments)):
            good = np.isfinite(take.positions[:, index, 0])
            share = np.bincount(place, weights=good, minlength=bins) / np.maximum(frames, 1)
            level = np.where(share == 0, 0, np.where(share < 1, 1, 2)).astype(float)
            level[place[-1] + 1 :] = np.nan
            band[index] = level
        bands.append(band)
        ticks.append(row + len(take.segments) / 2)
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
    axes.set_yticks(ticks, [quality.take.name for quality in qualities], fontsize=7)
    axes.set(xlabel="time (s)")
    axes.set_title("Coverage: each trial's segments, base on top; red where unseen, yellow where in part")
    axes.grid(False)


def filter_figure(take: Take, trial: Trial) -> Figure:
    """One moving trial before and after the filter, at the segment that moves most."""
    base = average_base(take.base_positions, take.base_quaternions)
    moved, _ = to_base_frame(base, take.positions, None)
    figure, axes = plt.subplots(2, 1, figsize=(9, 6), sharex=True)
    last = int(np.argmax(np.ptp(trial.positions, axis=0).sum(axis=1)))
    for axis, color in zip(range(3), (MEASURED, IDENTIFIED, VALIDATE), strict=True):
        axes[0].plot(take.time, 1e3 * moved[:, last, axis], ".", ms=2, color=color, alpha=0.5)
        axes[0].plot(trial.time, 1e3 * trial.positions[:, last, axis], color=color, label="xyz"[axis])
        rest = moved[:, last, axis] - np.interp(take.time, trial.time, trial.positions[:, last, axis])
        axes[1].plot(take.time, 1e3 * rest, ".", ms=2, color=color)
    for panel in axes:
        panel.axvline(trial.start, color=INITIAL, lw=1)
        for begin, end in stretches(~trial.measured[:, last]):
            panel.axvspan(trial.time[begin], trial.time[end], color=INITIAL, alpha=0.15, lw=0)
    axes[0].set(
        title=f"{trial.name}, {trial.segments[last]}: measured and filtered", ylabel="position (mm)"
    )
    axes[0].legend(ncols=3)
    axes[1].set(
        xlabel="time (s), line: detected start, shaded: not measured", ylabel="removed (mm)", ylim=(-2, 2)
    )
    return figure
