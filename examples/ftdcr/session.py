"""The session of the FTDCR's settled poses: `python -m examples.ftdcr.session SOURCE`

SOURCE is a folder with `train.csv` and `val.csv`, such as data/sysid/ftdcr_v4 of the public repository
ContinuumRoboticsLab/opencr-mujoco. Each becomes a log, each pattern of motion in it a trial. They go to data/raw/ftdcr
beside this file, with a session.yaml.
"""

import argparse
import csv
import sys
from itertools import groupby
from pathlib import Path
from typing import NamedTuple

import yaml
from mcap_ros2.writer import Writer

from trunkline.errors import InputError, in_one_line
from trunkline.pipeline.stage import output_folder
from trunkline.recordings.logs.definitions import JOINT_STATE, MARKERS
from trunkline.recordings.trials.splits import IDENTIFY, TEST, VALIDATE

HERE = Path(__file__).parent
SESSION = HERE / "data" / "raw" / "ftdcr"
MOTORS = tuple(f"servo_{number}_mm" for number in (4, 3, 9, 5, 2, 8, 6, 1, 7))  # of tendons 1 to 9
COLUMNS = ("timestamp", "pattern_label", *MOTORS, "tip_x", "tip_y", "tip_z")
VALIDATED = 6  # every so many-th pattern of train.csv is of the split validate, the others of identify
MARGIN = 0.1  # s around a pattern, less than the time between poses


class SettledPose(NamedTuple):
    """A settled pose. time: s. pulls: mm of each motor. tip: mm in the robot's base frame, z along the straight arm."""

    time: float
    pattern: str
    pulls: tuple[float, ...]
    tip: tuple[float, ...]


def read_csv(path: Path) -> list[SettledPose]:
    """Raises InputError naming the row that is not as expected."""
    try:
        with open(path, encoding="utf-8", newline="") as file:
            rows = list(csv.reader(file))
    except (OSError, UnicodeDecodeError, csv.Error) as error:
        reason = (getattr(error, "strerror", None) or str(error)).lower()
        raise InputError(f"{path}: {reason}, expected train.csv or val.csv of the FTDCR's recordings") from error
    if not rows or tuple(rows[0]) != COLUMNS:
        reason = ", ".join(rows[0]) if rows else "nothing"
        raise InputError(f"{path}: row 1: found {reason}, expected {', '.join(COLUMNS)}")
    poses = []
    for number, row in enumerate(rows[1:], 2):
        if len(row) != len(COLUMNS):
            raise InputError(f"{path}: row {number}: found {len(row)} cells, expected {len(COLUMNS)}")
        try:
            time, pattern, *values = float(row[0]), row[1], *map(float, row[2:])
        except ValueError as error:
            raise InputError(f"{path}: row {number}: {error}, expected numbers") from error
        pattern = pattern.removeprefix("rep1_").removesuffix("_hold")
        poses.append(SettledPose(time, pattern, tuple(values[: len(MOTORS)]), tuple(values[len(MOTORS) :])))
    return poses


def write_log(path: Path, poses: list[SettledPose]) -> None:
    """Tip and motors as ROS 2 messages, at the times of the CSV."""
    with open(path, "wb") as file, Writer(file) as writer:
        markers = writer.register_msgdef("mocap4r2_msgs/msg/Markers", MARKERS)
        joints = writer.register_msgdef("sensor_msgs/msg/JointState", JOINT_STATE)
        for number, pose in enumerate(poses):
            stamp = round(pose.time * 1e6) * 1000
            seconds, nanoseconds = divmod(stamp, 1_000_000_000)
            header = {"stamp": {"sec": seconds, "nanosec": nanoseconds}, "frame_id": "base"}
            tip = {"id_type": 0, "marker_index": 0, "marker_name": "tip",
                   "translation": dict(zip("xyz", pose.tip, strict=True))}  # fmt: skip
            message = {"header": header, "frame_number": 0, "markers": [tip]}
            writer.write_message("/tip", markers, message, stamp, stamp, number)
            wound = {"header": header, "name": list(MOTORS), "position": list(pose.pulls), "velocity": [], "effort": []}
            writer.write_message("/motor_commands", joints, wound, stamp, stamp, number)


def trials_of(file: str, poses: list[SettledPose], split: str) -> list[dict]:
    """An entry of session.yaml for each pattern."""
    entries = []
    for number, (pattern, group) in enumerate(groupby(poses, key=lambda pose: pose.pattern)):
        times = [pose.time - poses[0].time for pose in group]
        part = VALIDATE if split == IDENTIFY and number % VALIDATED == VALIDATED - 1 else split
        window = [round(times[0] - MARGIN, 3), round(times[-1] + MARGIN, 3)]
        entries.append({"name": pattern, "file": file, "window": window, "experiment": "static_path", "split": part})
    return entries


def make_session(source: Path, session: Path = SESSION) -> int:
    """Fill the folder `session` from `source`; the number of trials. Raises InputError where a file is not right."""
    if not source.is_dir():
        raise InputError(f"{source}: no such folder, expected one with train.csv and val.csv")
    with output_folder(session) as folder:
        entries = []
        for stem, split in (("train", IDENTIFY), ("val", TEST)):
            poses = read_csv(source / f"{stem}.csv")
            write_log(folder / f"{stem}.mcap", poses)
            entries += trials_of(f"{stem}.mcap", poses, split)
        head = (HERE / "session.yaml").read_text(encoding="utf-8")
        trials = yaml.safe_dump({"trials": entries}, sort_keys=False, default_flow_style=None, width=120)
        (folder / "session.yaml").write_text(head + trials, encoding="utf-8")
    return len(entries)


@in_one_line
def main(arguments: list[str] | None = None) -> int:
    parser = argparse.ArgumentParser(
        prog="python -m examples.ftdcr.session",
        description=__doc__,
        formatter_class=argparse.RawDescriptionHelpFormatter,
    )
    parser.add_argument("source", type=Path, metavar="SOURCE", help="folder with train.csv and val.csv")
    count = make_session(parser.parse_args(arguments).source)
    print(f"{SESSION}: 2 logs, {count} trials and session.yaml")
    return 0


if __name__ == "__main__":
    sys.exit(main())
