"""The study of recovery: its settings are those that its stages take, and the lab's are of the cousin."""

from demo.plants.cousin import CousinSettings
from demo.record import Config
from studies.recovery import set_up
from trunkline.pipeline.config import check_settings, load_config, settings_of


def test_its_settings_are_the_cousin_s_and_are_checked(tmp_path):
    stages = set_up(tmp_path)
    assert check_settings(tmp_path) == sorted(stages)
    lab = load_config(Config, "record", tmp_path / "demo")
    assert isinstance(lab.plant, CousinSettings)
    assert (lab.experiments.pulls, lab.experiments.motions, lab.experiments.loads) == ([], [], [])
    kinds = [settings_of(stage, tmp_path).experiments for stage in stages if stage.startswith("identify_")]
    assert kinds == [["static_tilt"], ["release"], ["curl"]], "a kind that the table lacks has no trials"
