"""`trunkline batch`: a table and a picture over arms, and pipelines that run in folders of their
own."""

import json
import shutil
from pathlib import Path

import numpy as np
import pandas as pd
import pytest
import yaml

from tests.support.sessions import all_truths, instruments, record
from trunkline.errors import InputError
from trunkline.pipeline.config import PROJECT
from trunkline.tools.batch.__main__ import main
from trunkline.tools.batch.running import needed

EXAMPLES = PROJECT / "examples"


def listing(folder: Path, arms: list[dict], **more) -> Path:
    path = folder / "list.yaml"
    path.write_text(yaml.safe_dump({"arms": arms, **more}))
    return path


def aged(folder: Path, share: float) -> Path:
    """A pipeline that has run on the ASL Trunk, its damping `share` times what it was."""
    shutil.copytree(EXAMPLES / "asl_trunk/artifacts", folder / "artifacts")
    file = folder / "artifacts/identify_damping/parameters.json"
    table = json.loads(file.read_text())
    row = table["parameters"]["damping"]
    row["value"] *= share
    row["interval_95_given_model"] = [share * end for end in row["interval_95_given_model"]]
    file.write_text(json.dumps(table))
    return folder


def test_a_table_and_a_picture_over_arms_that_have_run(tmp_path, capsys):
    arms = [{"name": name, "folder": str(EXAMPLES / name)} for name in ("asl_trunk", "pairs", "ftdcr")]
    path = listing(tmp_path, arms, reference="none")
    assert main([str(path), "--out", str(tmp_path / "out"), "--only-table"]) == 0
    output = capsys.readouterr().out
    scored = json.loads((EXAMPLES / "pairs/artifacts/score/metrics.json").read_text())
    errors = next(iter(scored.values()))["identified"]["test"]
    pair = f"{errors['e_position_mm']:.3g} / {errors['e_tip_mm']:.3g}"
    assert f"| pairs | {errors['trials']} of `test` | {pair} |" in output
    table = pd.read_csv(tmp_path / "out/fleet.csv")
    assert set(table.arm) == {"asl_trunk", "pairs", "ftdcr"}
    assert table.drift.isna().all()
    assert (tmp_path / "out/fleet.md").read_text().strip() in output
    assert (tmp_path / "out/fleet.png").stat().st_size > 20_000


@pytest.mark.parametrize(("share", "is_beyond"), [(2.0, True), (1.05, False)])
def test_a_drift_is_told_apart_where_it_is_larger_than_both_intervals(tmp_path, capsys, share, is_beyond):
    arms = [{"name": "spring", "folder": str(EXAMPLES / "asl_trunk")},
            {"name": "autumn", "folder": str(aged(tmp_path / "autumn", share))}]  # fmt: skip
    assert main([str(listing(tmp_path, arms)), "--out", str(tmp_path / "out"), "--only-table"]) == 0
    row = next(line for line in capsys.readouterr().out.splitlines() if line.startswith("| `damping`"))
    assert ("**" in row) == is_beyond
    table = pd.read_csv(tmp_path / "out/fleet.csv")
    row = table[(table.arm == "autumn") & (table.name == "damping")].iloc[0]
    assert row.drift == pytest.approx(np.log(share), rel=1e-4)
    assert row.since == "spring"


def test_pipelines_run_in_folders_of_their_own_go_on_and_one_that_fails_stops_no_other(tmp_path, capsys):
    record(tmp_path / "good", all_truths(), instruments())
    shutil.copytree(tmp_path / "good", tmp_path / "bad")
    (tmp_path / "bad/session.yaml").write_text("trials: none\n")
    for seed, name in enumerate(("a", "b"), 1):
        record(tmp_path / "both" / name, all_truths(), instruments(), seed)
    arms = [{"name": name, "session": name} for name in ("bad", "good", "both")]
    words = [str(listing(tmp_path, arms)), "--out", str(tmp_path / "out"), "--until", "ingest"]
    assert main(words) == 1
    output = capsys.readouterr()
    assert "batch: good: done after" in output.out
    failed = [line for line in output.err.splitlines() if "failed" in line]
    assert len(failed) == 1
    assert "batch: bad: failed: data/raw/bad/session.yaml: " in failed[0]
    log = tmp_path / "out/good/fleet.log"
    assert json.loads((tmp_path / "out/good/artifacts/ingest/metrics.json").read_text())["trials"] == 4
    assert json.loads((tmp_path / "out/both/artifacts/ingest/metrics.json").read_text())["trials"] == 8
    shutil.copy(tmp_path / "good/session.yaml", tmp_path / "bad/session.yaml")
    assert main(words) == 0
    assert "didn't change, skipping" in log.read_text()


@pytest.mark.parametrize(
    ("arms", "message"),
    [
        ([], "arms: found none, expected at least one"),
        ([{"name": "a"}], "found neither of session and folder, expected one of the two for 'a'"),
        ([{"name": "a", "session": "nowhere"}], "list.yaml: a: session: found no session.yaml in"),
        ([{"name": "a", "folder": str(EXAMPLES / "pairs"), "since": "b"}], "found 'b', expected one of a"),
        ([{"name": "a", "folder": str(EXAMPLES / "pairs")}] * 2, "arms: found 'a' twice, expected each name once"),
        ([{"name": "a", "folder": "x", "sesion": "y"}], "sesion"),
    ],
)
def test_a_mistake_in_the_list_is_one_line(tmp_path, capsys, arms, message):
    assert main([str(listing(tmp_path, arms)), "--only-table"]) == 1
    errors = capsys.readouterr().err.splitlines()
    assert len(errors) == 1
    assert message in errors[0]


def test_only_what_a_stage_needs_is_run():
    stages = yaml.safe_load((PROJECT / "dvc.yaml").read_text())["stages"]
    assert list(needed(stages, "filter", PROJECT)) == ["ingest", "filter", "build_mjcf"]
    assert "train_ik" not in needed(stages, "score", PROJECT)
    with pytest.raises(InputError, match="--until: found 'scor', expected a stage of .*did you mean 'score'"):
        needed(stages, "scor", PROJECT)
