"""The score of one trial for each monitored parameter, to first order and without a fit.

The residuals r of a trial against the model and their derivatives J by the parameters give the score Jᵀr. By how much
one parameter alone would have to change is d = -Jᵀr / JᵀJ, one step of Gauss and Newton from the model (a one-step
estimate: van der Vaart, Asymptotic Statistics, 1998, section 5.7). A mean error of positions sees 5 % of stiffness
badly; d looks only along the direction in which stiffness moves the arm.
"""

from dataclasses import dataclass

import mujoco
import numpy as np

from trunkline.errors import InputError
from trunkline.identification.fit.linearisation import linearise
from trunkline.identification.fit.problem import Bounds, Problem
from trunkline.identification.parameters.parameters import parameter_named
from trunkline.identification.simulate.experiment import prepare
from trunkline.identification.simulate.loss import Loss
from trunkline.recordings.trials.experiments import EXPERIMENTS
from trunkline.recordings.trials.trial import Trial

# what ages, slackens, wears or is knocked; one that the arm lacks is left out
WATCHED = (
    "stiffness", "damping", "kp", "capstan_friction", "tendon_friction",
    "mount_tilt_x", "mount_tilt_y", "rest_bend_x", "rest_bend_y",
)  # fmt: skip
AROUND = 3.0  # times a value, and rad of a signed one, within which differences are taken


@dataclass(frozen=True, eq=False)
class Score:
    """slope: Jᵀr, shape (P,). curvature: JᵀJ, (P, P). Both 0 for parameters that this kind of trial does not identify.

    condition: trials of which are done alike: kind, level and load.
    """

    name: str
    kind: str
    level: float | None
    load: float
    slope: np.ndarray
    curvature: np.ndarray

    @property
    def condition(self) -> tuple[str, float | None, float]:
        return self.kind, self.level, self.load

    @property
    def information(self) -> np.ndarray:
        """That on each parameter if all others are known. Shape (P,)."""
        return np.diag(self.curvature)

    @property
    def estimates(self) -> np.ndarray:
        """d, the change of each parameter alone, where it is searched (of ln(value), or of a signed value over its
        scale); NaN where the trial does not identify it. Shape (P,)."""
        with np.errstate(invalid="ignore", divide="ignore"):
            return np.where(self.information > 0, -self.slope / self.information, np.nan)


@dataclass(frozen=True)
class Scorer:
    """Scores trials against `model`. parameters: P names. frames: of each trial, at most. command_delay: s."""

    model: mujoco.MjModel
    parameters: tuple[str, ...]
    loss: Loss
    frames: int
    command_delay: float

    def score(self, trial: Trial) -> Score:
        """Raises InputError where the trial is not of this arm, or the model does not survive it."""
        kind = EXPERIMENTS[trial.experiment]
        determined = [i for i, name in enumerate(self.parameters) if parameter_named(name).identifiable_from(kind)]
        experiment = prepare(trial, self.model, self.frames, self.command_delay)
        slope, curvature = np.zeros(len(self.parameters)), np.zeros((len(self.parameters),) * 2)
        if determined:
            bounds = {self.parameters[i]: _around(self.parameters[i], self.model) for i in determined}
            problem = Problem(self.model, [experiment], trial.markers, bounds, self.loss.kind, self.loss)
            linear = linearise(problem, problem.start())
            if problem.diverged:
                raise InputError(f"trial {trial.name}: the model does not survive it, expected one that stays together")
            jacobian = linear.jacobians[0]
            slope[determined] = jacobian.T @ linear.residuals[0]
            curvature[np.ix_(determined, determined)] = jacobian.T @ jacobian
        return Score(trial.name, trial.experiment, trial.level, trial.load, slope, curvature)


def watched_in(model: mujoco.MjModel, names: tuple[str, ...] = WATCHED) -> tuple[str, ...]:
    """Those of `names` that the arm has."""
    return tuple(name for name in names if parameter_named(name).belongs_to(model) and _present(name, model))


def _present(name: str, model: mujoco.MjModel) -> bool:
    return parameter_named(name).signed or parameter_named(name).read(model) > 0


def _around(name: str, model: mujoco.MjModel) -> Bounds:
    parameter = parameter_named(name)
    value = parameter.read(model)
    return Bounds(value - AROUND, value + AROUND) if parameter.signed else Bounds(value / AROUND, value * AROUND)
