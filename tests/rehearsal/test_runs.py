"""Which runs are made, that a stopped rehearsal goes on, and what its rows are of."""

import re
import shutil
import subprocess
from dataclasses import replace
from pathlib import Path
from types import SimpleNamespace

import pytest
from matplotlib.image import imread

from rehearsal import __main__ as command
from rehearsal import runs
from rehearsal.experiments.result import Result, append_result, read_results, summary
from rehearsal.report import draw
from rehearsal.runs import Run, RunSource, make, make_one, source_of, wanted
from trunkline.ar.preview.package import only_package
from trunkline.errors import InputError
from upkeep.limits import Limit
from upkeep.rehearsal_table import rehearsal_table

ROOT = Path(__file__).parents[2]
SOURCE = RunSource("package", "code")


@pytest.fixture
def made(monkeypatch):
    """Runs without a robot: the seeds that were made, with the bench's own."""
    seeds = []

    def touch(bench, seed):
        if seed == 7:
            raise FloatingPointError("diverged")
        seeds.append((bench.name, seed))
        return Result("touch", seed, seed % 2 == 0, "" if seed % 2 == 0 else "aim: beside it", nearest_mm=seed), []

    monkeypatch.setattr(runs, "EXPERIMENTS", {"touch": touch})
    monkeypatch.setattr(runs, "perform", lambda run: run)
    monkeypatch.setitem(runs.VARIANTS, "touch", {"off by 5 mm": lambda bench: SimpleNamespace(name="off")})
    monkeypatch.setattr(runs, "bench_of", lambda package: SimpleNamespace(name="own"))
    return seeds


def test_a_stopped_rehearsal_goes_on(made, tmp_path):
    table = tmp_path / "runs.csv"
    make(wanted({"touch": 3}, 0), Path("package.tgz"), SOURCE, table, workers=1)
    results = make(wanted({"touch": 5}, 2), Path("package.tgz"), SOURCE, table, workers=1)
    assert made == [("own", 0), ("own", 1), ("own", 2), ("own", 3), ("own", 4), ("off", 0), ("off", 1)]
    rows = [(result.seed, result.variant) for result in results]
    assert rows == [(0, ""), (1, ""), (2, ""), (3, ""), (4, ""), (0, "off by 5 mm"), (1, "off by 5 mm")]
    assert len(make(wanted({"touch": 2}, 0), Path("package.tgz"), SOURCE, table, workers=1)) == 2  # as asked, no more


def test_a_rehearsal_says_how_long_it_takes_after_one_run_of_each(made, tmp_path, monkeypatch, capsys):
    times = iter([0.0, 120.0])
    monkeypatch.setattr(command.time, "monotonic", lambda: next(times))
    table = tmp_path / "runs.csv"
    make([Run("touch", 0)], Path("package.tgz"), SOURCE, table, workers=1)
    results = command.make_timed(wanted({"touch": 5}, 0), Path("package.tgz"), SOURCE, table, workers=1)
    assert [result.seed for result in results] == [0, 1, 2, 3, 4]
    lines = capsys.readouterr().out.splitlines()
    assert "4 of 5 runs to make, 1 side by side" in lines[1]
    assert "3 more runs, about 6 min" in lines


