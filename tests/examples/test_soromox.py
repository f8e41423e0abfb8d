"""The soft tentacle under known forces, declared: which poses are for what, and what its motors pull with."""

import numpy as np
import pytest
import yaml

from stages.build_mjcf import Config, cad_arm
from tests.support.folders import ROOT
from trunkline.model.arm_model import ArmModel
from trunkline.pipeline.config import load_config
from trunkline.recordings.session.session import Session
from trunkline.recordings.trials.splits import IDENTIFY, TEST, VALIDATE

EXAMPLE = ROOT / "examples/soromox"


@pytest.fixture(scope="module")
def session() -> Session:
    return Session.model_validate(yaml.safe_load((EXAMPLE / "session.yaml").read_text()))


def torques(session: Session, split: str) -> np.ndarray:
    """Of each trial, N m. Shape (T, 2)."""
    layouts = [session.layout_of(trial) for trial in session.trials if trial.split == split]
    return np.array([[layout.commands[name].value for name in ("m1", "m2")] for layout in layouts])


def test_poses_under_both_motors_are_sealed(session):
    assert {split: len(torques(session, split)) for split in (IDENTIFY, VALIDATE, TEST)} == {
        IDENTIFY: 8, VALIDATE: 6, TEST: 8,
    }  # fmt: skip
    assert sorted(torques(session, IDENTIFY).max(axis=1).tolist()) == [0.1, 0.1, 0.15, 0.15, 0.2, 0.2, 0.25, 0.25]
    assert sorted(torques(session, VALIDATE).max(axis=1).tolist()) == [0.05, 0.05, 0.12, 0.12, 0.18, 0.18]
    for split in (IDENTIFY, VALIDATE):
        assert (torques(session, split).min(axis=1) == 0).all()
    assert (torques(session, TEST) > 0).all()


def test_torques_are_tensions_within_the_motors_range(session, monkeypatch):
    monkeypatch.chdir(EXAMPLE)
    model = cad_arm(load_config(Config, "build_mjcf")).spec.compile()
    arm, (names, scale) = ArmModel(model), session.coupling()
    assert (list(names), session.command_unit, arm.command_unit) == (arm.cable_names, "N", "N")
    most = torques(session, IDENTIFY).max() * scale.max()
    assert most == pytest.approx(0.25 / 0.0325)
    assert most < model.actuator_ctrlrange[0, 1]


def test_each_marker_has_columns_of_its_own_in_each_file(session):
    for trial in session.trials:
        columns = [column for body in session.layout_of(trial).bodies.values() for column in body.position]
        assert sorted(columns) == list(range(3, 18))
