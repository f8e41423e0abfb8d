"""What surrounds a stage: whole outputs or none, one-line errors, the same bytes for the same results."""

import json
import subprocess
import sys

import matplotlib.pyplot as plt
import numpy as np
import pytest

from tests.support.folders import ROOT
from trunkline.compute.progress import progress
from trunkline.compute.threads import thread_count
from trunkline.errors import InputError
from trunkline.pipeline.stage import output_folder, write_json, write_metrics
from trunkline.report.figures.style import save_figure

STAGE = """
import numpy as np
from threadpoolctl import threadpool_info

from trunkline.settings import settings
from trunkline.errors import InputError
from trunkline.pipeline.stage import output_folder, run_stage

@settings
class Config:
    count: int

def main(config):
    print("BLAS threads:", {pool["num_threads"] for pool in threadpool_info() if pool["user_api"] == "blas"})
    with output_folder("artifacts/fit") as out:
        (out / "first.txt").write_text("half")
        if config.count > 1:
            raise InputError("log.mcap: found 2\\nthings,   expected 1")
        (out / "second.txt").write_text("done")

run_stage("fit", Config, main)
"""


@pytest.fixture
def run(tmp_path):
    (tmp_path / "fit.py").write_text(STAGE)
    (tmp_path / "conf" / "fit").mkdir(parents=True)
    (tmp_path / "conf" / "fit" / "config.yaml").write_text("count: ???\n")

    def run(count):
        (tmp_path / "params.yaml").write_text(f"fit:\n  count: {count}\n")
        command = [sys.executable, "-c", f"import sys; sys.path[0:0] = [{str(ROOT)!r}]; exec(open('fit.py').read())"]
        return subprocess.run(command, cwd=tmp_path, capture_output=True, text=True, check=False)

    return run


@pytest.fixture
def other_stage(tmp_path):
    """A stage beside `fit`, with a mistake in its settings; it says when it is imported."""
    (tmp_path / "dvc.yaml").write_text("stages: {fit: {cmd: x}, train: {cmd: x}}\n")
    (tmp_path / "conf" / "train").mkdir(parents=True)
    (tmp_path / "conf" / "train" / "config.yaml").write_text("{}\n")
    (tmp_path / "stages").mkdir()
    settings = "from trunkline.settings import settings\n\n\n@settings\nclass Config:\n    rate: float\n"
    (tmp_path / "stages" / "train.py").write_text(f"print('train is imported')\n{settings}")
    return "1\ntrain: {rtae: 1.0}"


def test_a_stage_alone_imports_no_other(run, other_stage, monkeypatch):
    monkeypatch.delenv("DVC_STAGE", raising=False)
    done = run(other_stage)
    assert done.returncode == 0, done.stderr
    assert "train is imported" not in done.stdout


def test_in_a_run_of_the_pipeline_the_settings_of_later_stages_are_checked_before_any_work(
    run, other_stage, monkeypatch, tmp_path
):
    monkeypatch.setenv("DVC_STAGE", "fit")
    done = run(other_stage)
    assert done.returncode == 1
    assert "params.yaml: train.rtae: unknown key, did you mean 'rate'" in done.stderr
    assert not (tmp_path / "artifacts").exists()


def test_a_stage_that_succeeds_writes_everything(run, tmp_path):
    done = run(1)
    assert done.returncode == 0, done.stderr
    assert sorted(file.name for file in (tmp_path / "artifacts/fit").iterdir()) == ["first.txt", "second.txt"]
    assert "peak memory" in done.stdout


def test_blas_keeps_to_one_thread(run, monkeypatch):
    monkeypatch.setenv("OPENBLAS_NUM_THREADS", "4")
    assert "BLAS threads: {1}" in run(1).stdout


def test_a_users_mistake_is_one_line_and_leaves_the_old_results(run, tmp_path):
    run(1)
    done = run(2)
    assert done.returncode == 1
    assert done.stderr == "error: log.mcap: found 2 things, expected 1\n"
    assert [path.name for path in (tmp_path / "artifacts").iterdir()] == ["fit"]
    assert (tmp_path / "artifacts/fit/second.txt").read_text() == "done"


def test_a_bad_setting_stops_before_any_work(run, tmp_path):
    done = run("many")
    assert done.returncode == 1
    assert done.stderr == "error: params.yaml: fit.count: found 'many', expected a valid integer\n"
    assert not (tmp_path / "artifacts").exists()


