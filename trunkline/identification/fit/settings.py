"""What the three identification stages are set by: the method, and what is fitted to which trials."""

from dataclasses import field
from typing import Annotated, Literal

from pydantic import Field

from trunkline.identification.fit.fit import Method
from trunkline.identification.fit.problem import Bounds
from trunkline.identification.parameters.parameters import ParameterName, PerJointName, parameter_named
from trunkline.identification.parameters.tolerances import Tolerances
from trunkline.identification.simulate.loss import Loss
from trunkline.recordings.trials.experiments import EXPERIMENTS, ExperimentName
from trunkline.settings import settings

MOUNT = ("mount_tilt_x", "mount_tilt_y", "mount_twist")
Experiments = Annotated[list[ExperimentName], Field(min_length=1)]


@settings
class IdentificationSettings(Method):
    """See conf/identify_*/config.yaml. A stage's Config: a method of search and what it is for.

    frames: compared of each trial, at most. command_delay: s from a logged command to the motor.
    experiments: to fit. reported: to score, those and others; of the last stage, whose model is shipped, all kinds.
    per_session: which of the parameters each of several sessions of the arm has for itself.
    considered: what the model fixes, by how much it may be off.
    """

    frames: Annotated[int, Field(ge=1, le=100000)]
    command_delay: Annotated[float, Field(ge=0, le=1)]
    experiments: Experiments
    reported: Experiments
    rest_shape: Literal["unchanged", "measured"]
    markers: Literal["unchanged", "measured"]
    loss: Loss
    parameters: Annotated[dict[ParameterName, Bounds], Field(min_length=1)]
    per_joint: list[PerJointName]
    per_session: list[ParameterName] = Field(default_factory=lambda: list(MOUNT))
    cross_validation_folds: Annotated[int, Field(ge=0, le=100)]
    considered: Tolerances = field(default_factory=Tolerances)

    def __post_init__(self):
        if not set(self.experiments) <= set(self.reported):
            raise ValueError(f"reported: found {self.reported}, expected at least {self.experiments}")
        if self.cross_validation_folds == 1:
            raise ValueError("cross_validation_folds: found 1, expected 0 (none) or at least 2")
        for name, span in self.parameters.items():
            parameter = parameter_named(name)
            if span.low <= 0 and not parameter.signed:
                raise ValueError(f"parameters.{name}.low: found {span.low}, expected more than 0")
            kinds = [kind for kind in EXPERIMENTS if parameter.identifiable_from(EXPERIMENTS[kind])]
            if not set(kinds) & set(self.experiments):
                reason = f"found it to be identified from {' and '.join(self.experiments)} alone"
                raise ValueError(f"parameters.{name}: {reason}, expected one of {', '.join(kinds)} too")
            if self.rest_shape == "measured" and {"qpos_spring", "body_mass"} & set(parameter.fields):
                raise ValueError(f"parameters.{name}: found it beside rest_shape: measured, expected one of the two")
