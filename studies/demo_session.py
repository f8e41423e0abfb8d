"""What the stages of identification begin with, and some of what they see."""

from pathlib import Path

import numpy as np

from trunkline.errors import InputError
from trunkline.pipeline.identify import CAD_MODEL, TRIALS

# every stage, and the model that it begins with
STAGES = {
    "identify_stiffness": CAD_MODEL,
    "identify_damping": Path("artifacts/identify_stiffness/arm.xml"),
    "identify_control": Path("artifacts/identify_damping/arm.xml"),
}


def require_demo(model: Path) -> None:
    """Refuse to begin without the demo session's trials and the `model` to begin with."""
    for path in (model, TRIALS / "trials.parquet"):
        if not path.is_file():
            raise InputError(f"{path}: no such file, expected what `make demo` writes; run it first")


def spread(items: list, count: int) -> list:
    """At most `count` of `items`, evenly spread from first to last."""
    return [items[i] for i in np.unique(np.linspace(0, len(items) - 1, count).round().astype(int))]
