"""What all takes of a session have in common, and only together tell: the motors' clock, and the vertical."""

from dataclasses import dataclass
from typing import Literal

import numpy as np

from trunkline.recordings.cleaning.checks import Findings, deciding
from trunkline.recordings.cleaning.gravity_direction import check_levels, check_vertical
from trunkline.recordings.session.session import FixedBase, Session
from trunkline.recordings.signals.clock import agree
from trunkline.recordings.trials.experiments import EXPERIMENTS
from trunkline.recordings.trials.raw_trial import Take

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


def align_clocks(takes: list[Take], findings: list[Findings], longest_lag: float) -> MotorClock:
    """Give every take the offset of its motors' clock.

    By log times it is each trial's own. The arm's motion, in whose offset its lag is, checks them: no arm is ahead of
    its tendons, or far behind them. It decides where log times tell nothing or cannot be true, and it is said that the
    lag is in it then. What the session's takes agree on is by those for identification alone, so that the others stay
    unseen until they validate; by all, where those tell nothing, and then it is said.

    Args:
        longest_lag: s, by which the arm may move after its tendons, and lags of trials may differ.
    """
    pairs = list(zip(takes, findings, strict=True))
    logged = {take.name: found.by_log_times.offset for take, found in pairs if found.by_log_times}
    moved = {take.name: fit.offset for take, found in pairs if (fit := found.by_motion) and fit.certain}
    lags = {name: moved[name] - offset for name, offset in logged.items() if name in moved}
    clock, said = _agreed(takes, findings, logged, moved, lags, longest_lag)
    for take, found in pairs:
        take.clock_offset = clock.offset
        found.warnings += said
        if clock.by == "log times" and take.name in logged:
            take.clock_offset = _own(clock, logged[take.name], lags.get(take.name), longest_lag, found)
    return clock


def _agreed(
    takes: list[Take],
    findings: list[Findings],
    logged: dict[str, float],
    moved: dict[str, float],
    lags: dict[str, float],
    longest_lag: float,
) -> tuple[MotorClock, list[str]]:
    """What the takes agree on, and what is to be said of it."""
    splits = {take.name: take.split for take in takes}
    told, others = deciding(logged or moved, splits.__getitem__)
    if not told:
        driven = any(len(take.tendons) and not EXPERIMENTS[take.experiment].static for take in takes)
        nothing = "clock: neither log times nor motion tell the motors' offset; it is taken for 0"
        return MotorClock(), [nothing] * driven
    offset, spread = agree([(logged or moved)[name] for name in told])
    said = []
    if others:
        tells = f"clock: no trial of the split identify tells the motors' offset of {offset:.3f} s"
        said.append(f"{tells}; it is of trials of other splits")
    lag = float(np.median([lags[name] for name in deciding(lags, splits.__getitem__)[0]])) if lags else None
    if logged and (lag is None or -AHEAD <= lag <= longest_lag):
        uncertain = [found.by_log_times.uncertainty for found in findings if found.by_log_times]
        return MotorClock(offset, spread, float(np.median(uncertain)), "log times", lag), said
    why = "log times tell nothing of it"
    if lag is not None:
        offset, spread = agree([moved[name] for name in deciding(moved, splits.__getitem__)[0]])
        expected = f"expected {-AHEAD:g} to {longest_lag:g} s: does one recorder log both topics?"
        why = f"by log times the arm would move {lag:+.3f} s after its tendons, {expected}"
    said.append(f"clock: the motors' offset of {offset:.3f} s is by the arm's motion, and its lag is in it; {why}")
    return MotorClock(offset, spread, None, "motion"), said


def _own(clock: MotorClock, own: float, lag: float | None, longest_lag: float, found: Findings) -> float:
    """The offset of a trial whose log times say `own`, s, in which the arm then lags by `lag`, s."""
    if lag is not None and clock.lag is not None and abs(lag - clock.lag) > longest_lag:
        lags = f"in which the arm would lag by {lag:+.3f} s, in the median by {clock.lag:+.3f} s"
        found.warnings.append(f"clock: the motors' offset by log times is {own:.3f} s, {lags}; the session's is used")
        return clock.offset
    if clock.uncertainty is not None and abs(own - clock.offset) > max(clock.uncertainty, LEAST):
        apart = f"more than {1e3 * max(clock.uncertainty, LEAST):.1f} ms from the session's {clock.offset:.3f} s"
        found.warnings.append(f"clock: the motors' offset is {apart}; each such trial has its own, by its log times")
    return own


def settle_vertical(takes: list[Take], findings: list[Findings], session: Session) -> None:
    """Give every take the vertical that its session's tilts prove, and say so; or say what looks wrong."""
    measured_base = not isinstance(session.base, FixedBase)
    up, said, fallback = check_vertical(takes, measured_base)
    for take, found in zip(takes, findings, strict=True):
        if up is not None:
            take.up = up
        if said is not None:
            (found.warnings if up is None else found.repairs).append(said)
        if fallback:
            told = "those of the split identify do not tell"
            found.warnings.append(f"up: the vertical is by the tilts of other splits too, as {told}")
    if measured_base and (up is not None or said is None):
        check_levels(takes, findings)
