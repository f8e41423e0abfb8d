"""What all raw trials of a session have in common, and only together tell: the motors' clock, and the vertical."""

from dataclasses import dataclass
from typing import Literal

import numpy as np

from trunkline.recordings.cleaning.checks import Findings, deciding
from trunkline.recordings.cleaning.gravity_direction import check_gravity_direction, check_levels
from trunkline.recordings.session.session import FixedBase, Session
from trunkline.recordings.signals.clock import agree
from trunkline.recordings.trials.experiments import EXPERIMENTS
from trunkline.recordings.trials.raw_trial import RawTrial

AHEAD = 0.03  # s, by which a fit of its motion may put an arm ahead of its tendons
LEAST = 1e-3  # s, by which clocks of trials may differ at least before it is said


@dataclass
class MotorClock:
    """What a session's trials say of the motors' clock: time = motor time + offset, s.

    spread: s, robust deviation over the trials. by: what tells. lag: s, of the arm behind its tendons, in the median.
    None, also as uncertainty, s, where it is not known.
    """

    offset: float = 0.0
    spread: float | None = None
    uncertainty: float | None = None
    by: Literal["log times", "motion"] | None = None
    lag: float | None = None


def align_clocks(raw_trials: list[RawTrial], findings: list[Findings], longest_lag: float) -> MotorClock:
    """Give every raw trial the offset of its motors' clock.

    By log times it is each trial's own. The arm's motion, in whose offset its lag is, checks them: no arm is ahead of
    its tendons, or far behind them. It decides, with a warning that the lag is included, where log times are missing,
    or where those of one trial alone are impossible; where those of several agree, it only warns. The session's common
    offset comes from the split `identify` alone, so that other trials stay unused until they validate; from all, with
    a warning, where `identify` gives none.

    Args:
        longest_lag: s, by which the arm may move after its tendons, and lags of trials may differ.
    """
    pairs = list(zip(raw_trials, findings, strict=True))
    logged = {raw.name: record.by_log_times.offset for raw, record in pairs if record.by_log_times}
    moved = {raw.name: fit.offset for raw, record in pairs if (fit := record.by_motion) and fit.certain}
    lags = {name: moved[name] - offset for name, offset in logged.items() if name in moved}
    clock, remarks = _agreed(raw_trials, findings, logged, moved, lags, longest_lag)
    for raw, record in pairs:
        raw.clock_offset = clock.offset
        record.warnings += remarks
        if clock.by == "log times" and raw.name in logged:
            raw.clock_offset = _trial_offset(clock, logged[raw.name], lags.get(raw.name), longest_lag, record)
    return clock


def _agreed(
    raw_trials: list[RawTrial],
    findings: list[Findings],
    logged: dict[str, float],
    moved: dict[str, float],
    lags: dict[str, float],
    longest_lag: float,
) -> tuple[MotorClock, list[str]]:
    """The common offset of the raw trials, and remarks about it."""
    splits = {raw.name: raw.split for raw in raw_trials}
    chosen, others = deciding(logged or moved, splits.__getitem__)
    if not chosen:
        driven = any(len(raw.tendons) and not EXPERIMENTS[raw.experiment].static for raw in raw_trials)
        nothing = "clock: neither log times nor motion tell the motors' offset; it is taken for 0"
        return MotorClock(), [nothing] * driven
    offset, spread = agree([(logged or moved)[name] for name in chosen])
    remarks = []
    if others:
        tells = f"clock: no trial of the split identify tells the motors' offset of {offset:.3f} s"
        remarks.append(f"{tells}; it is of trials of other splits")
    lag = float(np.median([lags[name] for name in deciding(lags, splits.__getitem__)[0]])) if lags else None
    possible = lag is None or -AHEAD <= lag <= longest_lag
    uncertain = [record.by_log_times.uncertainty for record in findings if record.by_log_times]
    steady = len(chosen) > 1 and logged and spread <= max(float(np.median(uncertain)), LEAST)
    if logged and (possible or steady):
        if not possible:
            moves = f"by its motion the arm would move {lag:+.3f} s after its tendons, expected {-AHEAD:g} to"
            stays = f"the log times of {len(chosen)} trials agree on {offset:.3f} s, which is used"
            remarks.append(f"clock: {moves} {longest_lag:g} s; {stays}: are the commands those that motors had?")
        return MotorClock(offset, spread, float(np.median(uncertain)), "log times", lag), remarks
    why = "log times tell nothing of it"
    if lag is not None:
        offset, spread = agree([moved[name] for name in deciding(moved, splits.__getitem__)[0]])
        expected = f"expected {-AHEAD:g} to {longest_lag:g} s: does one recorder log both topics?"
        why = f"by log times the arm would move {lag:+.3f} s after its tendons, {expected}"
    remarks.append(f"clock: the motors' offset of {offset:.3f} s is by the arm's motion, and its lag is in it; {why}")
    return MotorClock(offset, spread, None, "motion"), remarks


def _trial_offset(clock: MotorClock, logged: float, lag: float | None, longest_lag: float, record: Findings) -> float:
    """The offset, s, of a trial that has `logged` by its log times, s, with which the arm lags by `lag`, s."""
    if lag is not None and clock.lag is not None and abs(lag - clock.lag) > longest_lag:
        lags = f"in which the arm would lag by {lag:+.3f} s, in the median by {clock.lag:+.3f} s"
        offset = f"the motors' offset by log times is {logged:.3f} s"
        record.warnings.append(f"clock: {offset}, {lags}; the session's is used")
        return clock.offset
    if clock.uncertainty is not None and abs(logged - clock.offset) > max(clock.uncertainty, LEAST):
        apart = f"more than {1e3 * max(clock.uncertainty, LEAST):.1f} ms from the session's {clock.offset:.3f} s"
        record.warnings.append(f"clock: the motors' offset is {apart}; each such trial has its own, by its log times")
    return logged


def set_gravity_direction(raw_trials: list[RawTrial], findings: list[Findings], session: Session) -> None:
    """Set the gravity direction that the session's tilts prove in every raw trial; or warn of what looks wrong."""
    measured_base = not isinstance(session.base, FixedBase)
    up, remark, fallback = check_gravity_direction(raw_trials, measured_base)
    for raw, record in zip(raw_trials, findings, strict=True):
        if up is not None:
            raw.up = up
        if remark is not None:
            (record.warnings if up is None else record.repairs).append(remark)
        if fallback:
            reason = "those of the split identify do not tell"
            record.warnings.append(f"up: the vertical is by the tilts of other splits too, as {reason}")
    if measured_base and (up is not None or remark is None):
        check_levels(raw_trials, findings)
