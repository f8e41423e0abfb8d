"""The session of the ASL Trunk's releases: `python -m examples.asl_trunk.session SOURCE [--load 0.1]`

SOURCE is a folder of logs `release_200g_*.mcap`, or the public `observations_manual_decay_200g.csv` (folder
stack/main/data/trajectories/dynamic of the repository StanfordASL/trunk-stack), from which the same logs are made. They
go to data/raw/asl_trunk beside this file, with session.yaml.

With --load, SOURCE is the CSV of releases with another load, such as `observations_manual_decay_300g.csv` (folder
dc_motor_archive there): a session of its own, data/raw/asl_trunk_loaded, in which every trial has that load and is of
the split `test`.
"""

import argparse
import csv
import shutil
import sys
from pathlib import Path

import numpy as np
import yaml
from mcap_ros2.writer import Writer

from trunkline.errors import InputError, in_one_line
from trunkline.pipeline.stage import output_folder
from trunkline.recordings.logs.definitions import JOINT_STATE, TRUNK_RIGID_BODIES
from trunkline.recordings.trials.splits import TEST

HERE = Path(__file__).parent
SESSION = HERE / "data" / "raw" / "asl_trunk"
LOADED = HERE / "data" / "raw" / "asl_trunk_loaded"
BODIES = ("1", "2", "3")
COLUMNS = ("ID", *(f"{axis}{body}" for body in BODIES for axis in "xyz"))
RATE = 100  # frames a second; the CSV has no times, and no matter which frames its recorder lost
EPOCH, APART = 1_726_000_000, 60  # s, of the first release, and from one to the next: made up, and without effect


def read_table(path: Path, columns: tuple[str, ...]) -> list[list[float]]:
    """The rows of a CSV file of numbers.

    Raises:
        InputError: naming the row or column that is not as expected.
    """
    try:
        with open(path, encoding="utf-8", newline="") as file:
            rows = list(csv.reader(file))
    except (OSError, UnicodeDecodeError, csv.Error) as error:
        reason = (getattr(error, "strerror", None) or str(error)).lower()
        raise InputError(f"{path}: {reason}, expected a CSV file of the recordings") from error
    if not rows or tuple(rows[0]) != columns:
        reason = ", ".join(rows[0]) if rows else "nothing"
        raise InputError(f"{path}: row 1: found {reason}, expected {', '.join(columns)}")
    table = []
    for number, row in enumerate(rows[1:], 2):
        if len(row) != len(columns):
            raise InputError(f"{path}: row {number}: found {len(row)} cells, expected {len(columns)}")
        try:
            table.append([float(cell) for cell in row])
        except ValueError as error:
            raise InputError(f"{path}: row {number}: {error}, expected numbers") from error
    return table


def read_releases(path: Path) -> dict[int, np.ndarray]:
    """Trajectory's number to its positions (T, 3, 3), m, in the motion-capture frame; InputError as `read_table`."""
    frames: dict[int, list] = {}
    for trajectory, *values in read_table(path, COLUMNS):
        frames.setdefault(int(trajectory), []).append(values)
    return {trajectory: np.reshape(values, (-1, len(BODIES), 3)) for trajectory, values in frames.items()}


def write_log(path: Path, positions: np.ndarray, start: int, commands: dict[str, np.ndarray] | None = None) -> None:
    """Write positions (T, 3, 3) m as the robot's own message, at `RATE` from `start` (ns) on, and beside them each
    motor's commands (T,), if there are any."""
    names = list(commands or {})
    motors = np.stack([commands[name] for name in names], axis=1).tolist() if commands else []
    with open(path, "wb") as file, Writer(file) as writer:
        schema = writer.register_msgdef("interfaces/msg/TrunkRigidBodies", TRUNK_RIGID_BODIES)
        joints = [writer.register_msgdef("sensor_msgs/msg/JointState", JOINT_STATE)] if names else []
        for index, points in enumerate(positions.tolist()):
            stamp = start + index * 1_000_000_000 // RATE
            seconds, nanoseconds = divmod(stamp, 1_000_000_000)
            header = {"stamp": {"sec": seconds, "nanosec": nanoseconds}, "frame_id": "mocap"}
            message = {
                "header": header,
                "frame_number": index,
                "rigid_body_names": list(BODIES),
                "positions": [dict(zip("xyz", point, strict=True)) for point in points],
                "orientations": [],
            }
            writer.write_message("/trunk_rigid_bodies", schema, message, stamp, stamp, index)
            for joint in joints:
                sent = {"header": header, "name": names, "position": motors[index], "velocity": [], "effort": []}
                writer.write_message("/motor_commands", joint, sent, stamp, stamp, index)


def make_session(source: Path, session: Path = SESSION) -> int:
    """Fill the folder `session` from `source`; the number of logs. Raises InputError where there is nothing to take."""
    logs = sorted(source.glob("release_200g_*.mcap")) if source.is_dir() else []
    if source.is_dir() and not logs:
        raise InputError(f"{source}: found no release_200g_*.mcap, expected the logs of the releases")
    trajectories = {} if logs else read_releases(source)
    with output_folder(session) as folder:
        shutil.copyfile(HERE / "session.yaml", folder / "session.yaml")
        for log in logs:
            shutil.copyfile(log, folder / log.name)
        _write_logs(folder, trajectories, "release_200g")
    return len(logs) + len(trajectories)


def make_loaded_session(source: Path, load: float, session: Path = LOADED) -> int:
    """Fill the folder `session` from a CSV, with `load` kg at the tip beside the arm's own; the number of logs."""
    trajectories = read_releases(source)
    with output_folder(session) as folder:
        names = _write_logs(folder, trajectories, "release")
        head = (HERE / "session.yaml").read_text(encoding="utf-8").partition("trials:")[0].partition("\n")[2]
        trials = [{"file": name, "experiment": "release", "split": TEST, "load": load} for name in names]
        write_session(folder, head, trials)
    return len(trajectories)


def write_session(folder: Path, head: str, trials: list[dict]) -> None:
    """session.yaml of the text `head` and its `trials`."""
    listed = yaml.safe_dump({"trials": trials}, sort_keys=False, default_flow_style=None, width=120)
    (folder / "session.yaml").write_text(head + listed, encoding="utf-8")


def _write_logs(folder: Path, trajectories: dict[int, np.ndarray], name: str) -> list[str]:
    """A log of each trajectory; their names."""
    names = []
    for number, positions in trajectories.items():
        names.append(f"{name}_{number:02d}.mcap")
        write_log(folder / names[-1], positions, (EPOCH + APART * number) * 1_000_000_000)
    return names


@in_one_line
def main(arguments: list[str] | None = None) -> int:
    parser = argparse.ArgumentParser(
        prog="python -m examples.asl_trunk.session",
        description=__doc__,
        formatter_class=argparse.RawDescriptionHelpFormatter,
    )
    parser.add_argument("source", type=Path, metavar="SOURCE", help="folder of logs, or the CSV")
    parser.add_argument("--load", type=float, metavar="KG", help="at the tip, beside the 200 g that the arm has")
    options = parser.parse_args(arguments)
    if options.load is None:
        session, count = SESSION, make_session(options.source)
    else:
        session, count = LOADED, make_loaded_session(options.source, options.load)
    print(f"{session}: {count} logs and session.yaml")
    return 0


if __name__ == "__main__":
    sys.exit(main())
