"""Every kind of arm: what `kind` in conf/build_mjcf/arm/<name>.yaml may be, and the settings that go with it.

A kind is a dataclass in a file of this folder with a field ``kind: Literal["<name>"]`` and a method
``build(actuation, solver, models) -> CadArm``, as `cad.Chain` has; it is found here by that field.
"""

import pkgutil
from dataclasses import is_dataclass
from importlib import import_module
from pathlib import Path
from typing import Annotated, Protocol, Union, get_args

from pydantic import Field

from trunkline.arm.cad import CadArm
from trunkline.arm.mjcf import Actuation, Solver

PACKAGE = __name__.rpartition(".")[0]


class Kind(Protocol):
    """What a stage needs of an arm's settings."""

    def build(self, actuation: Actuation, solver: Solver, models: Path) -> CadArm: ...


def _kinds() -> dict[str, type[Kind]]:
    found = {}
    for module in pkgutil.iter_modules([str(Path(__file__).parent)], f"{PACKAGE}."):
        for value in list(vars(import_module(module.name)).values()):
            if is_dataclass(value) and value.__module__ == module.name and "kind" in value.__annotations__:
                found |= dict.fromkeys(get_args(value.__annotations__["kind"]), value)
    return found


ARMS = _kinds()
Arm = Annotated[Union[tuple(ARMS.values())], Field(discriminator="kind")]  # noqa: UP007 (a union of found classes)
