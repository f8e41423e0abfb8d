"""The uncertainty of the tip at rest, in the form of the Guide (JCGM 100, 101 and 102).

The measurand is where the tip is, m, in the frame of the tracked base, after slow commands, from whichever side. Its
estimate is the twin's tip in the middle of what friction can hold, moved by the residual map where there is one. Of
every input x_i with standard uncertainty u_i the twin gives the sensitivity c_i = ∂tip/∂x_i, and
u² = Σ c_i u_i c_j u_j r_ij. The radius within which the tip lies in 95 of 100 cases is not taken from u but from draws
of all inputs at once, through the twin (JCGM 101; a sphere is its region of coverage, JCGM 102, 7.6): it is the 95th
percentile of the tip's distance from the estimate.

With a residual map, what parameters and friction do to the tip is in the poses that it is learnt from, and so in how
far these are missed when they are left out. Where the map knows nothing, the tip is the twin's and so is its
uncertainty; in between, both count by the shares of the variance that the map leaves and explains.
"""

from dataclasses import dataclass

import mujoco
import numpy as np

from trunkline.identification.parameters.parameters import parameter_named
from trunkline.kinematics.residual.residual_map import ResidualMap
from trunkline.report.certificate.arms import StaticArm, arm_of, arms_with
from trunkline.report.certificate.discrepancy import discrepancy, holding
from trunkline.report.certificate.poses import StaticPoses
from trunkline.twin.discrepancy import Discrepancy
from trunkline.twin.posterior import Posterior

COVERAGE = 0.95
SURE_SHARE = 0.9  # of the poses with no more pull
FRICTION, LACKING, NOISE = "friction", "what the model lacks", "cameras"
LEAST = 1e-7  # m, below which an input moves no tip


@dataclass
class UncertaintySource:
    """A line of the budget, over N poses.

    Attributes:
        name: of the input.
        distribution: in words.
        uncertainty: standard, in its unit; None where it differs from pose to pose.
        unit: of the input, and so of the sensitivity, mm over it.
        degrees: of freedom; infinite where it is known.
        contributions: c_i u_i, or of a vector its root mean square length, m. Shape (N,).
    """

    name: str
    distribution: str
    uncertainty: float | None
    unit: str
    degrees: float
    contributions: np.ndarray


@dataclass
class Budget:
    """Of N poses.

    Attributes:
        tips: the estimate, m. Shape (N, 3).
        sources: the lines.
        correlated: what the correlations of the parameters add to u², m². Shape (N,).
        radius: expanded uncertainty, m: the tip is that near to the estimate in 95 of 100 cases. Shape (N,).
    """

    tips: np.ndarray
    sources: list[UncertaintySource]
    correlated: np.ndarray
    radius: np.ndarray

    @property
    def combined(self) -> np.ndarray:
        """u, the root mean square distance of the tip from the estimate by the law of propagation, m. Shape (N,)."""
        squares = sum((source.contributions**2 for source in self.sources), np.zeros(len(self.tips)))
        return np.sqrt(np.maximum(squares + self.correlated, 0))


@dataclass
class Inputs:
    """Of a budget.

    Attributes:
        model: of the twin.
        parameters: what is known of them.
        lacking: what the model lacks; None where no held-out trial tells it.
        noise: of the cameras' tip, standard uncertainty of each coordinate, m.
        residual_map: by how far the tip rests beside the twin's, where recorded poses tell.
        left: what the residual map lacks, None without one.
    """

    model: mujoco.MjModel
    parameters: Posterior
    lacking: Discrepancy | None
    noise: float
    residual_map: ResidualMap | None = None
    left: Discrepancy | None = None


def held_out(
    model: mujoco.MjModel, parameters: Posterior, noise: float, poses: StaticPoses, residuals: np.ndarray, arms: int,
    rng: np.random.Generator,
) -> Discrepancy:
    """What the model lacks, from how far the tips of held-out poses are from the twin's, m (N,), beside what `arms`
    draws of the parameters make of them."""
    arm = arm_of(model)
    shifts = parameter_shifts(model, parameters, arm, poses, arms, rng)
    others = 3 * noise**2 + (arm.friction(poses) ** 2).sum(axis=1) / 3 + np.nanmean((shifts**2).sum(axis=2), axis=0)
    return discrepancy(residuals, arm.ways(poses), others)


def left_by_map(arm: StaticArm, noise: float, poses: StaticPoses, missed: np.ndarray) -> Discrepancy:
    """What a residual map lacks, from how far it misses the tips of poses that are left out, m (N,)."""
    ways = arm.ways(poses)
    return holding(discrepancy(missed, ways, np.full(len(poses), 3 * noise**2)), missed, ways, COVERAGE)