def test_a_stopped_rehearsal_has_about_as_many_runs_of_each():
    chosen = wanted({"reach": 2, "follow": 3}, 2)
    plain = [("reach", 0), ("follow", 0), ("reach", 1), ("follow", 1), ("follow", 2)]
    assert chosen[:5] == [Run(name, seed) for name, seed in plain]
    assert [run.seed for run in chosen[5:]] == sorted(run.seed for run in chosen[5:])
    assert {run.experiment for run in chosen[5 : 5 + len(chosen[5:]) // 2]} == {"reach", "follow"}


@pytest.mark.parametrize("other", [replace(SOURCE, package="another"), replace(SOURCE, code="another")])
def test_rows_of_another_package_or_code_do_not_count(made, tmp_path, other):
    table = tmp_path / "runs.csv"
    make([Run("touch", 0)], Path("package.tgz"), SOURCE, table, workers=1)
    (result,) = make([Run("touch", 0)], Path("package.tgz"), other, table, workers=1)
    assert len(made) == 2
    assert (result.package, result.code) == (other.package, other.code)
    assert len(read_results(table)) == 2


def test_rows_of_another_table_are_taken_where_code_and_package_are_the_same(made, tmp_path):
    """Those that are asked for and that the table lacks, and each once."""
    table, other = tmp_path / "runs.csv", tmp_path / "other.csv"
    for seed, source in enumerate([SOURCE, SOURCE, replace(SOURCE, package="b"), replace(SOURCE, code="c"), SOURCE]):
        append_result(other, Result("touch", seed, True, package=source.package, code=source.code, tip_mm=2.0))
    append_result(table, Result("touch", 0, True, package=SOURCE.package, code=SOURCE.code, tip_mm=1.0))
    for _ in range(2):
        results = make(wanted({"touch": 4}, 0), Path("package.tgz"), SOURCE, table, workers=1, others=[other, other])
    assert [(row.seed, row.tip_mm) for row in results[:2]] == [(0, 1.0), (1, 2.0)]
    assert [seed for _, seed in made] == [2, 3]
    assert len(read_results(table)) == 4


def test_a_run_that_breaks_off_has_failed(made):
    result, _ = make_one(SimpleNamespace(name="own"), Run("touch", 7, "off by 5 mm"))
    assert (result.success, result.cause) == (False, "error: FloatingPointError: diverged")
    assert result.variant == "off by 5 mm"


def test_rates_are_told_by_experiment_and_variant(made, tmp_path):
    results = make(wanted({"touch": 4}, 2), Path("package.tgz"), SOURCE, tmp_path / "runs.csv", workers=1)
    metrics = summary(results)["touch"]
    assert (metrics["runs"], metrics["successes"], metrics["rate"], metrics["causes"]) == (4, 2, 0.5, {"aim": 2})
    assert 0.1 < metrics["low"] < 0.5 < metrics["high"] < 0.9
    assert metrics["nearest_mm"] == {"median": pytest.approx(1.5), "p95": pytest.approx(2.85)}
    assert "tip_mm" not in metrics, "it was never measured"
    assert metrics["variants"]["off by 5 mm"]["runs"] == 2
    table = rehearsal_table({"package": "abc", "touch": metrics}, {"touch.rate": Limit(min=0.9)}, "of a test", True)
    rows = [[cell.strip() for cell in line.strip("|").split("|")] for line in table.splitlines()[2:]]
    assert rows[0][:3] == ["touch", "4", "50 %"]
    assert rows[0][4] == "≥ 90 % (missed)"
    assert rows[0][6] == "aim 2"
    assert rows[1][0] == "… off by 5 mm"


def test_clean_reaches_are_counted_among_those_that_were_judged():
    rows = [Result("reach", seed, True, clean=clean) for seed, clean in enumerate((1.0, 1.0, 0.0, float("nan")))]
    metrics = summary(rows)["reach"]
    assert {name: metrics["clean"][name] for name in ("runs", "successes", "rate")} == {
        "runs": 3, "successes": 2, "rate": pytest.approx(2 / 3),
    }  # fmt: skip
    assert 0.2 < metrics["clean"]["low"] < 0.3 < 0.9 < metrics["clean"]["high"] < 0.95
    table = rehearsal_table({"reach": metrics}, {}, "of a test", False).splitlines()
    words = "… tip within 20 mm, and no other part touched anything"
    assert table[3].startswith(f"| {words} | 3 | 66.7 % | 20.8 to 93.9 % |")
    assert "clean" not in summary([Result("follow", 0, True)])["follow"]


def test_the_table_is_in_the_paper_s_order_and_names_frequent_causes_first():
    metrics = {"runs": 9, "rate": 0.5, "low": 0.2, "high": 0.8, "causes": {"aim": 1, "missed": 4}}
    tables = {"follow": metrics, "handle": metrics, "package": "abc", "reach": metrics}
    table = rehearsal_table(tables, {}, "of a test", True)
    rows = table.splitlines()[2:]
    assert [row.split(" | ")[0] for row in rows] == ["| reach", "| follow", "| handle"]
    assert all(row.endswith("| missed 4, aim 1 |") for row in rows)


@pytest.fixture
def checkout(tmp_path):
    """What dvc.yaml of the rehearsal names, with a package whose manifest says nothing of other files."""
    folder = tmp_path / "checkout"
    for name in ("rehearsal", "demo", "trunkline", "conf/teleop", ".dvc/config", "params.yaml", "versions.yaml"):
        (folder / name).parent.mkdir(parents=True, exist_ok=True)
        copy = shutil.copytree if (ROOT / name).is_dir() else shutil.copy
        copy(ROOT / name, folder / name)
    subprocess.run(["git", "init", "-q"], cwd=folder, check=True)
    return folder


def test_the_code_of_runs_is_what_the_stage_depends_on(checkout, monkeypatch):
    monkeypatch.chdir(checkout)
    monkeypatch.setattr(runs, "read_files", lambda package: {})
    monkeypatch.setattr(runs, "package_digest", lambda files: "0123456789abcdef")
    before = source_of(Path("package.tgz"))
    assert re.fullmatch("[0-9a-f]{12}", before.code)
    assert before.package == "0123456789ab"

    def after(name, old, new):
        text = (checkout / name).read_text()
        assert old in text
        (checkout / name).write_text(text.replace(old, new, 1))
        return source_of(Path("package.tgz"))

    assert after("rehearsal/params.yaml", "reach: ", "reach: 1") == before, "how many runs there are changes none"
    assert after("rehearsal/report.py", "success", "successes") == before
    assert after("rehearsal/conf/rehearse/robot/stand_in.yaml", "\n", "\n# a comment\n") == before
    settings = after("rehearsal/conf/rehearse/robot/stand_in.yaml", "azimuth: 0.0", "azimuth: 0.1")
    code = after("trunkline/ar/teleop/core.py", "\n", "\n# edited\n")
    assert len({before.code, settings.code, code.code}) == 3


def test_the_picture_names_who_failed_and_who_did_not(tmp_path):
    rows = [Result("reach", seed, True, nearest_mm=9.0) for seed in range(3)]
    rows += [Result("grasp", seed, False, "slip: out of the coil", variant="CAD") for seed in range(2)]
    draw(rows, tmp_path / "some.png")
    draw(rows[:3], tmp_path / "none.png")
    some, none = (imread(tmp_path / f"{name}.png") for name in ("some", "none"))
    assert some.shape[0] > none.shape[0], "a line each"


def test_without_a_package_there_is_one_line(tmp_path):
    with pytest.raises(InputError, match="found 0 packages .* `make demo` makes it"):
        only_package(tmp_path)
    for name in ("a.tgz", "b.tgz"):
        (tmp_path / name).touch()
    with pytest.raises(InputError, match="found 2 packages"):
        only_package(tmp_path)
