"""Public recordings of others, by declaration alone."""

from pathlib import Path

import numpy as np
import yaml

from examples.asl_motion.session import make_session as make_motion
from examples.asl_trunk.session import make_loaded_session
from examples.ftdcr.session import make_session as make_path
from tests.recordings.tables.lab_table import raw_trials, write_declared
from tests.support.folders import ROOT, SHARED, with_recordings
from trunkline.recordings.session.session import read_session
from trunkline.recordings.tables.source import TableReader
from trunkline.recordings.trials.raw_trial import RawTrial

DISCS = {name: {"position": [f"{axis}{name}" for axis in "xyz"]} for name in ("1", "2", "3")}


def linked(folder: Path, *files: Path) -> Path:
    folder.mkdir()
    for file in files:
        (folder / file.name).symlink_to(file)
    return folder


def example(name: str) -> dict:
    """What the session of an example says besides its trials."""
    return yaml.safe_load((ROOT / "examples" / name / "session.yaml").read_text()) | {"trials": None}


def assert_alike(folder: Path, logs: Path) -> dict[str, RawTrial]:
    """Each trial of tables is what the example's script makes of it."""
    ours, theirs = raw_trials(folder), raw_trials(logs)
    assert ours.keys() == theirs.keys()
    for name, raw in ours.items():
        assert isinstance(raw, RawTrial), raw
        for field in ("time", "positions", "command_time", "commands"):
            np.testing.assert_allclose(getattr(raw, field), getattr(theirs[name], field), atol=2e-6, err_msg=name)
    return ours


@with_recordings
def test_releases_of_the_asl_trunk(tmp_path):
    """A column names the release; no time, 100 frames a second."""
    source = SHARED / "asl_trunk/loads/observations_manual_decay_300g.csv"
    count = make_loaded_session(source, 0.1, tmp_path / "logs")
    folder = linked(tmp_path / "tables", source)
    entry = {"file": source.name, "experiment": "release", "split": "test", "load": 0.1}
    trials = [entry | {"name": f"release_{number:02d}", "label": number} for number in range(count)]
    tables = {"time": {"rate": 100}, "bodies": DISCS, "trial": "ID"}
    write_declared(folder, tables, trials, **{key: example("asl_trunk")[key] for key in ("frame", "base")})
    assert len(assert_alike(folder, tmp_path / "logs")) == count


@with_recordings
def test_motion_of_the_asl_trunk(tmp_path):
    """Commands in a file of their own, row by row; windows."""
    source = SHARED / "asl_trunk/actuated"
    make_motion(source, tmp_path / "logs")
    folder = linked(tmp_path / "tables", *source.glob("*.csv"))
    trials = yaml.safe_load((tmp_path / "logs/session.yaml").read_text())["trials"]
    for trial in trials:
        stem = "observations_controlled_1" + ("_200g" if trial["file"] == "loaded.mcap" else "")
        trial["file"] = f"{stem}.csv"
    tables = {
        "time": {"rate": 100},
        "bodies": DISCS,
        "motors_file": {"file": "control_inputs_controlled_1.csv"},
        "commands": [f"u{number}" for number in range(1, 7)],
    }
    write_declared(folder, tables, trials, **{k: v for k, v in example("asl_motion").items() if k != "trials"})
    assert_alike(folder, tmp_path / "logs")


@with_recordings
def test_settled_poses_of_the_ftdcr(tmp_path):
    """Unix times, mm, windows."""
    source = SHARED / "ftdcr_v4"
    make_path(source, tmp_path / "logs")
    folder = linked(tmp_path / "tables", source / "train.csv", source / "val.csv")
    trials = yaml.safe_load((tmp_path / "logs/session.yaml").read_text())["trials"]
    for trial in trials:
        trial["file"] = trial["file"].replace(".mcap", ".csv")
    head = {k: v for k, v in example("ftdcr").items() if k != "trials"}
    tables = {
        "time": {"column": "timestamp", "unit": "s"},
        "bodies": {"tip": {"position": ["tip_x", "tip_y", "tip_z"]}},
        "commands": list(head["motors"]),
    }
    write_declared(folder, tables, trials, **head)
    assert_alike(folder, tmp_path / "logs")


@with_recordings
def test_the_helix_arm(tmp_path):
    """Poses with Euler angles in text, commands in an array of NumPy's, row by row."""
    source = SHARED / "helix_epfl"
    folder = linked(tmp_path / "tables", source / "poses.csv", source / "commands.npz")
    names = ("SA-base", "SA-low", "SA-middle", "SA-up")
    motors = {f"m{s}{m}": f"act_list[{s},{m}]" for s in (1, 2, 3) for m in (1, 2, 3)}
    tables = {
        "time": {"column": "Timestamp", "unit": "s"},
        "bodies": {name: {"position": [f"{name}-{axis}" for axis in "XYZ"],
                          "euler": [f"{name}-{angle}" for angle in ("Roll", "Pitch", "Yaw")]} for name in names},
        "euler": {"convention": "xyz", "unit": "deg"},
        "motors_file": {"file": "commands.npz"},
        "commands": motors,
    }  # fmt: skip
    drums = {name: {"unit": "deg", "spool_radius": 0.01, "tendons": {f"tendon_{i}": 360 / 4096}}
             for i, name in enumerate(motors, 1)}  # fmt: skip
    trials = [{"file": "poses.csv", "experiment": "static_path", "window": [0, 600], "split": "identify"}]
    write_declared(folder, tables, trials, base="SA-base", motors=drums)
    raw = raw_trials(folder)["poses"]
    rows = np.loadtxt(source / "poses.csv", delimiter=",", skiprows=1)[: len(raw.time)]
    np.testing.assert_allclose(raw.positions[:, -1], rows[:, 19:22])
    ticks = np.load(source / "commands.npz")["act_list"][: len(raw.time)].reshape(-1, 9)
    last = np.searchsorted(raw.command_time, raw.time + 1e-6, side="right") - 1  # commands hold until the next
    np.testing.assert_allclose(raw.commands[last], ticks * 2 * np.pi / 4096 * 0.01, atol=1e-9)


@with_recordings
def test_the_tentacle(tmp_path):
    """No header; the order of markers is the file's own."""
    source = SHARED / "soromox_tentacle/data"
    folder = linked(tmp_path / "tables", source / "m1_u01.csv", source / "m2_u01.csv")
    bodies = {f"p{number}": {"position": [3 * number + i for i in range(3)]} for number in range(1, 6)}
    turned = dict(zip(("p2", "p1", "p3", "p4", "p5"), bodies.values(), strict=True))
    trials = [{"file": "m1_u01.csv", "experiment": "static_tilt", "level": 0, "split": "identify"},
              {"file": "m2_u01.csv", "experiment": "static_tilt", "level": 0, "split": "identify",
               "table": {"bodies": turned}}]  # fmt: skip
    tables = {"header": 0, "time": {"column": 2, "unit": "s", "frames": 1}, "bodies": bodies}
    write_declared(folder, tables, trials, base={"position": [0.2, 0.2, 0.2]})
    session = read_session(folder)
    reader = TableReader(folder, session)
    for trial, first in zip(session.trials, ("p1", "p2"), strict=True):
        poses = reader.open(trial).poses
        rows = np.loadtxt(source / trial.file, delimiter=",")
        np.testing.assert_array_equal(poses.positions[:, poses.names.index(first)], rows[:, 2:5])
        np.testing.assert_allclose(1e-9 * poses.stamps, rows[:, 1], atol=1e-9)
