"""What sensors add to the truth: each noise as large as it is set, on what it is of, and on nothing else."""

from dataclasses import fields

import numpy as np
import pytest
from scipy.spatial.transform import Rotation

from rehearsal.robot.kernel import COLUMNS, JOINTS, OBJECT, TIP, TIP_AXES, WOUND
from rehearsal.robot.sensors import Instruments, Sensors
from trunkline.frames import wxyz_from_rotation

READINGS = 400
EXACT = {field.name: 0.0 for field in fields(Sensors)}
TURN = Rotation.from_rotvec([0.3, -0.5, 1.1])


def row() -> np.ndarray:
    """What the robot keeps of an instant."""
    values = np.arange(COLUMNS, dtype=float) / COLUMNS
    values[TIP_AXES] = TURN.as_matrix().ravel()
    values[OBJECT] = [0.5, 0.1, 0.2, *wxyz_from_rotation(TURN)]
    return values


def read(**sensors: float) -> dict[str, np.ndarray]:
    """By name, by how much readings are beside the truth in the base frame, (READINGS, n): m, rad."""
    truth, instruments = row(), Instruments(Sensors(**{**EXACT, **sensors}), np.random.default_rng(0))
    readings, back = [instruments.read(truth, truth, 0.0, 0.0) for _ in range(READINGS)], instruments.turn.inv()

    def values(name: str) -> np.ndarray:
        return np.array([getattr(reading, name) for reading in readings])

    def turned(name: str) -> np.ndarray:
        return (back * Rotation.from_quat(values(name), scalar_first=True) * TURN.inv()).as_rotvec()

    return {
        "joints": values("joints") - truth[JOINTS],
        "wound": values("wound") - truth[WOUND],
        "tip": back.apply(values("tip") - instruments.shift) - truth[TIP],
        "object": back.apply(values("object") - instruments.shift) - truth[OBJECT][:3],
        "tip_turn": turned("tip_quaternion"),
        "object_turn": turned("object_quaternion"),
    }


@pytest.mark.parametrize(("sensor", "set_to", "noisy"), [
    ("joint_noise", 1e-3, {"joints": 1e-3}),
    ("wound_noise_mm", 0.5, {"wound": 5e-4}),
    ("position_noise_mm", 0.3, {"tip": 3e-4, "object": 3e-4}),
    ("orientation_noise_deg", 0.3, {"tip_turn": np.radians(0.3), "object_turn": np.radians(0.3)}),
    ("alignment_mm", 30.0, {}),
    ("alignment_deg", 20.0, {}),
])  # fmt: skip
def test_a_noise_is_as_large_as_it_is_set_along_each_axis_and_on_nothing_else(sensor, set_to, noisy):
    for name, off in read(**{sensor: set_to}).items():
        if name in noisy:
            np.testing.assert_allclose(off.std(axis=0), noisy[name], rtol=0.2)
            assert (np.abs(off.mean(axis=0)) < 5 * noisy[name] / np.sqrt(READINGS)).all()
        else:
            np.testing.assert_allclose(off, 0, atol=1e-12)


def test_the_frame_is_off_by_as_much_as_is_set():
    instruments = Instruments(Sensors(**{**EXACT, "alignment_mm": 3.0, "alignment_deg": 0.5}), np.random.default_rng(0))
    assert np.linalg.norm(instruments.shift) == pytest.approx(0.003)
    assert np.degrees(instruments.turn.magnitude()) == pytest.approx(0.5)