def parameter_shifts(
    model: mujoco.MjModel, parameters: Posterior, arm: StaticArm, poses: StaticPoses, draws: int,
    rng: np.random.Generator,
) -> np.ndarray:  # fmt: skip
    """By how far the tip moves with `draws` draws of the parameters, m, NaN where an arm finds no rest. Shape
    (draws, N, 3)."""
    if not parameters.names:
        return np.zeros((draws, len(poses), 3))
    near = arm.rest(poses)
    variants = arms_with(model, parameters.sample(draws, rng))
    moved = np.array([other.tips(poses, near.qpos) for other in variants])
    return moved - arm.placed(near)


def sensitivities(model: mujoco.MjModel, parameters: Posterior, arm: StaticArm, poses: StaticPoses) -> np.ndarray:
    """By how far the tip moves with a standard uncertainty of each parameter, half the way between a step up and one
    down, m. Shape (P, N, 3)."""
    count = len(parameters.names)
    if not count:
        return np.zeros((0, len(poses), 3))
    steps = np.concatenate([np.diag(parameters.deviation), -np.diag(parameters.deviation)])
    values, near = parameters.values(parameters.estimate + steps), arm.rest(poses).qpos
    moved = np.array([other.tips(poses, near) for other in arms_with(model, values)])
    return (moved[:count] - moved[count:]) / 2


def budget(inputs: Inputs, poses: StaticPoses, arms: int, each: int, rng: np.random.Generator) -> Budget:
    """Of the tip in `poses`, by so many draws of the parameters, `each` of them with so many of everything else."""
    arm, parameters = arm_of(inputs.model), inputs.parameters
    tips = arm.tips(poses) + arm.shift(inputs.residual_map, poses)
    friction, ways = arm.friction(poses), arm.ways(poses)
    unknown = np.ones(len(poses)) if inputs.residual_map is None else inputs.residual_map.unknown(arm.resting(poses))
    twin, mapped = np.sqrt(unknown), np.sqrt(1 - unknown)
    friction, moves = friction * twin[:, None], sensitivities(inputs.model, parameters, arm, poses) * twin[:, None]
    shifts = parameter_shifts(inputs.model, parameters, arm, poses, arms, rng) * twin[:, None]
    offsets, draws = np.tile(shifts, (each, 1, 1)), arms * each
    offsets = offsets + rng.uniform(-1, 1, (draws, len(poses), 1)) * friction
    offsets = offsets + inputs.noise * rng.standard_normal(offsets.shape)
    lacks = np.zeros(len(poses))  # mean square length, m²
    for part, share in ((inputs.lacking, twin), (inputs.left, mapped)):
        if part is not None:
            offsets = offsets + part.offsets(ways, tips - arm.origin, draws, rng) * share[:, None]
            lacks += (share * part.deviation(ways)) ** 2
    sources = [
        UncertaintySource(name, f"t, {degrees:.0f} degrees of freedom", deviation * parameter_named(name).scale,
                          _axis_unit(name), degrees, np.linalg.norm(move, axis=1))
        for name, deviation, degrees, move
        in zip(parameters.names, parameters.deviation, parameters.degrees, moves, strict=True)
    ]  # fmt: skip
    sources.append(UncertaintySource(FRICTION, "rectangular, between both ends of its band", 1 / np.sqrt(3),
                                     "half bands", np.inf, np.linalg.norm(friction, axis=1) / np.sqrt(3)))  # fmt: skip
    if inputs.lacking:
        sources.append(UncertaintySource(LACKING, f"from {inputs.lacking.trials} held-out trials at rest", None, "mm",
                           inputs.lacking.trials, np.sqrt(lacks)))  # fmt: skip
    every = np.full(len(poses), np.sqrt(3) * inputs.noise)
    sources.append(UncertaintySource(NOISE, "normal, of each coordinate", inputs.noise * 1e3, "mm", np.inf, every))
    both = np.einsum("ink,jnk,ij->n", moves, moves, parameters.correlation - np.eye(len(parameters.names)))
    return Budget(tips, sources, both, radius_of(offsets))


def sure_pulls(pulls: np.ndarray, radius: np.ndarray, most: float) -> float:
    """The largest sum of pulls, m, up to which the tip is within `most`, m, in `SURE_SHARE` of the poses with a pull.

    Args:
        pulls: of all motors together, m. Shape (N,). radius: as `Budget.radius`. Shape (N,).
    """
    pulled = pulls > 0
    pulls, near = pulls[pulled], radius[pulled] <= most
    order = np.argsort(pulls)
    share = np.cumsum(near[order]) / np.arange(1, len(pulls) + 1)
    return float(pulls[order][share >= SURE_SHARE].max(initial=0.0))


def radius_of(offsets: np.ndarray) -> np.ndarray:
    """Within which a tip lies in 95 of 100 draws, m; a draw without a rest counts as far away. From (D, N, 3) to (N,).
    """
    distances = np.nan_to_num(np.linalg.norm(offsets, axis=2), nan=np.inf)
    return np.quantile(distances, COVERAGE, axis=0, method="higher")


def _axis_unit(name: str) -> str:
    """Of what is uncertain of a parameter: a share of itself, or its unit."""
    parameter = parameter_named(name)
    return parameter.unit if parameter.signed else "relative"
