"""The README and the docs: their generated blocks are current. What they point to: test_docs.py."""

import json
from pathlib import Path

import numpy as np
import pytest
import yaml
from pydantic import TypeAdapter

from tests.support.folders import TABLE_OF_NOTHING
from trunkline.identification.fit.settings import IdentificationSettings
from trunkline.identification.parameters.parameters import parameter_name
from trunkline.identification.stages import STAGES
from trunkline.pipeline.config import load_config
from trunkline.pipeline.stage import write_json
from trunkline.recordings.trials.splits import DECIDING, TEST, VALIDATE
from upkeep.baseline import MetricBaseline, baseline_file, renewed
from upkeep.limits import Limit, limit_files, lookup, read_limits
from upkeep.readme import (
    COVERAGE_TIMES,
    EXAMPLES,
    RESULTS,
    RESULTS_PAGE,
    Shown,
    as_sent,
    generate,
    headline,
    preview_table,
    rehearsal_block,
    results_table,
    score_table,
    with_blocks,
)
from upkeep.rehearsal_table import DISTANCES
from upkeep.truth_table import (
    LACKING,
    SHIPPED,
    TRUTH,
    error_table,
    expectation,
    holds,
    identified,
    truth_table,
)

ROOT = Path(__file__).parents[2]


def test_generated_blocks_are_current():
    for path, text in generate(ROOT).items():
        assert text == path.read_text(encoding="utf-8"), f"{path.relative_to(ROOT)}: run `make readme`"


def test_the_full_tables_have_a_page_and_the_readme_leads_there():
    page = (ROOT / RESULTS_PAGE).read_text(encoding="utf-8")
    for name in ("score", "identification", "results", *EXAMPLES, "arms"):
        assert page.count(f"<!-- {name} -->") == 1
    assert f"]({RESULTS_PAGE.as_posix()}" in (ROOT / "README.md").read_text(encoding="utf-8")


def test_the_headline_shows_what_misses_its_goal_beside_what_meets_it(tmp_path):
    """Bold, with the goal; and by which code and package. Without any results it has dashes."""
    rehearsed = {"reach": {"rate": 0.9, "clean": {"rate": 0.8}}}
    rehearsed |= {"follow": {"rate": 1.0}, "grasp": {"rate": 0.95}, "handle": {"rate": 0.5}}
    sent, bad, rubbing = (
        {"position_error_mm": {"median": median, "p95": p95}, "beyond_1pct_unsaid": unsaid, "targets": targets,
         "doubted": doubted}
        for median, p95, unsaid, targets, doubted in
        ((0.5, 1.5, 0, 50, 0.04), (13.0, 29.0, 170, 200, 1.0), (2.0, 6.0, 7, 40, 0.126))
    )  # fmt: skip
    network = {"as_controls": {"frictionless": sent, "friction": rubbing, "targets": 50}}
    network["on_plant"] = bad | {"with_poses": rubbing}
    goals = "rehearse:\n  reach.rate: {better: higher, goal: 0.98}\n  follow.rate: {min: 0.95}\n"
    (tmp_path / "tests").mkdir()
    (tmp_path / "tests/limits.yaml").write_text(goals)
    at_poses = "recorded poses](docs/lab-tools.md#poses-to-record)** |"
    assert "**" not in headline(tmp_path).replace("**on the", "").replace(at_poses, "")
    for stage, metrics in {"train_ik": network, "rehearse": rehearsed}.items():
        (tmp_path / f"artifacts/{stage}").mkdir(parents=True)
        write_json(tmp_path / f"artifacts/{stage}/metrics.json", metrics)
    with pytest.MonkeyPatch.context() as patch:
        patch.setattr("upkeep.readme.source_words", lambda root, metrics: "**STALE**: of code abc")
        text = headline(tmp_path)
    twin = "on the twin without friction: 0.5 / 1.5 mm (0 of 50; 4 %); with friction: 2 / 6 mm (7 of 40; 12.6 %)"
    assert f"| {twin} |" in text
    assert "| **on the simulated lab's arm: 13 / 29 mm (170 of 200; 100 %); 2 / 6 mm after [30 recorded poses]" in text
    reached = "| **reach 90 %** (within 20 mm, and no other part touched anything: 80 %), follow 100 %, grasp 95 %, "
    assert f"{reached}hand-over 50 % | goal: reach ≥ 98 %, follow ≥ 95 % |" in text
    assert text.endswith("The last row: rehearsal **STALE**: of code abc.")


