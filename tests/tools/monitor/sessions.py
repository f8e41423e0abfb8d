"""Sessions of a small arm's tilts as a lab records them: logs and a session.yaml."""

from pathlib import Path

import mujoco
import numpy as np
from scipy.spatial.transform import Rotation

from demo.truth import Truth
from tests.support import sessions
from tests.support.matched_plant import mjcf_of, small_model, tilt
from trunkline.frames import rotation_from_wxyz, wxyz_from_rotation

UNITS = 4
TILTS = (35.0, 50.0, 65.0, 80.0)
SECONDS, RATE = 1.0, 480.0


def write_model(path: Path, prefix: str = "unit_") -> Path:
    """prefix: of the units' names."""
    path.write_text(mjcf_of(small_model(UNITS)).replace("unit_", prefix))
    return path


def softened(share: float) -> mujoco.MjModel:
    model = small_model(UNITS)
    model.jnt_stiffness[:] *= share
    return model


def record(folder: Path, share: float, repeats: int, seed: int) -> Path:
    """Tilts of an arm of `share` times the stiffness, each `repeats` times, as a session."""
    model, frames = softened(share), int(SECONDS * RATE)
    truths = [_truth(model, angle, f"tilt_{angle:.0f}_{i}", frames) for i in range(repeats) for angle in TILTS]
    sessions.record(folder, truths, sessions.instruments(), seed)
    return folder


def _truth(model: mujoco.MjModel, angle: float, name: str, frames: int) -> Truth:
    trial = tilt(model, angle)
    assert trial.quaternions is not None
    base = Rotation.from_euler("y", angle, degrees=True)
    turned = base * rotation_from_wxyz(trial.quaternions[0])
    place = np.array([0.2, -0.1, 1.5])
    return Truth(
        name=name, experiment="static_tilt", split="identify", level=angle, time=np.arange(frames) / RATE,
        base_position=place, base_quaternion=wxyz_from_rotation(base), markers=trial.markers,
        positions=np.tile(place + base.apply(trial.positions[0]), (frames, 1, 1)),
        quaternions=np.tile(wxyz_from_rotation(turned), (frames, 1, 1)), tendons=(), command_time=np.empty(0),
        commands=np.empty((0, 0)), tendon_positions=np.empty((frames, 0)),
    )  # fmt: skip
