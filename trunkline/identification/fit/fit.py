"""What is fitted to trials, and how."""

from dataclasses import dataclass, field
from typing import Annotated

import mujoco
from pydantic import Field

from trunkline.identification.fit.considered import Earlier
from trunkline.identification.fit.optimizers import Optimizer
from trunkline.identification.fit.problem import Bounds, Problem
from trunkline.identification.parameters.tolerances import Tolerances
from trunkline.identification.simulate.experiment import Experiment
from trunkline.identification.simulate.loss import LossWeights
from trunkline.identification.simulate.resting import RestShape
from trunkline.settings import Seed


@dataclass
class CoarseSearch:
    """A coarser look: a time step `step_factor` times the model's own, over the first `frames` of `trials` trials."""

    step_factor: Annotated[float, Field(ge=1, le=4)]
    frames: Annotated[int, Field(ge=1, le=100000)]
    trials: Annotated[int, Field(ge=1, le=10000)]


@dataclass
class Refinement:
    """Least squares on whole trials at the model's own step."""

    iterations: Annotated[int, Field(ge=1, le=10000)]
    tolerance: Annotated[float, Field(gt=0, le=1)]


@dataclass
class Method:
    """How a stage searches.

    optimizer: of the scalars, roughly. polish: of them, after it.
    fine: optimizer of the factors of every joint, within `per_joint_range` of 1. per_joint_deviation: by how much
        joints are expected to scatter around 1, standard deviation; infinite, from code alone, for no such prior.
    """

    optimizer: Optimizer
    rough: CoarseSearch
    polish: Refinement
    fine: Optimizer
    per_joint_range: Annotated[float, Field(gt=0, lt=1)]
    per_joint_deviation: Annotated[float, Field(gt=0, le=10)]
    seed: Seed


@dataclass
class Fit:
    """What is fitted to trials, and how.

    markers: names of those that the trials track.
    parameters: scalars of the whole arm and their ranges.
    per_joint: what then gets a factor for each joint, "stiffness" or "damping".
    loss: "distances" (the paper's) or "positions".
    rest: the shape in which the arm hangs, whatever its stiffness; None where it is as the model says.
    considered: what the model fixes, and by how much it may be off. earlier: what the stages before identified.
    """

    markers: tuple[str, ...]
    parameters: dict[str, Bounds]
    per_joint: tuple[str, ...]
    loss: str
    weights: LossWeights
    method: Method
    rest: RestShape | None = None
    considered: Tolerances = field(default_factory=Tolerances)
    earlier: list[Earlier] = field(default_factory=list)

    def problem(self, model: mujoco.MjModel, experiments: list[Experiment], step_factor: float = 1.0) -> Problem:
        """The search for the scalars, from those of `model`."""
        return Problem(
            model, experiments, self.markers, self.parameters, self.loss, self.weights, step_factor, rest=self.rest
        )
