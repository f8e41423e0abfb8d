"""How good a session's data are: what was seen, how noisy it is, what was repaired and what refused."""

from collections.abc import Callable
from dataclasses import dataclass

import numpy as np

from trunkline.recordings.cleaning.checks import Findings
from trunkline.recordings.cleaning.clock_offset import MotorClock
from trunkline.recordings.cleaning.session_checks import CheckedSession
from trunkline.recordings.logs.mcap_log import Log
from trunkline.recordings.signals.smoothing import noise_level
from trunkline.recordings.trials.raw_trial import RawTrial


@dataclass
class Quality:
    """The quality of one raw trial.

    interval: s, median time between frames. dropped: frames missing between others.
    coverage: (S,) share of frames in which a marker has a good sample. gaps: s, of each stretch without.
    position_noise: (S,) m, angle_noise: (S,) rad or None: per axis, standard deviation.
    """

    raw: RawTrial
    findings: Findings
    interval: float
    dropped: int
    coverage: np.ndarray
    gaps: np.ndarray
    position_noise: np.ndarray
    angle_noise: np.ndarray | None


def judge(raw: RawTrial, findings: Findings) -> Quality:
    """Measure the quality of a raw trial."""
    steps = np.diff(raw.time)
    interval = float(np.median(steps))
    visible = np.isfinite(raw.positions[..., 0])
    gaps = [np.diff(raw.time[good]) for good in visible.T]
    shape = (len(raw.time), len(raw.markers), -1)
    position_noise = noise_level(raw.positions.reshape(len(raw.time), -1)).reshape(shape[1:])
    angle_noise = None
    if raw.quaternions is not None:
        component = noise_level(raw.quaternions.reshape(len(raw.time), -1)).reshape(shape[1:])
        # half an angle is in the vector part; what three axes bring is spread over four components
        angle_noise = 2 * np.sqrt(np.sum(component**2, axis=1) / 3)
    return Quality(
        raw,
        findings,
        interval,
        int(np.sum(np.round(steps / interval) - 1)),
        visible.mean(axis=0),
        np.concatenate([gap[gap > 1.5 * interval] for gap in gaps]),
        np.sqrt(np.mean(position_noise**2, axis=1)),
        angle_noise,
    )


def by_sentence(qualities: list[Quality], sentences_of: Callable[[Findings], list[str]]) -> list[str]:
    """What is said of raw trials, each sentence once, with the trials of which it is said."""
    names: dict[str, list[str]] = {}
    for quality in qualities:
        for sentence in sentences_of(quality.findings):
            names.setdefault(sentence, []).append(quality.raw.name)
    every = len(qualities)
    who = ["all trials" if len(trials) == every > 1 else ", ".join(trials) for trials in names.values()]
    return [f"{trials}: {sentence}" for trials, sentence in zip(who, names, strict=True)]


def report(qualities: list[Quality], gathered: CheckedSession) -> dict:
    """The quality report, per trial and for the session; None where there is nothing to measure."""
    several = len({log.path.parent for log in _logs(qualities)}) > 1
    return {
        "trials": {quality.raw.name: _trial(quality) for quality in qualities},
        "refused": gathered.refused,
        "logs": {
            (f"{log.path.parent.name}/{log.path.name}" if several else log.path.name): {
                "messages": log.count,
                "without_checksum": log.unchecked,
            }
            for log in _logs(qualities)
        },
        "clock": clock_facts(gathered.clock),
    }


def clock_facts(clock: MotorClock) -> dict:
    """What a session's trials say of the motors' clock; of several sessions, `clocks` has each one's."""
    return {
        "by": clock.by,
        "offset_s": clock.offset,
        "spread_s": clock.spread,
        "uncertainty_s": clock.uncertainty,
        "lag_s": clock.lag,
    }


def remarks(qualities: list[Quality]) -> list[str]:
    """What whoever runs a stage should know at once, a line each."""
    logs = _logs(qualities)
    bare = [log.path.name for log in logs if log.unchecked]
    unchecked = f"{len(bare)} of {len(logs)} logs have messages without checksums, such as {bare[0]}" if bare else ""
    return [f"{unchecked}: bits that flipped there go unseen (quality.json: logs)"] if bare else []


def summary(qualities: list[Quality], gathered: CheckedSession) -> dict:
    """The session in a few numbers, for metrics.json. repairs: their number by split, and in all."""
    angles = [quality.angle_noise for quality in qualities if quality.angle_noise is not None]
    gaps, clock = np.concatenate([quality.gaps for quality in qualities]), gathered.clock
    repairs = dict.fromkeys(("total", *(quality.raw.split for quality in qualities)), 0)
    for quality in qualities:
        for split in ("total", quality.raw.split):
            repairs[split] += len(quality.findings.repairs)
    return {
        "trials": len(qualities),
        "refused": len(gathered.refused),
        "repairs": repairs,
        "warnings": sum(len(quality.findings.warnings) for quality in qualities),
        "poses": sum(len(quality.raw.time) * (len(quality.raw.markers) + 1) for quality in qualities),
        "coverage": float(np.mean([quality.coverage.mean() for quality in qualities])),
        "dropped_frames": sum(quality.dropped for quality in qualities),
        "gaps": len(gaps),
        "longest_gap_ms": 1e3 * float(gaps.max(initial=0)),
        "rate_hz": float(1 / np.median([quality.interval for quality in qualities])),
        "position_noise_mm": 1e3 * float(np.median([quality.position_noise for quality in qualities])),
        "orientation_noise_deg": float(np.degrees(np.median(angles))) if angles else None,
        "clock_offset_ms": 1e3 * clock.offset,
        "clock_spread_ms": None if clock.spread is None else 1e3 * clock.spread,
        "clock_uncertainty_ms": None if clock.uncertainty is None else 1e3 * clock.uncertainty,
        "clock_lag_ms": None if clock.lag is None else 1e3 * clock.lag,
    }


def _logs(qualities: list[Quality]) -> list[Log]:
    return list({log.path: log for quality in qualities if (log := quality.findings.log)}.values())


def _trial(quality: Quality) -> dict:
    raw, findings = quality.raw, quality.findings
    logged, moved = findings.by_log_times, findings.by_motion
    return {
        "experiment": raw.experiment,
        "split": raw.split,
        "frames": len(raw.time),
        "duration_s": float(raw.time[-1]),
        "rate_hz": 1 / quality.interval,
        "dropped_frames": quality.dropped,
        "stamp_jitter_ms": None if findings.frames is None else 1e3 * findings.frames.jitter,
        "coverage": dict(zip(raw.markers, quality.coverage.tolist(), strict=True)),
        "gaps": len(quality.gaps),
        "longest_gap_ms": 1e3 * float(quality.gaps.max(initial=0)),
        "position_noise_mm": 1e3 * float(np.median(quality.position_noise)),
        "orientation_noise_deg": (
            None if quality.angle_noise is None else float(np.degrees(np.median(quality.angle_noise)))
        ),
        "clock": (
            None
            if logged is None and moved is None
            else {
                "by_log_times_s": None if logged is None else logged.offset,
                "uncertainty_s": None if logged is None else logged.uncertainty,
                "by_motion_s": None if moved is None else moved.offset,
                "unexplained": None if moved is None else moved.ratio,
            }
        ),
        "stamps_over_log_times": (
            None
            if findings.logged is None
            else {
                "drift_ppm": 1e6 * (findings.logged.rate - 1),
                "jitter_ms": 1e3 * findings.logged.jitter,
                "worst_ms": 1e3 * findings.logged.worst,
            }
        ),
        "repairs": findings.repairs,
        "warnings": findings.warnings,
    }
