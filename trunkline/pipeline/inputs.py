"""What a stage's settings name: there, or one line that says what was expected."""

from collections.abc import Callable
from importlib import import_module

from trunkline.errors import InputError


def load_rig(key: str, module: str, function: str = "reach") -> Callable:
    """A function of a module that drives the arm itself, see `ik.on_plant.Rig` and `certificate.coverage.Bring`.
    Each lab has its own.

    Raises:
        InputError: naming the settings' `key`, if there is no such module or it has no such function.
    """
    try:
        return getattr(import_module(module), function)
    except (ModuleNotFoundError, AttributeError) as error:
        raise InputError(f"{key}: found {module!r}: {error}; expected a module with a function `{function}`") from error