def test_a_killed_run_leaves_nothing_in_the_way(tmp_path):
    (tmp_path / ".fit.partial").mkdir()
    (tmp_path / ".fit.partial" / "stale.txt").touch()
    with output_folder(tmp_path / "fit") as out:
        (out / "fresh.txt").touch()
    assert sorted(path.name for path in tmp_path.rglob("*")) == ["fit", "fresh.txt"]


def test_json_is_sorted_rounded_and_free_of_numpy(tmp_path):
    write_json(tmp_path / "a.json", {"b": np.float64(0.1) + 0.2, "a": np.arange(2), "c": np.bool_(True), "d": None})
    assert (tmp_path / "a.json").read_text().index('"a"') < (tmp_path / "a.json").read_text().index('"b"')
    assert json.loads((tmp_path / "a.json").read_text()) == {"a": [0, 1], "b": 0.3, "c": True, "d": None}


def test_metrics_have_four_significant_digits_and_counts_have_all(tmp_path):
    write_metrics(tmp_path, {"e_tip_mm": 13.14159, "small": 1.23456e-7, "frames": 123456, "by": {"kind": [0.99994]}})
    written = {"e_tip_mm": 13.14, "small": 1.235e-7, "frames": 123456, "by": {"kind": [0.9999]}}
    assert json.loads((tmp_path / "metrics.json").read_text()) == written


@pytest.mark.parametrize("bad", [float("nan"), np.inf, np.array([1.0, np.nan])])
def test_json_refuses_what_is_not_finite_by_name(tmp_path, bad):
    with pytest.raises(InputError, match=r"errors\.tip.*expected a finite number"):
        write_json(tmp_path / "a.json", {"errors": {"tip": bad}})
    assert not (tmp_path / "a.json").exists()


def test_figures_are_the_same_bytes_for_the_same_data(tmp_path):
    for name in "ab":
        figure, axes = plt.subplots()
        axes.plot([1, 3, 2], label="x")
        axes.legend()
        save_figure(figure, tmp_path / f"{name}.png")
    assert (tmp_path / "a.png").read_bytes() == (tmp_path / "b.png").read_bytes()
    assert not plt.get_fignums()


def test_threads_come_from_the_environment(monkeypatch):
    monkeypatch.setenv("TRUNKLINE_THREADS", "3")
    assert thread_count() == 3
    monkeypatch.delenv("TRUNKLINE_THREADS")
    assert thread_count() >= 1


@pytest.mark.parametrize("bad", ["0", "-1", "two", "1.5", "²"])
def test_a_bad_thread_count_is_refused(monkeypatch, bad):
    monkeypatch.setenv("TRUNKLINE_THREADS", bad)
    with pytest.raises(InputError, match="TRUNKLINE_THREADS: found"):
        thread_count()


def test_the_first_and_the_last_line_of_progress_come_once(capsys, monkeypatch):
    monkeypatch.setattr("trunkline.compute.progress.PLAIN_INTERVAL", 0.0)
    with progress(2, "fit", "generations") as bar:
        bar.update(1)
        bar.update(1)
    assert [line.split()[1] for line in capsys.readouterr().out.splitlines()] == ["0/2", "1/2", "2/2"]


def test_a_total_that_changes_is_told_from_then_on(capsys, monkeypatch):
    monkeypatch.setattr("trunkline.compute.progress.PLAIN_INTERVAL", 0.0)
    with progress(2, "fit", "iterations") as bar:
        bar.expect(1)
        bar.update(1)
        bar.update(1)
        bar.expect(-1)
    shown = [line.split("  ")[0] for line in capsys.readouterr().out.splitlines()]
    assert shown == ["fit: 0/2 iterations (0 %)", "fit: 1/3 iterations (33 %)", "fit: 2/3 iterations (67 %)",
                     "fit: 2/2 iterations (100 %)"]


def test_on_a_terminal_a_total_that_changes_is_told_too(monkeypatch):
    monkeypatch.setattr("sys.stdout.isatty", lambda: True, raising=False)
    with progress(0, "fit", "iterations") as bar:
        bar.expect(3)
        bar.update(2)
        bar.expect(-1)
        task = bar._bar.tasks[0]
        assert (task.completed, task.total) == (2, 2)


def test_without_a_terminal_progress_ends_in_a_plain_line(capsys):
    with progress(4, "fit", "generations") as bar:
        for loss in (3.0, 2.0, 1.0, 0.51239):
            bar.update(1, best=loss)
    out = capsys.readouterr().out
    assert out.startswith("fit: 0/4 generations (0 %)\nfit: 4/4 generations (100 %)  best 0.5124  generations/s")
    assert out.count("\n") == 2
    assert "\x1b" not in out
