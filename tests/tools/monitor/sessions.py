"""Sessions of a small arm's tilts as a lab records them: logs and a session.yaml."""

from pathlib import Path

import mujoco
import numpy as np
from scipy.spatial.transform import Rotation

from demo.instruments import measure
from demo.recorder import write_log, write_session
from demo.truth import Truth
from tests.support.matched_plant import small_model, tilt
from tests.support.sessions import instruments
from tests.support.small_arm import small_spec
from trunkline.frames import rotation_from_wxyz, wxyz_from_rotation
from trunkline.identification.parameters.saving import save_model

UNITS = 4
TILTS = (35.0, 50.0, 65.0, 80.0)
SECONDS, RATE = 1.0, 480.0


def write_model(path: Path, prefix: str = "unit_") -> Path:
    """prefix: of the units' names."""
    spec, model = small_spec(UNITS), small_model(UNITS)
    spec.option.timestep = model.opt.timestep
    spec.compile()
    path.write_text(save_model(spec, model).replace("unit_", prefix))
    return path


def softened(share: float) -> mujoco.MjModel:
    model = small_model(UNITS)
    model.jnt_stiffness[:] *= share
    return model


def record(folder: Path, share: float, repeats: int, seed: int) -> Path:
    """Tilts of an arm of `share` times the stiffness, each `repeats` times, as a session."""
    model, frames = softened(share), int(SECONDS * RATE)
    truths = [_truth(model, angle, f"tilt_{angle:.0f}_{i}", frames) for i in range(repeats) for angle in TILTS]
    folder.mkdir(parents=True)
    settings, draws = instruments(), np.random.SeedSequence(seed).spawn(len(truths))
    measured = [
        measure(truth, settings, np.random.default_rng(draw), index * settings.pause_s)
        for index, (truth, draw) in enumerate(zip(truths, draws, strict=True))
    ]
    for trial in measured:
        write_log(folder / f"{trial.name}.mcap", trial)
    write_session(folder, measured, settings)
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
