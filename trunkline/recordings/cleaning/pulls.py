"""Whether a trial's tendons did what its experiment means: against its level, and commands against measurements."""

import numpy as np

from trunkline.recordings.signals.clock import MIN_TRAVEL
from trunkline.recordings.signals.smoothing import noise_level
from trunkline.recordings.trials.experiments import EXPERIMENTS, PULL
from trunkline.recordings.trials.raw_trial import RawTrial
from trunkline.recordings.trials.recording import FORCE, PULLED

FOLLOWS, FAILS = 0.9, 0.5  # correlations of a measured tendon with its command's, and with another's
FITS = 1.25  # factor within which a pull is as its level says, whatever is let out meanwhile
LATEST = 0.3  # s, of a lag that is looked for
EARLY = 0.01  # s by which what is measured may come before its command
NOISIER = 5.0  # times the measurements' noise, that no command has
LATE = 0.25  # s by which commands may begin after the poses
VARIES = 0.02  # of the largest tension, by which one that is held may vary
HELD = MIN_TRAVEL  # m, to either side, by which a tendon that is held may be wound


def encoder_zeros(raw_trials: list[RawTrial], idle: float) -> dict[str, float]:
    """What each tendon's measured position reads where its command is 0, m, by the raw trials that pull.

    None of a tendon of which most of them are off by more than `idle`: its encoder starts anywhere in each trial.
    """
    readings: dict[str, list[float]] = {}
    for raw in raw_trials:
        if EXPERIMENTS[raw.experiment].needs_motors and raw.commands.size and raw.tendon_positions.size:
            ahead = np.median(raw.tendon_positions - _commanded(raw), axis=0)
            for name, reads in zip(raw.tendons, ahead.tolist(), strict=True):
                readings.setdefault(name, []).append(reads)
    middle = {name: float(np.median(reads)) for name, reads in readings.items()}
    return {name: zero for name, zero in middle.items() if np.median(np.abs(np.array(readings[name]) - zero)) <= idle}


def check_pulls(raw: RawTrial, length: float, idle: float, factor: float, zeros: dict[str, float]) -> list[str]:
    """What cannot be true of a raw trial's tendons, a sentence each.

    Args:
        length: m, of the arm, from which no tendon can be drawn in by more than that.
        idle: m, by which tendons may be drawn in, or commands may move, in an experiment that does not pull them.
        factor: by which pulls may differ from the level, and measured from commanded ones.
        zeros: as `encoder_zeros` gives them.
    """
    kind = EXPERIMENTS[raw.experiment]
    if raw.command_unit == FORCE:
        return _tensions(raw)
    if kind.needs_motors and kind.level is PULL and raw.level is not None:
        for key, pulls in (("commands", raw.commands), ("tendon positions", raw.tendon_positions)):
            # from the straight arm, or where encoders start anywhere, from the trial's begin
            faults = [_against_level(key, pulls - zero, 1e-3 * raw.level, factor) for zero in (0.0, pulls[:1])]
            if pulls.size and all(faults):
                return faults[1]
    elif kind.needs_motors:
        faults = _fixed_commands(raw) if kind.static and not kind.stepwise else []
        faults += _beyond("commands", raw.commands, length)
        faults += _beyond("tendon positions", raw.tendon_positions - raw.tendon_positions[:1], length)
        if faults:
            return faults
    elif faults := _pulled(raw, kind.static, idle, zeros):
        return faults
    if raw.commands.size and raw.tendon_positions.size:
        return _against_commands(raw, factor)
    return []


def _tensions(raw: RawTrial) -> list[str]:
    """Motors that are commanded by force pull with positive ones, hold these at rest, and none without actuation."""
    inside = (raw.command_time >= 0) & (raw.command_time <= raw.time[-1])
    commands = raw.commands[inside] if inside.any() else raw.commands[-1:]
    if not commands.size:
        return []
    kind, felt = EXPERIMENTS[raw.experiment], PULLED[FORCE]
    lowest, highest = float(commands.min()), float(commands.max())
    if -lowest > max(felt, highest):
        problem = f"found tensions from {lowest:.4g} to {0.0 + max(highest, 0.0):.4g} N"
        return [f"commands: {problem}, expected positive ones where a tendon is pulled: is the sign reversed?"]
    usual = np.median(commands, axis=0)
    if not kind.needs_motors and usual.max() > felt:
        problem = f"{raw.tendons[int(np.argmax(usual))]!r} is pulled by {usual.max():.4g} N"
        return [f"experiment: commands: {problem}, expected a {raw.experiment} without actuation"]
    off = np.mean(np.abs(commands - usual) > max(felt, VARIES * float(usual.max())), axis=0)
    if kind.needs_motors and kind.static and not kind.stepwise and off.max() > 0.5:
        problem = f"{raw.tendons[int(np.argmax(off))]!r} is pulled by {np.ptp(commands[:, np.argmax(off)]):.4g} N more "
        return [f"experiment: commands: {problem}at times, expected a {raw.experiment} to hold them"]
    return []


