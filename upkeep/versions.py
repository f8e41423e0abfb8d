"""`python -m upkeep.versions`: write versions.yaml, the versions of the libraries that results depend on.

A stage lists in dvc.yaml, as parameters, those that its numbers go through. So another MuJoCo reruns what MuJoCo
computes, and another pytest reruns nothing. The versions are the locked ones, the same on every machine.
"""

import re
import sys
from importlib.metadata import PackageNotFoundError, version
from pathlib import Path

from omegaconf import OmegaConf

from trunkline.errors import InputError, in_one_line
from trunkline.pipeline.checkout import require_checkout

FILE = "versions.yaml"
LOCKS = ("requirements.lock", "requirements-torch.txt")
# Every direct dependency of the stages but what only reads settings (hydra, omegaconf, pydantic), shows (matplotlib,
# rich) or runs them (dvc, threadpoolctl).
LIBRARIES = (
    "fast-simplification", "lz4", "mcap", "mcap-protobuf-support", "mcap-ros2-support", "mujoco", "numba",
    "numpy", "onnx", "onnxruntime", "pandas", "point-cloud-utils", "protobuf", "pyarrow", "pytorch-optimizer",
    "rosbags", "scikit-image", "scipy", "torch", "tract", "trimesh", "zstandard",
)  # fmt: skip
HEADER = "# Versions that results depend on, from requirements.lock by `make requirements`; dvc.yaml names them.\n"


def locked_versions(root: Path) -> dict[str, str]:
    """Name to version of every library in `LIBRARIES`, as locked.

    Raises:
        InputError: naming a library that no lock file pins.
    """
    text = "\n".join((root / name).read_text(encoding="utf-8") for name in LOCKS)
    pinned = dict(re.findall(r"^([\w.-]+)==([\w.+!-]+)", text, re.MULTILINE))
    for name in LIBRARIES:
        if name not in pinned:
            raise InputError(f"{', '.join(LOCKS)}: found no {name}==…, expected its version")
    return {name: pinned[name] for name in LIBRARIES}


def locked_otherwise(root: Path) -> list[str]:
    """One line per library that the lock files pin to another version than `root / "versions.yaml"` names."""
    named = dict(OmegaConf.load(root / FILE).items())
    return [
        f"{name}: {FILE} names {named.get(name)}, {', '.join(LOCKS)} pin {locked} (run `make requirements`)"
        for name, locked in locked_versions(root).items()
        if named.get(name) != locked
    ]


def installed_otherwise(root: Path) -> list[str]:
    """One line per library that is installed in another version than `root / "versions.yaml"` names.

    A local part does not count: torch 2.13.0+cpu is torch 2.13.0.
    """
    lines = []
    for name, expected in OmegaConf.load(root / FILE).items():
        try:
            installed = version(str(name)).partition("+")[0]
        except PackageNotFoundError:
            installed = "none"
        if installed != expected:
            lines.append(f"{name}: installed {installed}, {FILE} names {expected}")
    return lines


@in_one_line
def main(root: Path = Path(".")) -> int:
    require_checkout(root)
    lines = [f'{name}: "{number}"\n' for name, number in locked_versions(root).items()]
    (root / FILE).write_text(HEADER + "".join(lines), encoding="utf-8")
    return 0


if __name__ == "__main__":
    sys.exit(main())
