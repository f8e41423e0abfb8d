"""Whether trials are of this arm: its markers and tendons, each where its name says and pulled as far as it says."""

import mujoco
import numpy as np
from scipy.ndimage import maximum_filter1d, minimum_filter1d
from scipy.optimize import linear_sum_assignment

from trunkline.errors import InputError
from trunkline.frames import tilt_of_gravity
from trunkline.identification.simulate.pose_fit import MEASURED_SHARE, fit_pose, measured_pose, start_frames
from trunkline.model.arm_model import ArmModel
from trunkline.recordings.trials.experiments import EXPERIMENTS
from trunkline.recordings.trials.recording import LENGTH, PULLED
from trunkline.recordings.trials.trial import Trial

WOUND = 5e-3  # m, from which on a tendon counts as wound, and the arm as bent by it
PLACES = 12  # frames of a trial in which several tendons pull in turn
SHORTER = 0.75  # of the cables' stretch that other names may leave at least, where those given are right
STRETCH = 2.5e-3  # m, all tendons together, in the mean over frames, from which on more stretch than need be counts
SHARE = 0.1  # of the deepest pull of each frame, likewise: guide holes that are askew by some degrees cost as much
CLEAR = 0.3  # of the deepest pull, likewise, from which on an exchange is clear in one trial: holes cost 0.13 at most
ALIKE = 0.5  # of how well pulls and path lengths agree at best; two of three tendons exchanged: -0.5, out of six: 0.5
SHORTEST, LONGEST = 0.4, 1.5  # of a pull, by which its path is shorter: weak motors and cables that stretch take of it
OFF = 1e-2  # m between a pull and its path, which an arm bent at rest may have too
APART = 0.1  # s between a command and what the arm does about it
UPRIGHT = np.radians(15)  # up to which gravity does not bend the arm by itself
HELD_FRAMES = 6  # of a trial, with deep pulls
NAMED = 3  # trials in a message, before the others are counted


def check_trials(trials: list[Trial], model: mujoco.MjModel) -> None:
    """Refuse trials whose names are not those of the model, then those that bend to the side of other tendons, and
    then those that bend by another amount.

    Raises:
        InputError: naming the key of session.yaml, the trial, what was found and what was expected.
    """
    for trial in trials:
        check_names(trial, model)
    trials = [trial for trial in trials if len(trial.markers) > 1]  # of a tip alone, many shapes lead there
    trials = [trial for trial in trials if trial.tendons]
    driven = [trial for trial in trials if EXPERIMENTS[trial.experiment].needs_motors]
    if ArmModel(model).commands == "force":  # by how much a cable gets shorter is no matter of its tension alone
        driven = []
    for trial in trials:
        if not _by_lengths(trial):
            check_sides(trial, model)
    check_lengths([trial for trial in trials if _by_lengths(trial)], model)
    check_scales(driven, model)


def _by_lengths(trial: Trial) -> bool:
    """Whether several motors may pull at once, each as far as it likes."""
    kind = EXPERIMENTS[trial.experiment]
    return kind.needs_motors and kind.level is None and trial.command_unit == LENGTH


def check_names(trial: Trial, model: mujoco.MjModel) -> None:
    """Refuse a trial whose markers or tendons the model does not have, or that has only some of its tendons: those
    that it leaves out may have pulled."""
    arm = ArmModel(model)
    tendons = arm.cable_names
    for key, used, names in (("markers", trial.markers, arm.markers), ("tendons", trial.tendons, tendons)):
        unknown = [name for name in used if name not in names]
        if unknown:
            valid = f"names of the model: {', '.join(names)}" if names else "none, as the arm has none"
            if key == "tendons" and names:
                valid += "; under `tendons` or `motors`, what moves which"
            raise InputError(f"session.yaml: {key}: trial {trial.name}: found {unknown[0]!r}, expected {valid}")
    if trial.tendons and trial.command_unit != arm.command_unit:
        means = "build_mjcf.actuation.commands: force" if arm.command_unit == LENGTH else "build_mjcf.actuation"
        problem = f"found commands in {trial.command_unit}, expected {arm.command_unit}, as the model's motors take"
        raise InputError(f"session.yaml: motors: trial {trial.name}: {problem}; see {means}")
    if trial.tendons and len(trial.tendons) < len(tendons):
        expected = f"expected all of the model: {', '.join(tendons)}; slack ones as let out"
        used = f"found {', '.join(trial.tendons)} alone"
        raise InputError(f"session.yaml: tendons: trial {trial.name}: {used}, {expected}")