def test_a_block_is_replaced_and_a_missing_one_refused():
    text = "a\n<!-- x -->\nold\n<!-- /x -->\nb\n"
    assert with_blocks(text, {"x": "new \\1"}) == "a\n<!-- x -->\nnew \\1\n<!-- /x -->\nb\n"
    with pytest.raises(ValueError, match="<!-- y -->"):
        with_blocks(text, {"y": ""})


@pytest.fixture
def judged(tmp_path):
    """Tables of a made-up session whose truth is known."""
    (tmp_path / "data/raw").mkdir(parents=True)
    truth = {"hardening": 1.5, "tendon_friction": 0.6, "kp": 1500.0, "force_range": 16.0, "time_constant": None}
    truth = {"parameters": truth, "forces": ["tendon_friction", "kp", "force_range"], "mass_factor": 1.2}
    truth |= {"clock_offset_s": 0.1, "starts_s": {"release_a": 0.7, "release_b": 0.7}}
    truth |= {"stiffness_factors": [1.1, 0.9, 1.0], "plant": "stranger", "sliders": []}
    truth |= {"branches": [{"ratio": 0.12, "time_s": 0.05}] * 3, "rate_limit_m_s": 0.25, "backlash_m": 3e-4}
    (tmp_path / TRUTH).write_text(json.dumps(truth))
    rows = {
        "hardening": {"value": 1.6, "interval_95_given_model": [1.4, 1.8]},
        "tendon_friction": {"value": 0.6, "interval_95_given_model": [0.55, 0.65]},
        "force_range": {"value": 9.0, "interval_95_given_model": [5.0, 100.0], "undetermined": True},
        "time_constant": {"value": 0.03, "interval_95_given_model": [0.02, 0.04]},
    }
    rows = {name: {"unit": "N", "undetermined": False} | row for name, row in rows.items()}
    table = TABLE_OF_NOTHING | {"parameters": rows}
    factors = {"factor": [1.05, 0.95, 1.0], "half_width_95_given_model": [0.1, 0.01, None]}
    written = {
        "identify_damping/parameters": table,
        "identify_stiffness/parameters": TABLE_OF_NOTHING | {"per_joint": {"stiffness": factors}},
        "filter/metrics": {"moving": {"release_a": {"start_s": 0.701}, "release_b": {"start_s": 0.695}}},
        "ingest/metrics": {"clock_offset_ms": -98.0},
    }
    for name, content in written.items():
        path = tmp_path / "artifacts" / f"{name}.json"
        path.parent.mkdir(parents=True, exist_ok=True)
        path.write_text(json.dumps(content))
    return tmp_path


def test_the_truth_is_held_against_the_intervals(judged):
    """A force is expected without the lab's factor of masses; what is undetermined or has no truth is not judged."""
    lines = dict(line.strip("| ").split(" | ", 1) for line in truth_table(judged).splitlines()[2:] if " | " in line)
    assert lines["`hardening`, N"].startswith("1.5 | 1.5 | 1.6 | 1.4 … 1.8 | yes |")
    assert lines["`tendon_friction`, N"].startswith("0.6 | 0.5 | 0.6 | 0.55 … 0.65 | **no** |")
    assert lines["`force_range`, N"].startswith("16 | 13.33 | 9 | undetermined |  |")
    assert lines["`time_constant`, N"].startswith("– | – | 0.03 | 0.02 … 0.04 |  |")
    assert "own scatter 1.00; 2 of 3\n" in truth_table(judged)
    hardening = np.log(1.6 / 1.5) / np.log(1.8 / 1.4) * 2
    tendon_friction = np.log(0.6 / 0.5) / np.log(0.65 / 0.55) * 2
    rms = np.hypot(hardening, tendon_friction) / np.sqrt(2)
    assert f"expected: 1 of 2; given the model alone, 1. Error over half\nwidth: {rms:.2f} " in truth_table(judged)


