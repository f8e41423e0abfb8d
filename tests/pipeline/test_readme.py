"""The README: its generated blocks are current. What it points to: test_docs.py."""

import json
from pathlib import Path

import pytest

from trunkline.pipeline.lab_table import lab_table
from trunkline.pipeline.readme import generate, with_blocks

ROOT = Path(__file__).parents[2]


def test_generated_blocks_are_current():
    for path, text in generate(ROOT).items():
        assert text == path.read_text(encoding="utf-8"), f"{path.relative_to(ROOT)}: run `make readme`"


def test_a_block_is_replaced_and_a_missing_one_refused():
    text = "a\n<!-- x -->\nold\n<!-- /x -->\nb\n"
    assert with_blocks(text, {"x": "new \\1"}) == "a\n<!-- x -->\nnew \\1\n<!-- /x -->\nb\n"
    with pytest.raises(ValueError, match="<!-- y -->"):
        with_blocks(text, {"y": ""})


def test_the_lab_s_numbers_are_held_against_the_intervals(tmp_path):
    """A force is expected without the lab's factor of masses; what is undetermined is not judged."""
    (tmp_path / "demo/conf/record").mkdir(parents=True)
    plant = "hardening: 1.5, tendon_friction: 0.6, cable_stiffness: 1500, cable_damping: 15, max_force: 16"
    (tmp_path / "demo/conf/record/config.yaml").write_text(f"plant: {{{plant}, mass_factor: 1.2}}\n")
    (tmp_path / "artifacts/identify_damping").mkdir(parents=True)
    rows = {
        "hardening": {"value": 1.6, "interval_95": [1.4, 1.8]},
        "tendon_friction": {"value": 0.6, "interval_95": [0.55, 0.65]},
        "force_range": {"value": 9.0, "interval_95": [5.0, 100.0], "undetermined": True},
    }
    table = {"parameters": {name: {"unit": "N", "undetermined": False} | row for name, row in rows.items()}}
    (tmp_path / "artifacts/identify_damping/parameters.json").write_text(json.dumps(table))
    lines = dict(line.strip("| ").split(" | ", 1) for line in lab_table(tmp_path).splitlines()[2:])
    assert lines["`hardening`, N"] == "1.5 | 1.5 | 1.6 | 1.4 … 1.8 | yes"
    assert lines["`tendon_friction`, N"] == "0.6 | 0.5 | 0.6 | 0.55 … 0.65 | no"
    assert lines["`force_range`, N"] == "16 | 13.33 | 9 | undetermined"
    assert lines["`kp`"] == "1500 | 1250 | – | – | –"
