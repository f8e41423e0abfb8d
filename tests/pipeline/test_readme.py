"""The README: its generated blocks are current. What it points to: test_docs.py."""

from pathlib import Path

import pytest

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