def check_sides(trial: Trial, model: mujoco.MjModel) -> None:
    """Refuse a trial in which the arm bends to another side than that of the tendons that are wound.

    At the frame with the deepest pull, the model's tendons are threaded through the pose that was measured, which
    needs no model of forces: how much each is shorter than at the start is compared with how much each was wound.
    """
    tendons = [model.tendon(name).id for name in trial.tendons]
    start = start_frames(trial)[1]
    taken_in = np.maximum(trial.commands, 0)
    wound = taken_in - taken_in[start]
    enough = trial.measured.mean(axis=1) >= MEASURED_SHARE
    deepest = int(np.argmax(np.where(enough, wound.max(axis=1), -np.inf)))
    pulls = wound[deepest]
    shorter = (_path_lengths(trial, model, start) - _path_lengths(trial, model, deepest))[tendons]
    least = WOUND if trial.command_unit == LENGTH else PULLED[trial.command_unit]
    if np.ptp(pulls) < least or np.ptp(shorter) < WOUND:
        return
    agreement, best = _agreement(pulls, shorter), _agreement(np.sort(pulls), np.sort(shorter))
    if agreement >= ALIKE * best:
        return
    most, bent = trial.tendons[int(np.argmax(pulls))], trial.tendons[int(np.argmax(shorter))]
    by = f"wound by {1e3 * pulls.max():.0f} mm" if trial.command_unit == LENGTH else f"pulled by {pulls.max():.3g} N"
    fault = f"found {most!r} {by} while the arm bends to the side of {bent!r}"
    raise InputError(
        f"session.yaml: tendons: trial {trial.name}: {fault}, expected it to bend to the side of what is wound: "
        "are names exchanged, signs reversed, is the base body turned about the arm, or the frame left-handed?"
    )


def check_lengths(trials: list[Trial], model: mujoco.MjModel) -> None:
    """Refuse trials in which tendons are longer than commanded by far, and other tendons are not.

    A tendon may be slack, but is hardly longer than its motor lets it be, whatever else bends the arm: gravity, other
    tendons, its own momentum. By how much each would be stretched in all is compared with what is left if names are
    exchanged in the best way; tendons that all pull against each other leave the same with any names. Where two are let
    out by nearly the same, guide holes that are askew look like an exchange too: what is not clear in a trial must not
    be refuted by the others. Nothing is known of trials in no frame of which enough is measured.
    """
    trials = [trial for trial in trials if len(_seen_frames(trial))]
    stretches = [_stretch(trial, model) for trial in trials]
    for trial, (stretch, mirrored, deepest) in zip(trials, stretches, strict=True):
        exchange = linear_sum_assignment(stretch)
        named, best = np.trace(stretch), stretch[exchange].sum()
        if named - best < max(STRETCH, SHARE * deepest) or best >= SHORTER * named:
            continue
        alike = [other for t, (other, _, _) in zip(trials, stretches, strict=True) if t.tendons == trial.tendons]
        if named - best < CLEAR * deepest and sum(np.trace(other) - other[exchange].sum() for other in alike) <= 0:
            continue
        worst = int(np.argmax(np.diag(stretch)))
        fault = f"found the path of {trial.tendons[worst]!r} {1e3 * stretch[worst, worst]:.0f} mm longer than commanded"
        cause = "signs reversed" if mirrored < best else "names exchanged"
        raise InputError(
            f"session.yaml: tendons: trial {trial.name}: {fault}, which fits with {cause}, expected a tendon to be "
            "slack or about as long as its command: are names exchanged, signs reversed, is the base body turned about "
            "the arm, or the frame left-handed?"
        )


def _seen_frames(trial: Trial) -> np.ndarray:
    """Frames in which enough markers are measured for a pose."""
    return np.flatnonzero(trial.measured.mean(axis=1) >= MEASURED_SHARE)


