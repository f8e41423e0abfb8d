"""docs/teleoperation.md: its diagram is the table, and its settings compose."""

import shutil
from pathlib import Path

import pytest
from omegaconf import OmegaConf

from trunkline.ar.teleop.config import TeleoperationConfig
from trunkline.ar.teleop.transitions import TRANSITIONS
from trunkline.errors import InputError
from trunkline.pipeline.config import PROJECT, SHARED, load_folder
from upkeep.state_diagram import diagram

PAGE = (Path(__file__).parents[3] / "docs/teleoperation.md").read_text(encoding="utf-8")


def test_diagram_is_that_of_the_table():
    assert f"```mermaid\n{diagram()}\n```" in PAGE
    for (mode, event), after in TRANSITIONS.items():
        assert f"{mode} --> {after}: {event}" in PAGE or event in ("stop", "lost")


def test_settings_compose_and_a_typo_is_one_line(tmp_path):
    assert load_folder(TeleoperationConfig, PROJECT / "conf/teleop").core.rigid_hand in ("left", "right")
    for room in ("teleop", SHARED):
        shutil.copytree(PROJECT / "conf" / room, tmp_path / room)
    core = tmp_path / SHARED / "core/two_rays.yaml"
    text = core.read_text()
    core.write_text(text.replace("look_back: 0.1", "look_back: 9.0"))
    with pytest.raises(InputError, match=r"core\.look_back: found 9"):
        load_folder(TeleoperationConfig, tmp_path / "teleop")
    core.write_text(text.replace("start: 0.6 ", "start: 9.0 "))
    with pytest.raises(InputError, match=r"rays\.start: found 9"):
        load_folder(TeleoperationConfig, tmp_path / "teleop")


def test_the_mount_is_as_far_from_the_flange_everywhere():
    """In teleoperation, in the maps and in the package: each has its own settings."""
    read = lambda file: OmegaConf.load(PROJECT / file)  # noqa: E731
    places = {
        "teleop": read("conf/teleop/config.yaml").mount_offset,
        "reachability": read("params.yaml").reachability.rigid.mount_offset,
        "robot": read("conf/shared/robot/panda.yaml").mount_offset,
    }
    assert len(set(places.values())) == 1, places
