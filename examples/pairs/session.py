"""Logs of an invented arm, made by the stand-in lab's instruments: `python -m examples.pairs.session`

Two sections, six tendons in antagonistic pairs on three motors, a mount that is turned sideways. The arm on the bench
is lab.yaml, which no stage reads. Motors move it by sines of several frequencies. The logs go to data/raw/pairs beside
this file, with session.yaml.
"""

import argparse
import sys
from pathlib import Path

import mujoco
import numpy as np
import yaml
from scipy.spatial.transform import Rotation

from demo.instruments import InstrumentSettings, measure
from demo.recorder import write_log
from demo.truth import Truth
from trunkline.errors import in_one_line
from trunkline.frames import STANDARD_GRAVITY, wxyz_from_rotation
from trunkline.identification.parameters.spool_scale import wound
from trunkline.model.arm.kinds import Arm
from trunkline.model.simulation.motion import batch_of, hold, move
from trunkline.pipeline.config import PROJECT, settings_of, validated
from trunkline.pipeline.stage import output_folder
from trunkline.recordings.trials.splits import IDENTIFY, TEST, VALIDATE
from trunkline.settings import read_yaml

HERE = Path(__file__).parent
SESSION = HERE / "data" / "raw" / "pairs"
SPLITS = (IDENTIFY, IDENTIFY, IDENTIFY, VALIDATE, TEST, TEST)
MOUNT = Rotation.from_euler("ZY", [30, 85], degrees=True)  # world ← base: the arm sticks out, a little downwards
MOTORS = {"m1": (1, 2), "m2": (3, 4), "m3": (5, 6)}  # tendons that each winds in and pays out
MARKERS = ("middle", "tip")
STEP, RATE = 5e-4, 500.0  # s; Hz, of what instruments can see
REST, SECONDS, FADE = 2.0, 20.0, 2.0  # s before a motion, of it, and in which it grows to its size
FREQUENCIES, LARGEST = (0.11, 0.27, 0.43, 0.8), 0.006  # Hz; m that a motor winds in
SEED = 11


def plant() -> mujoco.MjModel:
    """The arm on the bench, under gravity as its mount is turned."""
    config = settings_of("build_mjcf", HERE)
    arm = validated(Arm, yaml.safe_load((HERE / "lab.yaml").read_text(encoding="utf-8")), HERE / "lab.yaml")
    config.solver.timestep = STEP
    spec = arm.build(config.actuation, config.solver, HERE).spec
    spec.option.gravity = MOUNT.inv().apply([0, 0, -STANDARD_GRAVITY])
    return spec.compile()


def turns(rng: np.random.Generator) -> np.ndarray:
    """What the three motors are told at every STEP, m of tendon. Shape (T, 3)."""
    time = np.arange(round((REST + SECONDS) / STEP)) * STEP - REST
    phases = rng.uniform(0, 2 * np.pi, (len(FREQUENCIES), len(MOTORS)))
    sines = np.sin(2 * np.pi * np.outer(time, FREQUENCIES)[:, :, None] + phases).sum(axis=1)
    sines *= np.clip(time / FADE, 0, 1)[:, None]
    return LARGEST * sines / np.abs(sines).max(axis=0)


def moved(model: mujoco.MjModel, commands: np.ndarray, names: list[str]) -> list[Truth]:
    """What the arm does as its motors are `told` (n, T, 3)."""
    pulls = np.zeros((*commands.shape[:2], model.nu))
    for column, pair in enumerate(MOTORS.values()):
        for tendon, sign in zip(pair, (1, -1), strict=True):
            pulls[:, :, tendon - 1] = sign * commands[:, :, column]
    controls = np.stack([wound(model, model.tendon_length0[: model.nu] - each) for each in pulls])
    batch, every = batch_of(model, len(commands)), round(1 / RATE / STEP)
    hold(batch, model, controls[:, 0])
    move(batch, np.repeat(controls[:, :1], 8000, axis=1), ("qpos",), 8000)  # until it hangs still
    paths = move(batch, controls, ("qpos",), every)["qpos"]
    sites, data = [model.site(f"{name}_center").id for name in MARKERS], mujoco.MjData(model)
    truths = []
    for path, name, split, row in zip(paths, names, SPLITS, commands, strict=True):
        positions, rotations = np.empty((len(path), len(sites), 3)), np.empty((len(path), len(sites), 3, 3))
        for frame, qpos in enumerate(path):
            data.qpos[:] = qpos
            mujoco.mj_kinematics(model, data)
            positions[frame] = data.site_xpos[sites]
            rotations[frame] = data.site_xmat[sites].reshape(-1, 3, 3)
        turned = MOUNT * Rotation.from_matrix(rotations.reshape(-1, 3, 3))
        time = np.arange(len(path)) / RATE
        truths.append(Truth(
            name=name, experiment="motion", split=split, level=None, time=time, begin=REST,
            base_position=np.array([0.0, 0.0, 1.0]), base_quaternion=wxyz_from_rotation(MOUNT), markers=MARKERS,
            positions=MOUNT.apply(positions.reshape(-1, 3)).reshape(positions.shape) + [0.0, 0.0, 1.0],
            quaternions=wxyz_from_rotation(turned).reshape(*positions.shape[:2], 4), tendons=tuple(MOTORS),
            command_time=time, commands=row[::every], tendon_positions=row[::every],
        ))  # fmt: skip
    return truths


def make_session(session: Path = SESSION) -> int:
    """Fill the folder `session`; the number of logs."""
    rng = np.random.default_rng(SEED)
    names = [f"motion_{number}" for number in range(len(SPLITS))]
    truths = moved(plant(), np.stack([turns(rng) for _ in names]), names)
    config = read_yaml(PROJECT / "demo/conf/record/config.yaml").instruments
    instruments = InstrumentSettings(**config)
    start = 0.0
    with output_folder(session) as folder:
        for truth in truths:
            write_log(folder / f"{truth.name}.mcap", measure(truth, instruments, rng, start))
            start += truth.time[-1] + instruments.pause_s
        (folder / "session.yaml").write_text((HERE / "session.yaml").read_text(encoding="utf-8"), encoding="utf-8")
    return len(truths)


@in_one_line
def main(arguments: list[str] | None = None) -> int:
    argparse.ArgumentParser(
        prog="python -m examples.pairs.session", description=__doc__,
        formatter_class=argparse.RawDescriptionHelpFormatter,
    ).parse_args(arguments)  # fmt: skip
    print(f"{SESSION}: {make_session()} logs and session.yaml")
    return 0


if __name__ == "__main__":
    sys.exit(main())
