"""How identifiable each stage's parameters are, before any fit: the residuals to first order, around the CAD model.

With a model that is off by a share s of each point's distance from the base, the same way throughout a trial, T trials
count as `NUMBERS` T independent numbers, and the covariance of the estimate is s² (JᵀJ)⁻¹ / (NUMBERS T), J the
Jacobian of the loss' residuals, whose squares sum to a mean over trials. That is a guess of the size, good for what is
left open; after a fit, the jackknife of `identification.certainty` estimates it from the residuals of the trials.
"""

from dataclasses import dataclass

import mujoco
import numpy as np

from trunkline.identification.evaluation.baselines import straight
from trunkline.identification.evaluation.evaluation import Prediction, replay
from trunkline.identification.fit.fit import Fit
from trunkline.identification.fit.linearisation import linearise
from trunkline.identification.fit.settings import IdentificationSettings
from trunkline.identification.fit.setup import set_up, with_every
from trunkline.identification.parameters.parameters import parameter_named
from trunkline.identification.simulate.experiment import Experiment
from trunkline.recordings.trials.experiments import EXPERIMENTS, is_static
from trunkline.recordings.trials.splits import IDENTIFY
from trunkline.recordings.trials.trial import Trial

NUMBERS = 3  # independent numbers that a trial counts as
FRAMES = 180  # of a moving trial that are looked at
TWO_SIDED = 1.96
ALIKE = 0.95  # correlation of two estimates, from which on trials tell hardly more than one of them


@dataclass
class Identifiability:
    """How identifiable a parameter is.

    half_width: of its expected 95 % interval, where it is searched: of its logarithm, or over the scale of a signed
        one; infinite if it shows in no trial. share: that over half of its range; 1 leaves it open.
    """

    name: str
    half_width: float
    share: float

    def words(self) -> str:
        parameter = parameter_named(self.name)
        if not np.isfinite(self.share):
            return f"{self.name} shows in no trial"
        if self.share >= 1:
            return f"{self.name} stays undetermined within its range"
        if parameter.signed:
            return f"{self.name} to ± {self.half_width * parameter.scale:.2g} {parameter.unit}".rstrip()
        return f"{self.name} to within a factor of {np.exp(self.half_width):.2f}"


def expected_identifiability(
    model: mujoco.MjModel, experiments: list[Experiment], fit: Fit, share: float
) -> tuple[list[Identifiability], list[str]]:
    """How identifiable a stage's parameters are from its trials, and which pairs are nearly confounded, in words.

    Args:
        model, experiments, fit: as `to_identify_from` gives them.
        share: by which the fitted model will be off, of a point's distance from the base.
    """
    problem = fit.problem(model, experiments)
    normal = linearise(problem, problem.start()).normals().sum(axis=0)
    scale = 1 / np.sqrt(np.where(np.diag(normal) > 0, np.diag(normal), np.inf))
    inverse = np.linalg.pinv(normal * np.outer(scale, scale), rcond=1e-12, hermitian=True)
    spread = np.sqrt(np.diag(inverse))
    half = TWO_SIDED * share / np.sqrt(NUMBERS * len(experiments)) * np.where(scale > 0, spread * scale, np.inf)
    low, high = problem.bounds()
    names = list(fit.parameters)
    shares = half / (0.5 * (high - low))
    parameters = [Identifiability(name, *row) for name, *row in zip(names, half, shares, strict=True)]
    alike = inverse / np.maximum(np.outer(spread, spread), 1e-300)
    pairs = [
        f"{names[i]} and {names[j]} {'rise together' if alike[i, j] > 0 else 'trade off'}"
        for i, j in zip(*np.triu_indices(len(names), 1), strict=True)
        if abs(alike[i, j]) > ALIKE
    ]
    return parameters, pairs


def described_lines(model: mujoco.MjModel, experiments: list[Experiment], fit: Fit) -> list[str]:
    """How far the model to begin with is from a stage's trials, beside a straight arm; and what to look at where it is
    no nearer.

    A released arm swings about its straight shape, and the described one with a guess of damping: that a straight arm
    is nearer to a release does not mean that anything is described wrongly.
    """
    replayed = replay(model, experiments, fit.markers)
    described, plain = (Prediction(simulated, experiments) for simulated in (replayed, straight(experiments, replayed)))
    off, still = described.overall(), plain.overall()
    description = f"as described, it is {off['e_position_mm']:.3g} mm off ({off['e_position_pct']:.2g} % of length)"
    lines = [f"{description}, a straight arm {still['e_position_mm']:.3g} mm"]
    bent = [e for e in experiments if _stays_bent(e)]
    if bent:
        mine, its = (prediction.of(_stays_bent) for prediction in (described, plain))
        if mine.overall()["e_position_mm"] >= its.overall()["e_position_mm"]:
            lines.append(f"no nearer than a straight arm: look at {_doubtful(model, bent)}")
    return lines


def _stays_bent(experiment: Experiment) -> bool:
    return not EXPERIMENTS[experiment.kind].hangs


def _doubtful(model: mujoco.MjModel, bent: list[Experiment]) -> str:
    """What may be wrong of the arm and the session, by what bends the arm in these trials."""
    parts = ["`up`", "the masses"] if any(e.gravity.any() for e in bent) else []
    if model.nu and any(EXPERIMENTS[e.kind].needs_motors for e in bent):
        parts.append("which motor pulls which tendon")
    parts = parts or ["the pose of the base"]
    return ", ".join(parts[:-1]) + (" and " if len(parts) > 1 else "") + parts[-1]


def to_identify_from(
    config: IdentificationSettings, model: mujoco.MjModel, trials: list[Trial]
) -> tuple[mujoco.MjModel, list[Experiment], Fit]:
    """As `set_up`, of the trials to identify from alone, which must be there; moving ones by their beginning."""
    config = with_every(config, model)
    used = [trial for trial in trials if trial.experiment in config.experiments and trial.split == IDENTIFY]
    model, experiments, fit = set_up(config, used, model)
    return model, [e if is_static(e.kind) else e.shortened(FRAMES) for e in experiments], fit


def unidentifiable(config: IdentificationSettings, trials: list[Trial]) -> list[str]:
    """Why a stage has nothing to identify from, a sentence each."""
    kinds = {trial.experiment for trial in trials if trial.split == IDENTIFY}
    lines = []
    for kind in config.experiments:
        if kind not in kinds:
            way_out = EXPERIMENTS[kind].without
            lines.append(f"no {kind} of the split identify" + (f": {way_out}" if way_out else ""))
    return lines
