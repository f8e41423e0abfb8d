"""The command line of everything that is measured on a package."""

import argparse
from collections.abc import Callable
from pathlib import Path

from trunkline.ar.preview.package import only_package
from trunkline.errors import in_one_line
from upkeep.results import recorded


def qualify(result: str, about: str | None, measure: Callable[..., None], **least: float) -> int:
    """Measure the package that the command names, or the tree's, and keep what `measure` prints as `result`.

    Args:
        about: the module's docstring. least: of each option its default, below which nothing is kept.
    """
    parser = argparse.ArgumentParser(description=about, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("package", nargs="?", type=Path)
    for option, default in least.items():
        parser.add_argument(f"--{option}", type=type(default), default=default)
    options = vars(parser.parse_args())
    chosen = options.pop("package")

    @in_one_line
    def measured() -> int:
        package = (chosen or only_package()).resolve()
        with recorded(result, keep=all(options[option] >= default for option, default in least.items())):
            measure(package, **options)
        return 0

    return measured()
