"""Whether trials are of this arm: its segments, its tendons, and every tendon where its name says."""

import mujoco
import numpy as np

from trunkline.errors import InputError
from trunkline.identification.experiment import SEEN_SHARE, check_names, measured_pose, start_frames
from trunkline.identification.pose_fit import fit_pose
from trunkline.trials.trial import Trial

WOUND = 5e-3  # m, from which on a tendon counts as wound, and the arm as bent by it
ALIKE = 0.5  # of how well pulls and path lengths agree at best; two of three tendons exchanged: -0.5, out of six: 0.5


def check_trials(trials: list[Trial], model: mujoco.MjModel) -> None:
    """Refuse trials whose names are not those of the model, and then those that bend to the side of other tendons.

    Raises:
        InputError: naming the key of session.yaml, the trial, what was found and what was expected.
    """
    for trial in trials:
        check_names(trial, model)
    for trial in trials:
        if trial.tendons:
            check_sides(trial, model)


def check_sides(trial: Trial, model: mujoco.MjModel) -> None:
    """Refuse a trial in which the arm bends to another side than that of the tendons that are wound.

    At the frame with the deepest pull, the model's tendons are threaded through the pose that was measured, which
    needs no model of forces: how much each is shorter than at the start is compared with how much each was wound.
    """
    tendons = [model.tendon(name).id for name in trial.tendons]
    start = start_frames(trial)[1]
    taken_in = np.maximum(trial.commands, 0)
    wound = taken_in - taken_in[start]
    seen = trial.measured.mean(axis=1) >= SEEN_SHARE
    deepest = int(np.argmax(np.where(seen, wound.max(axis=1), -np.inf)))
    pulls = wound[deepest]
    shorter = (_path_lengths(trial, model, start) - _path_lengths(trial, model, deepest))[tendons]
    if min(np.ptp(pulls), np.ptp(shorter)) < WOUND:
        return
    agreement, best = _agreement(pulls, shorter), _agreement(np.sort(pulls), np.sort(shorter))
    if agreement >= ALIKE * best:
        return
    most, bent = trial.tendons[int(np.argmax(pulls))], trial.tendons[int(np.argmax(shorter))]
    found = f"found {most!r} wound by {1e3 * pulls.max():.0f} mm while the arm bends to the side of {bent!r}"
    raise InputError(
        f"session.yaml: tendons: trial {trial.name}: {found}, expected it to bend to the side of what is wound: "
        "are names exchanged, signs reversed, or is the base body turned about the arm?"
    )


def _agreement(pulls: np.ndarray, shorter: np.ndarray) -> float:
    return float((pulls - pulls.mean()) @ (shorter - shorter.mean()))


def _path_lengths(trial: Trial, model: mujoco.MjModel, frame: int) -> np.ndarray:
    """Of the model's tendons through the pose of a frame, m. Shape (nt,)."""
    data = mujoco.MjData(model)
    pose = fit_pose(model, trial.segments, *measured_pose(trial, frame)).qpos
    data.qpos[: len(pose)] = pose
    mujoco.mj_kinematics(model, data)
    mujoco.mj_comPos(model, data)
    mujoco.mj_tendon(model, data)
    return data.ten_length.copy()
