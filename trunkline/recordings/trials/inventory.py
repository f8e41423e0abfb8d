"""What was recorded, in words: tilts, releases, pulls and loads by split, and which directions are missing."""

import numpy as np

from trunkline.frames import tilt_of_gravity
from trunkline.recordings.trials.experiments import EXPERIMENTS
from trunkline.recordings.trials.recording import FORCE, PULLED
from trunkline.recordings.trials.splits import DECIDING, IDENTIFY, SPLITS
from trunkline.recordings.trials.trial import Trial, sessions_of

UPRIGHT = np.radians(3)  # of tilt, below which gravity has no direction across the arm
SEVERAL = 0.25  # share of a trial's largest pull, from which on two tendons are pulled together
WIDEST = 180.0  # deg without a direction, from which on one side of the arm is not seen
ONE_LINE = 20.0  # deg, within which directions lie in one plane


def recorded_lines(trials: list[Trial], splits: tuple[str, ...] = SPLITS) -> list[str]:
    """A line a kind of experiment: trials of `splits` by split, and over which range, but for those of `test`."""
    lines = []
    for kind, experiment in EXPERIMENTS.items():
        chosen = [trial for trial in trials if trial.experiment == kind]
        if chosen:
            counts = [f"{sum(t.split == split for t in chosen)} {split}" for split in splits]
            covered = _range([t for t in chosen if t.split in DECIDING])
            lines.append(f"{experiment.plural}: {', '.join(counts)}{covered}")
    return lines


def recorded_of_each(trials: list[Trial], splits: tuple[str, ...] = SPLITS) -> list[str]:
    """`recorded_lines`; of several sessions those of each, behind its name."""
    sessions = sessions_of(trials)
    if len(sessions) == 1:
        return recorded_lines(trials, splits)
    return [
        f"{session}: {line}"
        for session in sessions
        for line in recorded_lines([trial for trial in trials if trial.session == session], splits)
    ]


def _range(trials: list[Trial]) -> str:
    """Over which tilts, pulls and loads."""
    if not trials:
        return ""
    text = ""
    tilts = [np.degrees(tilt_of_gravity(trial.gravity)) for trial in trials if trial.gravity.any()]
    if tilts and max(tilts) > np.degrees(UPRIGHT):
        ends = dict.fromkeys(f"{tilt:.0f}" for tilt in (min(tilts), max(tilts)))
        text += f"; tilted by {' to '.join(ends)}°"
    pulls, unit = [float(_drawn(trial).max(initial=0)) for trial in trials], trials[0].command_unit
    if max(pulls) > PULLED[unit]:
        text += f"; pulls of up to {_pull(max(pulls), unit, '.3g', '.0f')}"
    loads = sorted({trial.load for trial in trials})
    if loads != [0.0]:
        text += f"; loads of {', '.join(f'{1e3 * load:.0f}' for load in loads)} g"
    return text


def missing_lines(trials: list[Trial]) -> list[str]:
    """What the trials to identify from leave out: directions of tilts and releases, tendons, pulls of several."""
    identifying = [trial for trial in trials if trial.split == IDENTIFY]
    tilts = [t.gravity for t in identifying if t.gravity.any() and tilt_of_gravity(t.gravity) > UPRIGHT]
    lines = _sides("tilts", np.array([np.arctan2(g[1], g[0]) for g in tilts]), "gravity pulls the arm")
    releases = [trial for trial in identifying if EXPERIMENTS[trial.experiment].hangs]
    lines += _sides("releases", np.array([_bent(trial) for trial in releases]), "the arm is held")
    return lines + _pulls([trial for trial in identifying if EXPERIMENTS[trial.experiment].needs_motors])


def _sides(what: str, azimuths: np.ndarray, word: str) -> list[str]:
    """Whether directions (n,), rad, leave out a side of the arm."""
    if not len(azimuths):
        return []
    degrees = np.sort(np.degrees(azimuths) % 360)
    gaps = np.diff(np.append(degrees, degrees[0] + 360))
    if gaps.max() < WIDEST:
        return []
    if gaps.max() > 360 - ONE_LINE:
        only = round(float(np.degrees(np.angle(np.mean(np.exp(1j * azimuths))))))
        return [f"{what}: {word} towards {only}° alone (base +x is 0°)"]
    middle = (degrees[np.argmax(gaps)] + gaps.max() / 2 + 180) % 360 - 180
    half = np.degrees(azimuths) % 180
    turned = np.angle(np.mean(np.exp(2j * np.radians(half)))) / 2
    apart = np.degrees(np.abs(np.angle(np.exp(2j * (np.radians(half) - turned))) / 2)).max()
    plane = ", all in one plane" if apart < ONE_LINE / 2 else ""
    return [f"{what}: {word} to no side within {gaps.max() / 2:.0f}° of {middle:.0f}° (base +x is 0°){plane}"]


def _bent(trial: Trial) -> float:
    """Towards which side the last tracked point is held at the start, from where it ends, rad."""
    tip = trial.positions[:, np.argmax(np.ptp(trial.positions, axis=0).max(axis=1))]
    start = int(np.searchsorted(trial.time, trial.start))
    return float(np.arctan2(*(tip[min(start, len(tip) - 1)] - tip[-1])[1::-1]))


def _pull(size: float, unit: str, newtons: str, millimetres: str) -> str:
    return f"{size:{newtons}} N" if unit == FORCE else f"{1e3 * size:{millimetres}} mm"


def _drawn(trial: Trial) -> np.ndarray:
    """How far each tendon is drawn in beyond its least, or pulled, at most, in the unit of commands. Shape (K,)."""
    return np.maximum(trial.commands, 0).max(axis=0, initial=0)


def _pulls(trials: list[Trial]) -> list[str]:
    if not trials:
        return []
    lines, most, unit = [], np.max([_drawn(trial) for trial in trials], axis=0), trials[0].command_unit
    idle = [name for name, pull in zip(trials[0].tendons, most, strict=True) if pull < PULLED[unit]]
    if len(idle) == len(most):
        if not (pull := most.max(initial=0)):
            return ["no tendon is pulled; if some were, their sign in session.yaml is wrong"]
        most_pulled = _pull(pull, unit, ".2g", ".2g")
        return [f"no tendon is pulled by more than {most_pulled}: is the unit in session.yaml right?"]
    if idle:
        lines.append(f"never pulled: {', '.join(idle)}")
    if max(_at_once(trial) for trial in trials) == 1:
        lines.append("only one tendon is pulled at a time: how several share the load is not seen")
    return lines


def _at_once(trial: Trial) -> int:
    """How many tendons are pulled together, at most."""
    pulls = np.maximum(trial.commands, 0)
    return int((pulls > max(SEVERAL * pulls.max(initial=0), PULLED[trial.command_unit])).sum(axis=1).max(initial=0))
