"""Whether the described arm fits the trials much better with other motors, or another axis of the cameras' frame up."""

from dataclasses import replace

import mujoco
import numpy as np

from trunkline.identification.evaluation.baselines import straight
from trunkline.identification.evaluation.evaluation import Prediction, replay
from trunkline.identification.fit.identify import with_parameters
from trunkline.identification.parameters.parameters import parameter_named
from trunkline.identification.simulate.experiment import Experiment
from trunkline.model.arm_model import ArmModel
from trunkline.recordings.cleaning.gravity_direction import AXES, possible_axes
from trunkline.recordings.signals.base_frame import average_base, gravity_from_up
from trunkline.recordings.trials.experiments import EXPERIMENTS
from trunkline.recordings.trials.raw_trial import RawTrial

Z = np.array([0.0, 0.0, 1.0])
TRIED = 6  # trials, at most
GAINS = (0.1, 0.2, 0.5, 2.0, 5.0, 10.0)  # times the described `kp`, that are tried
BETTER = 2.0  # times that the described arm must fit with another axis up before that is said


def other_ups(raw_trials: list[RawTrial]) -> dict[str, np.ndarray]:
    """Gravity in the base frame (6, 3), m/s², by trial, as it is with each of `AXES` up, NaN with one that levels of
    tilts or ends of releases exclude; none of trials that have no
    gravity, or whose base is upright by its very declaration, and none of several sessions, which each have an `up`."""
    if len({raw.session for raw in raw_trials}) > 1:
        return {}
    gravities, possible = {}, possible_axes(raw_trials)
    for raw in raw_trials:
        base = average_base(raw.base_positions, raw.base_quaternions)
        declared = not np.ptp(raw.base_quaternions, axis=0).any() and np.allclose(base.rotation.apply(Z), raw.up)
        if raw.up.any() and not declared:
            gravities[raw.name] = np.array([gravity_from_up(base, axis) for axis in AXES])
            gravities[raw.name][~possible] = np.nan
    return gravities


def up_lines(
    model: mujoco.MjModel, experiments: list[Experiment], markers: tuple[str, ...], ups: dict[str, np.ndarray]
) -> list[str]:
    """The axis with which the described arm is much nearer to some of the trials than with the one that is declared,
    and than a straight arm; none where there is no such axis.

    Where motors pull, another gain of theirs is tried first, as most guesses are of that.

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
    lengths = ArmModel(model).commands == "length"  # else motors have no gain
    if lengths and any(EXPERIMENTS[experiment.kind].needs_motors for experiment in tried):
        guess, by_gain = parameter_named("kp").read(model), {}
        for factor in GAINS:
            geared = with_parameters(model, {"kp": factor * guess})
            by_gain[factor] = error(Prediction(replay(geared, tried, markers), tried))
        nearest = min(by_gain, key=by_gain.__getitem__)
        if by_gain[nearest] <= min(off, still) / BETTER:
            fit = f"{by_gain[nearest]:.3g} mm off in place of {off:.3g} mm, over {len(tried)} of the trials"
            return [f"`kp` of {nearest:g} times the described {guess:g} N/m would fit better: {fit}"]
        off = min(off, by_gain[nearest])
    errors = []
    for number in range(len(AXES)):
        if np.isnan([ups[experiment.name][number] for experiment in tried]).any():
            errors.append(np.inf)
            continue
        turned = [replace(experiment, gravity=ups[experiment.name][number]) for experiment in tried]
        errors.append(error(Prediction(replay(model, turned, markers), turned)))
    best = int(np.argmin(errors))
    if errors[best] > min(off, still) / BETTER:
        return []
    axis = ", ".join(f"{value + 0.0:g}" for value in AXES[best])
    fit = f"{errors[best]:.3g} mm off in place of {off:.3g} mm, over {len(tried)} of the trials"
    return [f"`frame.up` in session.yaml: [{axis}] would fit better: {fit}"]