def _pulled(raw: RawTrial, static: bool, idle: float, zeros: dict[str, float]) -> list[str]:
    """In an experiment without motors, commands do not move while the arm does, and most of the time no tendon is drawn
    in. A loose one may well move by itself, and may be let out by any length.

    Measured positions tell it where what they read without a pull is known; and where there are no commands, as they
    stand for them then.
    """
    expected = f"expected a {raw.experiment} without actuation"
    if raw.commands.size and not static:
        wound = np.ptp(raw.commands, axis=0)
        most = int(np.argmax(wound))
        if wound[most] > idle:
            problem = f"{raw.tendons[most]!r} is wound by {1e3 * wound[most]:.4g} mm"
            return [f"experiment: commands: {problem}, {expected}"]
    unknown = np.nan if raw.commands.size else 0.0
    zero = np.array([zeros.get(name, unknown) for name in raw.tendons])
    for key, time, pulls in (
        ("commands", raw.command_time, raw.commands),
        ("tendon positions", raw.tendon_time, raw.tendon_positions - zero),
    ):
        if not pulls.size:
            continue
        inside = (time >= 0) & (time <= raw.time[-1])
        usual = np.nan_to_num(np.median(pulls[inside] if inside.any() else pulls, axis=0))
        most = int(np.argmax(usual))
        if usual[most] > idle:
            return [f"experiment: {key}: {raw.tendons[most]!r} is drawn in by {1e3 * usual[most]:.4g} mm, {expected}"]
    return []


def late_commands(raw: RawTrial) -> list[str]:
    """That the commands of an arm in motion begin after its poses, by the motors' clock as it is set, or what is
    measured in place of commands; else none."""
    key, time = ("commands", raw.command_time) if len(raw.command_time) else ("tendon positions", raw.tendon_time)
    if EXPERIMENTS[raw.experiment].static or not EXPERIMENTS[raw.experiment].needs_motors or not len(time):
        return []
    begin = float(time[0]) + raw.clock_offset
    if begin <= LATE:
        return []
    before = "sent" if key == "commands" else "wound"
    problem = f"the first comes {begin:.2f} s after the first pose, and no log tells what was {before} before"
    return [f"{key}: {problem}: expected one from before the motion, or a `window` from then on"]


def _fixed_commands(raw: RawTrial) -> list[str]:
    """In an experiment at rest, most of the time every command is about where it is in the middle: windows may touch
    the way to the next pull, the more so as the motors' clock is not set yet."""
    inside = (raw.command_time >= 0) & (raw.command_time <= raw.time[-1])
    if not inside.any():
        return []
    off = np.abs(raw.commands[inside] - np.median(raw.commands[inside], axis=0))
    most = int(np.argmax(np.mean(off > HELD, axis=0)))
    if np.mean(off[:, most] > HELD) <= 0.5:
        return []
    problem = f"{raw.tendons[most]!r} is wound by {1e3 * np.ptp(raw.commands[inside, most]):.4g} mm"
    return [f"experiment: commands: {problem}, expected a {raw.experiment} to hold them to within {1e3 * HELD:g} mm"]


def _beyond(key: str, pulls: np.ndarray, length: float) -> list[str]:
    """No tendon is drawn in by more than the arm is long."""
    pulled = float(pulls.max(initial=0.0))
    if pulled <= length:
        return []
    hint = ": are they in mm?" if 1e-3 * pulled <= length else ""
    return [f"{key}: found pulls up to {pulled:.4g} m, expected less than the arm's length of {length:.4g} m{hint}"]


