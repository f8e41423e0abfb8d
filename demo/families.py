"""Families of arms that nobody designs for: a seed draws an arm's settings from the ranges of demo/families.yaml.

Open seeds are plain numbers. Sealed ones come from a digest of the code that identifies: whoever edits it gets other
arms, so that nobody can tune to them.
"""

import hashlib
from pathlib import Path
from typing import Any

import numpy as np
from omegaconf import OmegaConf

FILE = Path(__file__).with_suffix(".yaml")
COMMON = "common"


def families() -> dict[str, dict]:
    """By name: settings of a plant, with ranges in place of numbers."""
    ranges: Any = OmegaConf.to_container(OmegaConf.load(FILE))
    common = ranges.pop(COMMON)
    return {name: common | others for name, others in ranges.items()}


def sealed_seed(code: str, family: str, index: int) -> int:
    """That of a sealed arm. code: digest of the code that will identify it."""
    return int(hashlib.sha256(f"{code} {family} {index}".encode()).hexdigest(), 16)


def draw_arm(family: str, seed: int) -> tuple[int, dict[str, Any]]:
    """The lab's seed, from which the arm's scatter and all noise come, and its plant's settings."""
    rng = np.random.default_rng(seed)
    return int(rng.integers(2**31)), _drawn(families()[family], rng)


def _drawn(ranges: Any, rng: np.random.Generator) -> Any:
    """`ranges` with a number in place of each {low, high}, in their order."""
    if isinstance(ranges, list):
        return [_drawn(part, rng) for part in ranges]
    if not isinstance(ranges, dict):
        return ranges
    if set(ranges) == {"low", "high"}:
        low, high = ranges["low"], ranges["high"]
        drawn = np.exp(rng.uniform(np.log(low), np.log(high))) if low > 0 else rng.uniform(low, high)
        return float(f"{drawn:.6g}")
    return {key: _drawn(part, rng) for key, part in ranges.items()}
