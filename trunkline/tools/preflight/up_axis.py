"""Whether the described arm fits the trials much better with another axis of the cameras' frame up."""

from dataclasses import replace

import mujoco
import numpy as np

from trunkline.identification.evaluation.baselines import straight
from trunkline.identification.evaluation.evaluation import Prediction, replay
from trunkline.identification.simulate.experiment import Experiment
from trunkline.recordings.cleaning.gravity_direction import AXES
from trunkline.recordings.signals.base_frame import average_base, gravity_from_up
from trunkline.recordings.trials.raw_trial import RawTrial

Z = np.array([0.0, 0.0, 1.0])
TRIED = 6  # trials, at most
BETTER = 2.0  # times that the described arm must fit with another axis up before that is said


def other_ups(raw_trials: list[RawTrial]) -> dict[str, np.ndarray]:
    """Gravity in the base frame (6, 3), m/s², by trial, as it is with each of `AXES` up; none of trials that have no
    gravity, or whose base is upright by its very declaration, and none of several sessions, which each have an `up`."""
    if len({raw.session for raw in raw_trials}) > 1:
        return {}
    gravities = {}
    for raw in raw_trials:
        base = average_base(raw.base_positions, raw.base_quaternions)
        declared = not np.ptp(raw.base_quaternions, axis=0).any() and np.allclose(base.rotation.apply(Z), raw.up)
        if raw.up.any() and not declared:
            gravities[raw.name] = np.array([gravity_from_up(base, axis) for axis in AXES])
    return gravities


def up_lines(
    model: mujoco.MjModel, experiments: list[Experiment], markers: tuple[str, ...], ups: dict[str, np.ndarray]
) -> list[str]:
    """The axis with which the described arm is much nearer to some of the trials than with the one that is declared,
    and than a straight arm; none where there is no such axis.

    Args:
        ups: as `other_ups` gives it.
    """
    tried = [experiment for experiment in experiments if experiment.name in ups]
    tried = tried[:: -(-len(tried) // TRIED) or 1]
    if not tried:
        return []

    def error(prediction: Prediction) -> float:
        return prediction.overall()["e_position_mm"]

    declared = replay(model, tried, markers)
    off, still = (error(Prediction(replayed, tried)) for replayed in (declared, straight(tried, declared)))
    errors = []
    for number in range(len(AXES)):
        turned = [replace(experiment, gravity=ups[experiment.name][number]) for experiment in tried]
        errors.append(error(Prediction(replay(model, turned, markers), turned)))
    best = int(np.argmin(errors))
    if errors[best] > min(off, still) / BETTER:
        return []
    axis = ", ".join(f"{value + 0.0:g}" for value in AXES[best])
    fit = f"{errors[best]:.3g} mm off in place of {off:.3g} mm, over {len(tried)} of the trials"
    return [f"`frame.up` in session.yaml: [{axis}] would fit better: {fit}"]