def test_the_truth_is_held_against_what_the_model_fixes_where_that_is_considered(judged):
    path = judged / "artifacts/identify_damping/parameters.json"
    assert "| 95 % interval, given the model |" in truth_table(judged)
    table = json.loads(path.read_text())
    for row in table["parameters"].values():
        row["interval_95"] = [0.8 * row["interval_95_given_model"][0], 1.2 * row["interval_95_given_model"][1]]
    path.write_text(json.dumps(table))
    assert "| 95 % interval, with the model's tolerances |" in truth_table(judged)
    assert "| 0.5 | 0.6 | 0.44 … 0.78 | yes |" in truth_table(judged)
    assert "expected: 2 of 2; given the model alone, 1. " in truth_table(judged)


def test_the_truth_table_says_what_the_model_lacks(judged):
    """What a parameter that is identified stands for is lacking no more, or is so many of the lab's."""

    def lacking(name: str = "kp", **more) -> str:
        path = judged / "artifacts/identify_control/parameters.json"
        rows = {name: {"value": 1.0, "unit": "1", "undetermined": False} for name in {name: 1, **more}}
        path.parent.mkdir(exist_ok=True)
        path.write_text(json.dumps(TABLE_OF_NOTHING | {"parameters": rows}))
        (line,) = (line for line in truth_table(judged).splitlines() if line.startswith(f"| `{name}`"))
        return line

    assert "dead time of the motors, friction on its holes" in lacking()
    assert "Maxwell branches (it has 0 of 3)" in lacking()
    assert "dead time" not in lacking(dead_time=1)
    assert "Maxwell branches (it has 2 of 3)" in lacking(relaxation=1, relaxation_2=1)
    assert "sliders" not in lacking(), "this lab has none"
    assert "0.12 for 0.05 s, 0.12 for 0.05 s" in truth_table(judged)
    grows = "a rest shape that grows towards the tip, "
    bends = {"rest_bend_x": 1, "rest_bend_y": 1}
    assert lacking("mount_tilt_y", **bends).endswith(f"| {grows}scatter from link to link |")
    gradients = {"rest_gradient_x": 1, "rest_gradient_y": 1}
    assert grows not in lacking("mount_tilt_y", **bends, **gradients)
    plants = {yaml.safe_load(file.read_text())["kind"] for file in ROOT.glob("demo/conf/record/plant/*.yaml")}
    assert set(LACKING) == plants
    named = {name for effects in LACKING.values() for effect in effects for name in (*effect.on, effect.unless) if name}
    assert {parameter_name(name) for name in named} == named


@pytest.fixture
def shipped(tmp_path):
    """A project whose first stage was scored on tilts, 1 mm off, and whose last on tilts, 3 mm off, and curls."""

    def row(off: float) -> dict:
        errors = {f"{error}_{unit}": off for error in ("e_position", "e_tip", "e_internal") for unit in ("mm", "pct")}
        return {"trials": 4} | errors

    def scored(off: float, *kinds: str) -> dict:
        by_model = {"identified": off, "null": 90.0, "noise_floor": 0.1}
        return {name: {"test": row(value) | {"by_experiment": {kind: row(value) for kind in kinds}}}
                for name, value in by_model.items()}  # fmt: skip

    metrics = {STAGES[0]: scored(1.0, "static_tilt"), SHIPPED: scored(3.0, "curl", "static_tilt")}
    for name, text in {"artifacts/score/metrics.json": json.dumps(metrics), "tests/limits.yaml": LIMITS}.items():
        (tmp_path / name).parent.mkdir(parents=True)
        (tmp_path / name).write_text(text)
    return tmp_path


def test_scores_are_of_the_shipped_model_on_every_kind_and_an_intermediate_one_says_so(shipped):
    rows = [line.strip("| ").split(" | ") for line in score_table(shipped).splitlines()[2:]]
    assert [row[0] for row in rows] == [
        "goal", "static tilts", "curls", "all of these", "identify_stiffness (intermediate model): static tilts"
    ]  # fmt: skip
    assert [row[1] for row in rows[1:]] == ["3 / 3 % (3 / 3 mm)"] * 3 + ["1 / 1 % (1 / 1 mm)"]
    assert [rows[1][3], rows[1][-2]] == ["90 / 90", "0.1 / 0.1"]  # baseline and noise floor


