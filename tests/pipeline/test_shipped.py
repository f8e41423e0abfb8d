"""The model that is shipped is scored on every kind of trial that its session has."""

import json

import pytest
import yaml

from tests.support.folders import ROOT
from trunkline.identification.fit.settings import IdentificationSettings
from trunkline.identification.stages import STAGES, model_name
from trunkline.pipeline.config import load_config
from trunkline.recordings.trials.experiments import EXPERIMENTS, is_static

PIPELINES = [ROOT, *sorted(file.parent for file in ROOT.glob("examples/*/dvc.yaml"))]


@pytest.mark.parametrize("folder", PIPELINES, ids=lambda folder: folder.name)
def test_the_last_stage_reports_every_kind_of_its_session(folder):
    last = yaml.safe_load((folder / "params.yaml").read_text())["score"]["stages"][-1]
    quality = json.loads((folder / "artifacts/ingest/quality.json").read_text())
    kinds = {trial["experiment"] for trial in quality["trials"].values()}
    assert kinds <= set(load_config(IdentificationSettings, last, folder).reported)


def test_the_last_stage_reports_every_kind_there_is():
    """Also those that the demo session lacks. The stage before it, all but those in which motors move the arm."""
    reported = [set(load_config(IdentificationSettings, stage, ROOT).reported) for stage in STAGES[1:]]
    assert reported[1] == set(EXPERIMENTS)
    assert reported[0] == {name for name, kind in EXPERIMENTS.items() if is_static(name) or not kind.needs_motors}


def test_only_the_last_of_the_stages_has_no_word_beside_its_name():
    assert [model_name(stage, STAGES) for stage in STAGES] == [
        "identify_stiffness (intermediate model)", "identify_damping (intermediate model)", "identify_control"
    ]  # fmt: skip
    assert model_name(STAGES[0], STAGES[:1]) == STAGES[0]
