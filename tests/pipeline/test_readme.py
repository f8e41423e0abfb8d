"""The README: its generated blocks are current, and what it points to is there."""

import re
from pathlib import Path

import pytest

from trunkline.pipeline.readme import generate, with_blocks

ROOT = Path(__file__).parents[2]
README = (ROOT / "README.md").read_text(encoding="utf-8")


def test_generated_blocks_are_current():
    for path, text in generate(ROOT).items():
        assert text == path.read_text(encoding="utf-8"), f"{path.relative_to(ROOT)}: run `make readme`"


def test_files_and_pictures_that_it_names_exist():
    named = re.findall(r"`((?:trunkline|stages|conf|docs|demo|tests)/[\w/.]+)`", README)
    named += re.findall(r"\]\((docs/.*?)\)", README)
    assert len(named) > 5
    assert [name for name in named if not (ROOT / name).exists()] == []


def test_make_targets_that_it_names_exist():
    targets = re.findall(r"^(\w+):", (ROOT / "Makefile").read_text(), re.MULTILINE)
    assert set(re.findall(r"make (\w+)", README)) <= set(targets)


def test_a_block_is_replaced_and_a_missing_one_refused():
    text = "a\n<!-- x -->\nold\n<!-- /x -->\nb\n"
    assert with_blocks(text, {"x": "new \\1"}) == "a\n<!-- x -->\nnew \\1\n<!-- /x -->\nb\n"
    with pytest.raises(ValueError, match="<!-- y -->"):
        with_blocks(text, {"y": ""})