def test_the_readme_leads_with_the_shipped_model_on_every_kind_and_on_the_worst(shipped):
    file = shipped / "artifacts/score/metrics.json"
    metrics = json.loads(file.read_text())
    metrics[SHIPPED]["identified"]["test"]["by_experiment"]["curl"]["e_tip_pct"] = 9.0
    file.write_text(json.dumps(metrics))
    rows = [line.strip("| ").split(" | ") for line in headline(shipped).splitlines()[2:4]]
    beside = "CAD – mm; baseline: mean rest shape 90 / 90 mm; noise floor 0.1 / 0.1 mm"
    what = "Shape / tip error in % of length, simulated lab, 4 held-out trials (static tilts, curls)"
    assert rows == [
        [what, "**3 / 3 % (3 / 3 mm)**", beside], ["… the worst kind: 4 curls", "**3 / 9 % (3 / 3 mm)**", beside]
    ]  # fmt: skip


LIMITS = """
fit:
  error.median: {max: 1.0}
  error.p95: {better: lower, goal: 2.0}
  unsaid: {equals: 0}
  share: {min: 0.9}
"""
METRICS = {"error": {"median": 0.5, "p95": 2.5}, "unsaid": 0, "targets": 1200, "share": 0.95}


@pytest.fixture
def limited(tmp_path):
    """A project's limits, whose baseline is of METRICS."""
    file = tmp_path / "tests/limits.yaml"
    path = tmp_path / "artifacts/fit/metrics.json"
    for folder in (file.parent, path.parent):
        folder.mkdir(parents=True)
    file.write_text(LIMITS)
    write_json(path, METRICS)
    before = renewed(None, read_limits(file), tmp_path, "abc", "the first")
    write_json(baseline_file(file), TypeAdapter(MetricBaseline).dump_python(before))
    return file


@pytest.mark.parametrize(
    ("figures", "row"),
    [
        ([Shown("share")], "0.95 | ≥ 0.9 | ≥ 0.935"),
        ([Shown("error.median", "mm")], "0.5 mm | ≤ 1 | ≤ 0.65"),
        ([Shown("error.p95", "mm")], "2.5 mm | ≤ 2 (missed) | ≤ 3.25"),
        (
            [Shown("error.median", "mm"), Shown("error.p95", "mm"), Shown("unsaid", of="targets")],
            "0.5 / 2.5 mm / 0 of 1,200 | ≤ 1 / ≤ 2 (missed) / 0 | ≤ 0.65 / ≤ 3.25 / 0",
        ),
        ([Shown("error.median", "mm"), Shown("unsaid")], "0.5 mm / 0 | ≤ 1 / 0 | ≤ 0.65 / 0"),
        ([Shown("targets"), Shown("share")], "1,200 / 0.95 | – / ≥ 0.9 | – / ≥ 0.935"),
        ([Shown("targets")], "1,200 |  | "),
        ([Shown("nothing", "mm"), Shown("nor.this", "mm")], "– / – mm |  | "),
    ],
)
def test_a_row_has_found_goal_and_bound_of_each_of_its_figures(limited, figures, row):
    (line,) = results_table(limited, {"fit": [("what", figures)]}).splitlines()[2:]
    assert line == f"| what | {row} |"


def test_a_stage_that_never_ran_has_dashes(limited):
    (line,) = results_table(limited, {"map": [("what", [Shown("a", "mm"), Shown("b", of="c")])]}).splitlines()[2:]
    assert line == "| what | – mm / – of – |  |  |"


def test_commands_are_told_by_the_same_statistics_of_whatever_arm():
    """The bad rows beside the good: median, 95th percentile, and what is missed with no doubt raised, of how many. The
    arm's own tips and what is across its surface come after them."""
    rows = [figures for _, figures in RESULTS["train_ik"]]
    arms = ["as_controls.frictionless", "as_controls.friction", "on_plant", "on_plant.within"]
    for arm, figures in zip(arms, rows, strict=False):
        names = [f"{arm}.position_error_mm.median", f"{arm}.position_error_mm.p95", f"{arm}.beyond_1pct_unsaid"]
        assert [figure.key for figure in figures] == names
        assert figures[-1].of.endswith("targets")
        assert figures == as_sent(arm, figures[-1].of)
    bands = {figure.key for _, figures in RESULTS["fk_dataset"] for figure in figures}
    assert bands >= {"friction_band_mm.median", "friction_band_mm.p95"}


