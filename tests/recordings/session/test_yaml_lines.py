"""The line of a key."""

import pytest

from trunkline.recordings.session.yaml_lines import line_of, with_line

TEXT = """frame:
  up: [0, 1, 0]
# two trials
trials:
  - {file: a.mcap, level: 30}
  - file: b.mcap
    level: x
"""


@pytest.mark.parametrize(
    ("key", "line"),
    [
        ("frame", 1), ("frame.up", 2), ("frame.up.2", 2), ("frame.unit", 1), ("trials.0.level", 5), ("trials.1", 6),
        ("trials.1.level", 7), ("trials.2.level", 4), ("trials.one.level", 4), ("bodies", None), ("the file", None),
    ],
)  # fmt: skip
def test_a_key_stands_where_it_is_written_and_one_that_is_missing_where_it_would(tmp_path, key, line):
    path = tmp_path / "session.yaml"
    path.write_text(TEXT)
    assert line_of(path, key) == line
    there = f" (line {line})" if line else ""
    assert with_line(path, f"{key}: found 1: no") == f"{path}: {key}: found 1: no{there}"


def test_an_empty_file_has_no_line(tmp_path):
    path = tmp_path / "session.yaml"
    path.write_text("")
    assert line_of(path, "frame") is None
