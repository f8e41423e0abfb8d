"""Where arms rest freely: a base askew to the arm is said, and a trial that rests as with another vertical."""

from dataclasses import replace

import numpy as np
import pytest
from scipy.spatial.transform import Rotation

from tests.recordings.cleaning.test_described_arm import FREE, TILTS, checked, quiet
from tests.support.sessions import record, release_truth, static_truth
from trunkline.frames import rotation_from_wxyz, wxyz_from_rotation

TILTED = [*TILTS, static_truth(45.0, "validate"), release_truth()]


def warned(folder, truths) -> dict[str, list[str]]:
    """What is said of each trial's base and vertical."""
    record(folder, truths, replace(quiet(), up=(0.0, 0.0, 1.0), heading_deg=0.0))
    gathered = checked(folder)
    assert gathered.refused == {}
    return {
        raw.name: [line for line in record_.warnings if line.startswith(("base:", "up:"))]
        for raw, record_ in zip(gathered.raw_trials, gathered.findings, strict=True)
    }


def askew(truth, axis, degrees):
    """Its base's axes turned in themselves."""
    turn = rotation_from_wxyz(truth.base_quaternion) * Rotation.from_euler(axis, degrees, degrees=True)
    return replace(truth, base_quaternion=wxyz_from_rotation(turn))


@pytest.mark.parametrize(("axis", "degrees", "doubtful"), [("x", 15, True), ("y", -15, True), ("x", 4, False)])
def test_a_base_askew_to_the_arm_is_said(tmp_path, axis, degrees, doubtful):
    lines = warned(tmp_path, [askew(truth, axis, degrees) for truth in TILTED])
    expected = "base: in the axes of 'base' the arm rests "
    assert {name: [line.startswith(expected) for line in some] for name, some in lines.items()} == {
        truth.name: [True] * doubtful for truth in TILTED
    }


@pytest.mark.parametrize("which", [0, 4])
def test_a_trial_in_a_frame_that_is_turned_is_said(tmp_path, which):
    """As of cameras that were calibrated anew, with another axis up."""
    turn = Rotation.from_euler("x", 90, degrees=True)
    truth = TILTED[which]
    turned = replace(
        truth,
        name=f"{truth.name}_turned",
        base_position=turn.apply(truth.base_position),
        base_quaternion=wxyz_from_rotation(turn * rotation_from_wxyz(truth.base_quaternion)),
        positions=turn.apply(truth.positions.reshape(-1, 3)).reshape(truth.positions.shape),
        quaternions=wxyz_from_rotation(turn * rotation_from_wxyz(truth.quaternions.reshape(-1, 4))).reshape(
            truth.quaternions.shape
        ),
    )
    lines = warned(tmp_path, [*TILTED, turned])
    (line,) = lines.pop(turned.name)[-1:]
    assert "from where the other trials have it with [0, 0, 1] up, " in line
    assert "with [0, -1, 0]: are its poses in another frame" in line
    assert not any(lines.values())


def test_an_honest_session_has_nothing_said(tmp_path):
    """Nor one of an arm that is bent a little by itself, or in which nothing but hanging was recorded."""
    assert not any(warned(tmp_path / "whole", TILTED).values())
    assert not any(warned(tmp_path / "hanging", [FREE[0], FREE[-1]]).values())
    rng = np.random.default_rng(0)
    crooked = [askew(truth, "x", 3 + rng.normal(scale=0.5)) for truth in TILTED]
    assert not any(warned(tmp_path / "crooked", crooked).values())
