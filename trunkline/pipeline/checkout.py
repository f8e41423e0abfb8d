"""Commands about the pipeline need the repository: an installed library has neither stages/ nor conf/."""

from pathlib import Path

from trunkline.errors import InputError


def require_checkout(root: Path) -> None:
    """Raise InputError unless `root` holds a pipeline, as the top of a checkout of Trunkline does."""
    if not (root / "dvc.yaml").is_file():
        raise InputError(f"{root.resolve()}: found no dvc.yaml, expected the top of a checkout of Trunkline")