def _against_level(key: str, wound: np.ndarray, level: float, factor: float) -> list[str]:
    """A pull is positive, in metres, and about as far as the level says."""
    pulled, let_out = wound.max(initial=0.0), -wound.min(initial=0.0)
    sizes = (pulled, let_out, 1e-3 * max(pulled, let_out))
    off, reverse, in_mm = (abs(np.log(max(size, 1e-9) / level)) for size in sizes)
    mirrored = reverse < off and reverse <= np.log(factor) and off > np.log(FITS)
    if off <= np.log(factor) and not mirrored:
        return []
    problem = f"{key}: found pulls from {0.0 - let_out:.4g} to {pulled:.4g} m"
    expected = f"expected about {level:.4g} m, as the level says, positive where a tendon is pulled in"
    hint = ": is the sign reversed?" if mirrored else ": are they in mm?" if in_mm <= np.log(factor) else ""
    return [f"{problem}, {expected}{hint}"]


def _against_commands(raw: RawTrial, factor: float) -> list[str]:
    """Each tendon's measured position follows its own command, forwards, by about as much, and not ahead of it."""
    measured, commanded = raw.tendon_positions, _commanded(raw)
    faults = []
    for tendon, name in enumerate(raw.tendons):
        if max(np.ptp(measured[:, tendon]), np.ptp(commanded[:, tendon])) < MIN_TRAVEL:
            continue
        alike = [_correlation(measured[:, tendon], command) for command in commanded.T]
        best = int(np.argmax(alike))
        expected = "expected a tendon to follow its own command"
        if alike[tendon] < -FAILS:
            faults.append(f"tendons: {name!r} moves against its commands, {expected}: is the sign reversed?")
        elif alike[tendon] < FAILS and alike[best] > FOLLOWS:
            faults.append(f"tendons: {name!r} follows the commands of {raw.tendons[best]!r}, {expected}")
        else:
            travel, commanded_travel = np.ptp(measured[:, tendon]), np.ptp(commanded[:, tendon])
            if not commanded_travel / factor <= travel <= commanded_travel * factor:
                problem = f"{name!r} moves by {travel:.4g} m where {commanded_travel:.4g} m are commanded"
                faults.append(f"tendons: {problem}, {expected}, within a factor of {factor:g}")
    return faults or _exchanged(raw, commanded)


def _exchanged(raw: RawTrial, commanded: np.ndarray) -> list[str]:
    """Measurements lag behind commands and have noise; where it is the other way about, topics are exchanged."""
    most = int(np.argmax(np.ptp(commanded, axis=0)))
    if np.ptp(commanded[:, most]) < MIN_TRAVEL or len(raw.tendon_time) < 10:
        return []
    lags = np.arange(-LATEST, LATEST, 0.005)
    time, measured = raw.tendon_time, raw.tendon_positions[:, most]
    inside = (time > time[0] + LATEST) & (time < time[-1] - LATEST)
    if inside.sum() < 10:
        return []
    shifted = [np.interp(time[inside] - lag, raw.command_time, raw.commands[:, most]) for lag in lags]
    lag = float(lags[int(np.argmax([_correlation(measured[inside], command) for command in shifted]))])
    noise = [float(noise_level(some)[most]) for some in (raw.commands, raw.tendon_positions)]
    if lag >= -EARLY and not (lag <= EARLY and noise[0] > NOISIER * noise[1]):
        return []
    problem = f"commands are noisier, by {1e3 * noise[0]:.2g} mm, than what is measured, by {1e3 * noise[1]:.2g} mm"
    if lag < -EARLY:
        problem = f"what is measured comes {-1e3 * lag:.0f} ms before its command"
    causes = "are `commands` and `tendon_positions` exchanged in session.yaml, or dated by clocks that differ?"
    return [f"topics: {problem}: {causes}"]


def _commanded(raw: RawTrial) -> np.ndarray:
    """Commands at the times of the measured positions, m. Shape (Tm, K)."""
    return np.stack([np.interp(raw.tendon_time, raw.command_time, command) for command in raw.commands.T], axis=1)


def _correlation(first: np.ndarray, second: np.ndarray) -> float:
    first, second = first - first.mean(), second - second.mean()
    size = np.linalg.norm(first) * np.linalg.norm(second)
    return float(first @ second / size) if size > 0 else 0.0
