"""What a model's errors are compared with: baselines without forces, and the floor that noise leaves.

A model whose errors are not far below those of the baselines has learnt nothing; one whose errors are near the noise
floor has nothing left to learn from these trials. In metrics.json the baselines are the null models.
"""

from dataclasses import replace

import mujoco
import numpy as np

from trunkline.identification.evaluation.evaluation import Prediction, Replay, marker_positions
from trunkline.identification.parameters.per_session import model_in
from trunkline.identification.simulate.experiment import Experiment, arm_in
from trunkline.identification.simulate.pose_fit import fit_pose, measured_pose, start_frames
from trunkline.recordings.trials.experiments import is_static, is_stepwise
from trunkline.recordings.trials.splits import IDENTIFY
from trunkline.recordings.trials.trial import Trial

FLOOR_POSES = 12  # frames of each trial, at most, in which the noise floor is taken where no setting says


def references(
    trials: list[Trial],
    experiments: list[Experiment],
    model: mujoco.MjModel,
    like: Replay,
    ended: list[Experiment] | None = None,
    floor_poses: int = FLOOR_POSES,
) -> dict[str, Prediction]:
    """The baselines and the noise floor, by their names in metrics.json.

    Args:
        trials, experiments: the same ones, in the same order.
        model: whose joint angles are fitted to measured poses. like: its replay, for the arm's length and tip.
        ended: from whose ends the mean shape at rest is; None for `experiments` themselves.
        floor_poses: of each trial, at most, in which the noise floor is taken.
    """
    baselines = {
        "null": Prediction(hanging_still(experiments, like, ended or experiments), experiments),
        "null_straight": Prediction(straight(experiments, like), experiments),
        "null_held": start_pose(trials, experiments, model, like),
        "noise_floor": noise_floor(trials, experiments, model, like, floor_poses),
    }
    return {name: prediction for name, prediction in baselines.items() if prediction.experiments}


def hanging_still(experiments: list[Experiment], like: Replay, ended: list[Experiment]) -> Replay:
    """Every trial as the mean shape at rest, from the first frame to the last.

    The shape is the mean over those trials of `ended` of the same kind to identify from, of where each marker was
    measured last: in a static tilt its mean place, after a release or a curl where the arm came to rest. A kind of
    which there is none to identify from takes the mean over all kinds, a session without any the mean over all trials.

    Args:
        like: a model's replay of the same experiments, for the arm's length and tip.
    """
    fitted = [e for e in ended if e.split == IDENTIFY] or ended
    positions = []
    for experiment in experiments:
        same = [e for e in fitted if e.kind == experiment.kind] or fitted
        same = [e for e in same if e.session == experiment.session] or same
        shape = np.nanmean([_last_shape(e) for e in same], axis=0)
        positions.append(np.broadcast_to(shape, experiment.positions.shape))
    return replace(like, positions=positions)


def straight(experiments: list[Experiment], like: Replay) -> Replay:
    """Every trial as the straight arm."""
    return replace(like, positions=[np.broadcast_to(like.straight, e.positions.shape) for e in experiments])


def start_pose(trials: list[Trial], experiments: list[Experiment], model: mujoco.MjModel, like: Replay) -> Prediction:
    """Every trial as the pose in which its simulation starts: the last frame before the comparison, held.

    Trials at rest are left out: their start is fitted to the very frame that is compared.
    """
    pairs = [(trial, e) for trial, e in zip(trials, experiments, strict=True) if not is_static(e.kind)]
    shapes = [marker_positions(model_in(trial.session, model), trial.markers, e.start) for trial, e in pairs]
    positions = [np.broadcast_to(shape, e.positions.shape) for shape, (_, e) in zip(shapes, pairs, strict=True)]
    return Prediction(replace(like, positions=positions), [e for _, e in pairs])


def noise_floor(
    trials: list[Trial], experiments: list[Experiment], model: mujoco.MjModel, like: Replay, poses: int = FLOOR_POSES
) -> Prediction:
    """What noise and pose fit alone leave of every trial, in `poses` of its frames at most, evenly spread.

    Joint angles are fitted to the measured markers of each, as for the pose from which a simulation starts. What
    remains is measurement noise that the low-pass left, what the smoothing of the pose fit takes from a sharp bend,
    and what no pose of this model can be. A simulation that is right in everything else is not expected to come
    nearer, though it may: the fit also weighs orientations and smoothness. These frames have no rate of change.
    """
    floors = [_floor(trial, e, model, poses) for trial, e in zip(trials, experiments, strict=True)]
    return Prediction(replace(like, positions=[positions for _, positions in floors]), [e for e, _ in floors])


def _floor(trial: Trial, experiment: Experiment, model: mujoco.MjModel, count: int) -> tuple[Experiment, np.ndarray]:
    first = 0 if is_static(trial.experiment) else start_frames(trial)[0] + 1
    measured = np.flatnonzero(experiment.measured.any(axis=1))
    frames = measured[np.linspace(0, len(measured) - 1, min(count, len(measured))).round().astype(int)]
    parts = {name: getattr(experiment, name)[frames] for name in ("controls", "positions", "measured")}
    shapes = []
    for frame in first + frames:
        arm = arm_in(trial, model, frame)
        qpos = fit_pose(arm, trial.markers, *measured_pose(trial, frame)).qpos
        shapes.append(marker_positions(arm, trial.markers, qpos))
    return replace(experiment, frame_step=0.0, **parts), np.array(shapes)


def _last_shape(experiment: Experiment) -> np.ndarray:
    """Where each marker was measured last, of shapes at rest that follow each other their mean, m; nan where it never
    was. Shape (S, 3)."""
    if is_stepwise(experiment.kind):
        return np.nanmean(np.where(experiment.measured[..., None], experiment.positions, np.nan), axis=0)
    frames, markers = experiment.measured.shape
    last = frames - 1 - np.argmax(experiment.measured[::-1], axis=0)
    shape = experiment.positions[last, np.arange(markers)]
    never = ~np.logical_or.reduce(experiment.measured, axis=0)
    return np.where(never[:, None], np.nan, shape)
