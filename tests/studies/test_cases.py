"""The table of others' sessions: what their READMEs say of them, and fits in the order of the pipeline."""

from pathlib import Path

import pytest

import studies.cases
from studies.cases import FITTED, LONGEST, about, cell, fit
from tests.support.folders import with_cases
from tests.support.outside import OUTCOMES
from trunkline.errors import InputError

HONEST = "00-x: the same, 50 Hz. Command: `dvc repro` (a.yaml). Happens and right: kp 3995 (truth 4000)."
FAULTY = (
    "05-x: one topic: another frame. Command: `dvc repro`. Happens: exit 0: no word; 2 mm. Should happen: read it. "
    "Right: refused. [SILENTLY WRONG; C frame / D frame_id; source: https://example.org/1; own]\nmore"
)


@pytest.mark.parametrize(
    ("text", "row"),
    [
        (HONEST, ["–", "the same, 50 Hz.", "kp 3995 (truth 4000)."]),
        (FAULTY, ["C frame / D frame_id", "one topic: another frame.", "exit 0: no word; 2 mm."]),
    ],
)
def test_a_readme_tells_kind_property_and_what_came_of_it(tmp_path, monkeypatch, text, row):
    monkeypatch.setattr(studies.cases, "CASES", tmp_path)
    (tmp_path / "x").mkdir()
    (tmp_path / "x/README.md").write_text(text)
    assert about("x") == row
    (tmp_path / "x/README.md").write_text("05-x: one topic")
    with pytest.raises(InputError, match=r"x/README.md: found no `Happens:`"):
        about("x")


@with_cases
def test_an_arm_is_built_before_its_session_is_taken_in_and_a_refusal_is_a_row(monkeypatch):
    ran = []

    def run(stage):
        ran.append(stage)
        assert Path("data/raw/06-centimetres/session.yaml").is_file()
        if stage == "filter":
            raise SystemExit(1)

    monkeypatch.setattr(studies.cases, "run", run)
    assert fit("06-centimetres", FITTED["06-centimetres"]) == "refused by filter"
    assert ran == ["build_mjcf", "ingest", "filter"]
    assert set(FITTED) <= set(OUTCOMES)


def test_a_cell_is_one_line_of_a_table():
    assert cell("a |\n b") == "a / b"
    assert len(cell(100 * "word ")) <= LONGEST