def test_each_figure_of_the_readme_has_a_row_of_the_gate():
    """Those of `test` by their twin of `validate`. A figure may have its row in another unit."""
    rows = {file: read_limits(file) for file in limit_files(ROOT)}
    project_rows = rows[ROOT / "tests/limits.yaml"]
    entries = [(stage, figure.key) for stage, lines in RESULTS.items() for _, figures in lines for figure in figures]
    errors = ("e_internal", "e_position", "e_tip")
    entries += [("identify_control", f"identified.{split}.{error}") for split in DECIDING for error in errors]
    scored = json.loads((ROOT / "artifacts/score/metrics.json").read_text())
    for stage in STAGES:
        for kind in lookup(scored, f"{stage}.identified.{TEST}.by_experiment"):
            if stage == SHIPPED or kind in load_config(IdentificationSettings, stage, ROOT).experiments:
                entries += [(stage, f"identified.{VALIDATE}.by_experiment.{kind}.{error}") for error in errors]
    entries += [("rehearse", f"preview.coverage.{name}.share") for name in COVERAGE_TIMES]
    for experiment, distance in DISTANCES.items():
        entries.append(("rehearse", f"{experiment}.rate"))
        entries += [("rehearse", f"{experiment}.{distance}.{at}") for at in ("median", "p95") if distance]
    assert [key for stage, key in entries if not _has(project_rows[stage], key)] == []
    errors += ("e_position_about_rest", "e_tip_about_rest", "e_late_speed")
    for name in EXAMPLES:
        damping = rows[ROOT / "examples" / name / "limits.yaml"]["identify_damping"]
        assert [error for error in errors if not _has(damping, f"identified.{VALIDATE}.{error}")] == []
    for name, error in (("asl_motion", "e_position"), ("ftdcr", "e_tip_centred_rms")):
        stiffness = rows[ROOT / "examples" / name / "limits.yaml"]["identify_stiffness"]
        assert _has(stiffness, f"identified.{VALIDATE}.{error}")


def _has(rows, key):
    """Whether there is a row of a metric, in mm, % or neither; of a stage of one kind of experiment, over all of it."""
    keys = [key, key.replace("by_experiment.release.", "")]
    return any(f"{name}{unit}" in rows for name in keys for unit in ("", "_mm", "_pct"))


def test_the_rehearsal_s_block_says_of_what_it_is_and_which_goals_are_missed_or_that_nothing_is_committed(
    tmp_path, monkeypatch
):
    """Whether it is stale: test_provenance.py."""
    assert rehearsal_block(tmp_path) == "(no runs are committed yet)"
    monkeypatch.setattr("upkeep.readme.source_words", lambda root, metrics: f"of `{metrics['package']}`")
    row = {"runs": 200, "rate": 0.975, "low": 0.943, "high": 0.989, "causes": {"aim": 5}}
    row |= {"nearest_mm": {"median": 12.0, "p95": 21.0}, "variants": {"no preview": {**row, "runs": 40}}}
    goals = "rehearse:\n  reach.rate: {min: 0.97}\n  follow.rate: {better: higher, goal: 0.98}\n"
    metrics = {"package": "abc", "reach": row, "follow": row, "grasp": row}
    for name, text in {"tests/limits.yaml": goals, "artifacts/rehearse/metrics.json": json.dumps(metrics)}.items():
        (tmp_path / name).parent.mkdir(parents=True, exist_ok=True)
        (tmp_path / name).write_text(text)
    head, _, reach, variant, follow, _, grasp, _ = rehearsal_block(tmp_path).splitlines()
    assert head.startswith("| experiment, of `abc` |")
    assert reach == "| reach | 200 | 97.5 % | 94.3 to 98.9 % | ≥ 97 % | 12 / 21 | aim 5 |"
    assert follow.startswith("| follow | 200 | 97.5 % | 94.3 to 98.9 % | ≥ 98 % (missed) |")
    assert grasp.startswith("| grasp | 200 | 97.5 % | 94.3 to 98.9 % |  |")
    assert variant.startswith("| … no preview | 40 |")


