"""Every kind of arm: what `kind` in conf/build_mjcf/arm/<name>.yaml may be, and the settings that go with it.

A kind is a dataclass in a file of this folder with a field `kind: Literal["<name>"]` and a method
`build(actuation, solver, models) -> CadArm`, as `ChainArm` has; it is found here by that field.
"""

import pkgutil
from dataclasses import is_dataclass
from importlib import import_module
from pathlib import Path
from typing import TYPE_CHECKING, Annotated, Protocol, Union, get_args

from pydantic import Field

from trunkline.model.arm.cad import CadArm
from trunkline.model.arm.guide_holes import GuideHoles, add_holes
from trunkline.model.arm.joints import Joints, add_elements
from trunkline.model.arm.mjcf import Actuation, Solver
from trunkline.settings import settings

PACKAGE = __name__.rpartition(".")[0]


class ArmKind(Protocol):
    """What a stage needs of an arm's settings."""

    def build(self, actuation: Actuation, solver: Solver, models: Path) -> CadArm: ...


def _kinds() -> dict[str, type[ArmKind]]:
    kinds = {}
    for module in pkgutil.iter_modules([str(Path(__file__).parent)], f"{PACKAGE}."):
        for value in list(vars(import_module(module.name)).values()):
            if is_dataclass(value) and value.__module__ == module.name and "kind" in value.__annotations__:
                kinds |= dict.fromkeys(get_args(value.__annotations__["kind"]), value)
    return kinds


ARMS = _kinds()
if TYPE_CHECKING:
    Arm = ArmKind  # which classes there are is found out when the program runs
else:
    Arm = Annotated[Union[tuple(ARMS.values())], Field(discriminator="kind")]  # noqa: UP007 (of found classes)


MODELS = "build_mjcf/mjcf"  # folder below conf/ of arms that come as MJCF


@settings
class Description:
    """An arm from its description alone: geometry, material, motors and solver, as the stage `build_mjcf` is told."""

    arm: Arm
    joints: Joints
    holes: GuideHoles
    actuation: Actuation
    solver: Solver


def described_arm(description: Description, conf: Path) -> CadArm:
    """The CAD model; `conf` is the folder of settings, which holds arms that come as MJCF."""
    arm = description.arm.build(description.actuation, description.solver, conf / MODELS)
    add_elements(arm.spec, description.joints, description.solver.armature)
    add_holes(arm.spec, description.holes)
    return arm
