"""What was identified in the demo session beside the stand-in lab's own numbers, as a Markdown table."""

import json
from pathlib import Path

from omegaconf import OmegaConf

STAGES = ("identify_stiffness", "identify_damping", "identify_control")
# identified parameter: (its counterpart in the lab's config, whether it is a force per something)
COUNTERPARTS = {
    "hardening": ("hardening", False),
    "tendon_friction": ("tendon_friction", True),
    "kp": ("cable_stiffness", True),
    "kv": ("cable_damping", True),
    "force_range": ("max_force", True),
}


def lab_table(root: Path) -> str:
    """A row for each parameter whose counterpart stands in demo/conf/record/config.yaml.

    Motion tells forces only up to a common factor, which the masses set. So what is to be expected of a force is the
    lab's number over the factor by which the lab's masses exceed those of the CAD model.
    """
    plant = OmegaConf.load(root / "demo" / "conf" / "record" / "config.yaml").plant
    found = {}
    for stage in STAGES:
        path = root / "artifacts" / stage / "parameters.json"
        if path.is_file():
            found |= json.loads(path.read_text(encoding="utf-8"))["parameters"]
    lines = ["| parameter | the lab | expected | found | 95 % interval | holds it |", "|---|---:|---:|---:|---:|---|"]
    for name, (counterpart, force) in COUNTERPARTS.items():
        lab, row = float(plant[counterpart]), found.get(name)
        expected = lab / plant.mass_factor if force else lab
        cells = [f"`{name}`, {row['unit']}" if row else f"`{name}`", f"{lab:.4g}", f"{expected:.4g}"]
        lines.append(f"| {' | '.join([*cells, *_result(row, expected)])} |")
    return "\n".join(lines)


def _result(row: dict | None, expected: float) -> list[str]:
    """Value, interval, and whether it holds what is expected."""
    if row is None:
        return ["–", "–", "–"]
    if row["undetermined"]:
        return [f"{row['value']:.4g}", "undetermined", ""]
    low, high = row["interval_95"]
    return [f"{row['value']:.4g}", f"{low:.4g} … {high:.4g}", "yes" if low <= expected <= high else "no"]