def _stretch(trial: Trial, model: mujoco.MjModel) -> tuple[np.ndarray, float, float]:
    """By how much each path is longer than each tendon's command lets it be, m (K commands, K paths), in the mean over
    frames; of all paths, if commands had the other sign; and the deepest pull, in the mean too.

    The model's tendons are threaded through poses that were measured.
    """
    measured = _seen_frames(trial)
    frames = measured[:: max(len(measured) // PLACES, 1)]
    tendons = [model.tendon(name).id for name in trial.tendons]
    shorter = np.array([model.tendon_length0 - _path_lengths(trial, model, frame) for frame in frames])[:, tendons]
    commands = trial.commands[frames]
    stretch = np.maximum(commands[:, :, None] - shorter[:, None, :], 0).mean(axis=0)
    mirrored = float(np.maximum(-commands - shorter, 0).mean(axis=0).sum())
    return stretch, mirrored, float(commands.max(axis=1).mean())


def check_scales(trials: list[Trial], model: mujoco.MjModel) -> None:
    """Refuse trials whose tendons' paths are shorter by much less or much more than the pulls that are commanded.

    So are those of commands, and of measured positions with them, that have the sign reversed or are in another unit.
    """
    off = {trial.name: scale for trial in trials if (scale := path_scale(trial, model)) is not None}
    if not off:
        return
    names, scales = list(off), sorted(off.values())
    who = f"trial{'s' if len(names) > 1 else ''} {', '.join(names[:NAMED])}"
    who += f" and {len(names) - NAMED} more" if len(names) > NAMED else ""
    by = " to ".join(dict.fromkeys(f"{scale:.3g}" for scale in (scales[0], scales[-1])))
    raise InputError(
        f"session.yaml: tendons: {who}: found paths that are shorter by {by} times the pulls that are commanded, "
        f"expected {SHORTEST:g} to {LONGEST:g} times: are signs reversed, are commands in another unit than m, or is "
        "the model of another arm?"
    )


def path_scale(trial: Trial, model: mujoco.MjModel) -> float | None:
    """By how many times its deep pulls the paths of a trial's tendons are shorter, if that cannot be; else None.

    The model's tendons are threaded through poses that were measured, and ratios over deep pulls have a median. A path
    is longer than commanded only if it is longer than by all commands shortly before and after, and shorter likewise.
    Of a trial with a level, which says how deep pulls are, only too short paths are of interest: a weak motor may not
    reach it. Where gravity bends the arm by itself, slack tendons have any shorter path.
    """
    pulls = np.maximum(trial.commands, 0)
    step = float(np.median(np.diff(trial.time))) if len(trial.time) > 1 else np.inf
    width = 2 * int(APART / step) + 1
    low, high = minimum_filter1d(pulls, width, axis=0), maximum_filter1d(pulls, width, axis=0)
    enough = trial.measured.mean(axis=1) >= MEASURED_SHARE
    deepest = np.where(enough, low.max(axis=1), 0.0)
    deep_frames = np.flatnonzero(enough & (deepest > 0) & (deepest >= deepest.max() / 2))
    if not len(deep_frames):
        return None
    frames = deep_frames[:: -(-len(deep_frames) // HELD_FRAMES)]
    tendons = [model.tendon(name).id for name in trial.tendons]
    shorter = np.array([model.tendon_length0 - _path_lengths(trial, model, frame) for frame in frames])[:, tendons]

    def compared(commanded: np.ndarray) -> tuple[float, float]:
        """Paths over the deep pulls of `asked` (N, K), and how much deeper those are, m; medians."""
        deep = commanded >= commanded.max() / 2
        return float(np.median(shorter[deep] / commanded[deep])), float(np.median(commanded[deep] - shorter[deep]))

    ratio, deeper = compared(low[frames])
    if EXPERIMENTS[trial.experiment].level is None and ratio < SHORTEST and deeper > OFF:
        return ratio
    ratio, deeper = compared(high[frames])
    if ratio > LONGEST and -deeper > OFF and tilt_of_gravity(trial.gravity) < UPRIGHT:
        return ratio
    return None


def _agreement(pulls: np.ndarray, shorter: np.ndarray) -> float:
    return float((pulls - pulls.mean()) @ (shorter - shorter.mean()))


def _path_lengths(trial: Trial, model: mujoco.MjModel, frame: int) -> np.ndarray:
    """Of the model's tendons through the pose of a frame, m. Shape (nt,)."""
    data = mujoco.MjData(model)
    pose = fit_pose(model, trial.markers, *measured_pose(trial, frame)).qpos
    data.qpos[: len(pose)] = pose
    mujoco.mj_kinematics(model, data)
    mujoco.mj_comPos(model, data)
    mujoco.mj_tendon(model, data)
    return data.ten_length.copy()