def test_what_previews_state_stands_beside_what_came_true_and_its_goal():
    times = {"at_end": 3, "after_2s": 1, "after_10s": 0}
    preview = {
        "agreed": 39, "previews": 40, "agreement": 0.975, "path_pct_median": 1.9, "radius_mm": {"median": 2.3},
        "coverage": {name: {"runs": 42, "inside": inside, "share": inside / 42} for name, inside in times.items()},
        "tip_error_radii": {name: {"median": 4.0 - inside} for name, inside in times.items()},
    }  # fmt: skip
    goals = {"preview.coverage.at_end.share": Limit(better="higher", goal=0.9)}
    goals |= {"preview.agreement": Limit(min=0.95), "preview.path_pct_median": Limit(better="lower", goal=1.5)}
    _, _, radius, holds, path = preview_table(preview, goals).splitlines()
    what = "| reach: with nothing in the way, the tip ends within a radius (2.3 mm, median) in 9 of 10 cases: "
    assert radius.startswith(what)
    came = "3 of 42 / 1 of 42 / 0 of 42; it is 1 / 3 / 4 radii off, median"
    assert radius.endswith(f"10 s later | {came} | ≥ 0.9 (missed) / – / – |")
    assert holds.endswith("| 39 of 40 as predicted | ≥ 0.95 |")
    assert path.endswith("| 1.9 % of length off, median | ≤ 1.5 (missed) |")
    assert preview_table(None, goals) == ""
    preview["cameras"] = {"farther": 1} | {
        how: {"runs": 42, "inside": inside, "share": inside / 42} for how, inside in (("without", 20), ("with", 41))
    }
    goals["preview.cameras.with.share"] = Limit(better="higher", goal=0.98)
    corrected = preview_table(preview, goals).splitlines()[3]
    assert corrected.endswith("cameras | 20 of 42 / 41 of 42; 1 led farther off by 2 mm | ≥ 0.98 (missed) |")


def test_errors_of_starts_and_of_the_clock_are_against_the_truth(judged):
    lines = dict(line.strip("| ").split(" | ", 1) for line in error_table(judged).splitlines()[2:])
    assert lines["detected start of a release, late"] == "-2.00 ms | -5.00 ms | 2 trials, all splits"
    assert "detected start of a curl, late" not in lines, "the session has none"
    assert lines["clock of the motors against the cameras'"].split(" | ")[-2].strip(" |") == "2 ms"


def test_which_intervals_of_the_demo_session_hold_the_truth():
    """A change is to be seen: one that moves a parameter to the other side belongs into docs/results/intervals.md."""
    truth = json.loads((ROOT / TRUTH).read_text())
    verdicts = {name: holds(row, expectation(truth, name)) for name, row in identified(ROOT).items()}
    lacks = {"relaxation", "relaxation_time", "relaxation_2", "relaxation_time_2"}  # three branches, the model has two
    assert {name for name, verdict in verdicts.items() if verdict is None} == lacks
    assert {name for name, verdict in verdicts.items() if verdict is False} == set()
    assert len(verdicts) == 16 + len(lacks)


def test_no_stage_reads_the_truth():
    """Its file is named by the lab, which writes it, and by the generator of the docs; no folder that a stage depends
    on holds it, nor does the session."""
    naming = [
        path.relative_to(ROOT).as_posix()
        for folder in ("trunkline", "upkeep", "stages", "demo", "studies", "benchmarks", "qualification", "conf")
        for path in (ROOT / folder).rglob("*.*")
        if path.suffix in (".py", ".yaml") and "truth.json" in path.read_text(encoding="utf-8")
    ]
    assert sorted(naming) == ["demo/dvc.yaml", "demo/record.py", "upkeep/truth_table.py"]
    importing = [p.name for p in (ROOT / "upkeep").rglob("*.py") if "truth_table import" in p.read_text()]
    assert importing == ["readme.py"]
    stages = yaml.safe_load((ROOT / "dvc.yaml").read_text())["stages"]
    for name, stage in stages.items():
        for dep in stage["deps"]:
            session = dep.replace("${ingest.session}", "demo")
            assert not TRUTH.is_relative_to(session), f"{name}: {dep}"
