"""The Fisher information of trials, recorded or not, for the parameters that a stage identifies.

With residuals r_t(z) of a trial as the stage's loss has them (½ Σ r² is the trial's loss), J_t = ∂r_t/∂z, and a model
that is off by a share s of each point's distance from the base, the information of a trial is

    M_t = (NUMBERS / s²) J_tᵀ J_t,

which is `trunkline.identification.diagnostics.identifiability` by the trial: over T trials Σ M_t is the inverse of its
s² (JᵀJ)⁻¹ / (NUMBERS T). Trials are independent, so information adds. Where motors hold the arm at rest, friction holds
it anywhere in a band, in whose middle the twin has it: there s² is more by the variance of a rectangular distribution
over that band. All of it is of u = (z - middle) / half, z over half of its range: the `share` of `Identifiability`.
"""

from dataclasses import dataclass, replace

import mujoco
import numpy as np

from trunkline.identification.diagnostics.identifiability import NUMBERS, TWO_SIDED, Identifiability
from trunkline.identification.fit.fit import Fit
from trunkline.identification.fit.linearisation import linearise
from trunkline.identification.fit.settings import IdentificationSettings
from trunkline.identification.fit.setup import fit_of, set_up, with_every
from trunkline.identification.simulate.experiment import Experiment
from trunkline.model.arm_model import ArmModel
from trunkline.recordings.trials.experiments import EXPERIMENTS, is_static
from trunkline.recordings.trials.splits import IDENTIFY
from trunkline.recordings.trials.trial import Trial
from trunkline.report.certificate.arms import arm_of
from trunkline.report.certificate.poses import StaticPoses
from trunkline.tools.suggest.candidates import Candidate
from trunkline.tools.suggest.settings import Recordable
from trunkline.tools.suggest.simulated import simulated

PRIOR = 3.0  # information of "somewhere within its range": the variance of an even distribution over ±1 is 1/3
FRAMES = 120  # of a moving trial that are looked at, recorded or not
SAME = 0.02  # of a point's distance from the base, within which a candidate is a trial that there is


@dataclass
class StageInformation:
    """The information that a stage has on its P parameters, and that candidates would add, in u.

    stage: its name. names: of the parameters. half: of each range, on the axis
    that is searched. Shape (P,). recorded: information of the trials that there are and of the ranges. Shape (P, P).
    added: by name of a candidate, its information. Each (P, P). repeated: candidates that the session holds.
    """

    stage: str
    names: list[str]
    half: np.ndarray
    recorded: np.ndarray
    added: dict[str, np.ndarray]
    repeated: set[str]

    def covariance(self, chosen: list[str]) -> np.ndarray:
        """Of u, once the candidates `chosen` are recorded; those of other kinds add nothing. (P, P)."""
        return np.linalg.inv(self.recorded + sum((self.added[name] for name in chosen if name in self.added), 0.0))

    def identifiability(self, chosen: list[str]) -> list[Identifiability]:
        """How well each parameter will be identified, as `expected_identifiability` has it."""
        shares = TWO_SIDED * np.sqrt(np.diag(self.covariance(chosen)))
        return [Identifiability(*row) for row in zip(self.names, shares * self.half, shares, strict=True)]


def information(fit: Fit, model: mujoco.MjModel, experiments: list[Experiment], share: float) -> np.ndarray:
    """M_t in u of every trial, around the parameters of `model`. Shape (T, P, P).

    Of one without which the others would be told, as a step of a parameter makes the arm leave the physics in it,
    nothing.
    """
    count = len(experiments)
    if not count:
        return np.zeros((0, len(fit.parameters), len(fit.parameters)))
    problem = replace(fit.problem(model, experiments), trial_weights=np.full(count, float(count)))
    normals = linearise(problem, problem.start()).normals()
    if problem.diverged and count > 1:
        parts = experiments[: count // 2], experiments[count // 2 :]
        return np.concatenate([information(fit, model, part, share) for part in parts])
    low, high = problem.bounds()
    half = 0.5 * (high - low)
    off = shares_of(model, experiments, share)[:, None, None]
    return (not problem.diverged) * normals * np.outer(half, half) * NUMBERS / off**2


def shares_of(model: mujoco.MjModel, experiments: list[Experiment], share: float) -> np.ndarray:
    """By which the fitted model will be off in each trial, of a point's distance from the base: `share`, and with it
    half the band in which friction holds the arm, where motors pull at rest. Of the tip's distance that is the more the
    nearer a point is to the tip, so the tip's is taken over √3, the root mean square of 0 to 1. Shape (T,)."""
    shares = np.full(len(experiments), share)
    pulled = [i for i, e in enumerate(experiments) if is_static(e.kind) and not e.slack(model)]
    if pulled:
        order = ArmModel(model).actuators
        commands = np.array([experiments[i].controls[-1][order] for i in pulled])
        bands = arm_of(model).friction(StaticPoses(np.array([experiments[i].gravity for i in pulled]), commands))
        tips = np.array([np.linalg.norm(experiments[i].positions[-1], axis=1).max() for i in pulled])
        shares[pulled] = np.hypot(share, np.linalg.norm(bands, axis=1) / 3 / tips)
    return shares


def stage_information(
    stage: str, config: IdentificationSettings, model: mujoco.MjModel, trials: list[Trial], chosen: list[Candidate],
    grid: Recordable, share: float,
) -> StageInformation:  # fmt: skip
    """The information of a session's trials to identify from for a stage, and of each of the candidates `chosen`.

    Args:
        model: the twin, around whose parameters residuals are taken to first order.
        share: by which the fitted model will be off, of a point's distance from the base.
    """
    config = with_every(config, model)
    fitted = [trial for trial in trials if trial.experiment in config.experiments and trial.split == IDENTIFY]
    if fitted:
        model, experiments, fit = set_up(_possible(config, fitted), fitted, model)
        experiments = [e if is_static(e.kind) else e.shortened(FRAMES) for e in experiments]
    else:
        experiments, fit = [], fit_of(config, trials[0].markers)
    fitting = [candidate for candidate in chosen if candidate.kind in config.experiments]
    done = simulated(fitting, model, fit, grid.frame_rate)
    matrices = information(fit, model, [e for _, e in done], share)
    low, high = fit.problem(model, [e for _, e in done] or experiments).bounds()
    recorded = information(fit, model, experiments, share).sum(axis=0)
    return StageInformation(
        stage, list(fit.parameters), 0.5 * (high - low),
        PRIOR * np.eye(len(recorded)) + recorded,
        {candidate.name: matrix for (candidate, _), matrix in zip(done, matrices, strict=True)},
        {candidate.name for candidate, e in done if any(_same(e, other) for other in experiments)},
    )  # fmt: skip


def _possible(config: IdentificationSettings, trials: list[Trial]) -> IdentificationSettings:
    """The stage's settings; with the shape at rest unchanged where no trial shows it yet."""
    if config.rest_shape == "measured" and not any(EXPERIMENTS[trial.experiment].hangs for trial in trials):
        return replace(config, rest_shape="unchanged")
    return config


def _same(planned: Experiment, other: Experiment) -> bool:
    """Whether two trials go about the same way."""
    if planned.kind != other.kind or abs(planned.load - other.load) > 1e-3:
        return False
    frames = min(planned.frames, other.frames)
    first, second = planned.positions[:frames], other.positions[:frames]
    off = np.linalg.norm(first - second, axis=2)[other.measured[:frames]]
    far = np.linalg.norm(second, axis=2)[other.measured[:frames]]
    return bool(off.sum() < SAME * far.sum())
