"""The session of the ASL Trunk's releases: `python -m examples.asl_trunk.session SOURCE`

SOURCE is a folder of logs `release_200g_*.mcap`, or the public `observations_manual_decay_200g.csv` (folder
stack/main/data/trajectories/dynamic of the repository StanfordASL/trunk-stack), from which the same logs are made. They
go to data/raw/asl_trunk beside this file, with session.yaml.
"""

import argparse
import csv
import shutil
import sys
from pathlib import Path

import numpy as np
from mcap_ros2.writer import Writer

from trunkline.errors import InputError, in_one_line
from trunkline.logs.definitions import TRUNK_RIGID_BODIES
from trunkline.pipeline.stage import output_folder

HERE = Path(__file__).parent
SESSION = HERE / "data" / "raw" / "asl_trunk"
BODIES = ("1", "2", "3")
COLUMNS = ["ID", *(f"{axis}{body}" for body in BODIES for axis in "xyz")]
RATE = 100  # frames a second; the CSV has no times, and no matter which frames its recorder lost
EPOCH, APART = 1_726_000_000, 60  # s, of the first release, and from one to the next: made up, and without effect


def read_csv(path: Path) -> dict[int, np.ndarray]:
    """Trajectory's number to its positions (T, 3, 3), m, in the motion-capture frame.

    Raises:
        InputError: naming the row or column that is not as expected.
    """
    try:
        with open(path, encoding="utf-8", newline="") as file:
            rows = list(csv.reader(file))
    except (OSError, UnicodeDecodeError, csv.Error) as error:
        raise InputError(f"{path}: {error}, expected observations_manual_decay_200g.csv") from error
    if not rows or rows[0] != COLUMNS:
        found = ", ".join(rows[0]) if rows else "nothing"
        raise InputError(f"{path}: row 1: found {found}, expected {', '.join(COLUMNS)}")
    frames: dict[int, list] = {}
    for number, row in enumerate(rows[1:], 2):
        try:
            trajectory, values = int(row[0]), [float(cell) for cell in row[1:]]
        except (ValueError, IndexError) as error:
            raise InputError(f"{path}: row {number}: {error}, expected numbers") from error
        if len(values) != 3 * len(BODIES):
            raise InputError(f"{path}: row {number}: found {len(values)} coordinates, expected {3 * len(BODIES)}")
        frames.setdefault(trajectory, []).append(values)
    return {trajectory: np.reshape(values, (-1, len(BODIES), 3)) for trajectory, values in frames.items()}


def write_log(path: Path, positions: np.ndarray, start: int) -> None:
    """Write positions (T, 3, 3) m as the robot's own message, at `RATE` from `start` (ns) on."""
    with open(path, "wb") as file, Writer(file) as writer:
        schema = writer.register_msgdef("interfaces/msg/TrunkRigidBodies", TRUNK_RIGID_BODIES)
        for index, points in enumerate(positions.tolist()):
            stamp = start + index * 1_000_000_000 // RATE
            seconds, nanoseconds = divmod(stamp, 1_000_000_000)
            message = {
                "header": {"stamp": {"sec": seconds, "nanosec": nanoseconds}, "frame_id": "mocap"},
                "frame_number": index,
                "rigid_body_names": list(BODIES),
                "positions": [dict(zip("xyz", point, strict=True)) for point in points],
                "orientations": [],
            }
            writer.write_message("/trunk_rigid_bodies", schema, message, stamp, stamp, index)


def make_session(source: Path, session: Path = SESSION) -> int:
    """Fill the folder `session` from `source`; the number of logs. Raises InputError where there is nothing to take."""
    logs = sorted(source.glob("release_200g_*.mcap")) if source.is_dir() else []
    if source.is_dir() and not logs:
        raise InputError(f"{source}: found no release_200g_*.mcap, expected the logs of the releases")
    trajectories = {} if logs else read_csv(source)
    with output_folder(session) as folder:
        shutil.copyfile(HERE / "session.yaml", folder / "session.yaml")
        for log in logs:
            shutil.copyfile(log, folder / log.name)
        for number, positions in trajectories.items():
            start = (EPOCH + APART * number) * 1_000_000_000
            write_log(folder / f"release_200g_{number:02d}.mcap", positions, start)
    return len(logs) + len(trajectories)


@in_one_line
def main(arguments: list[str] | None = None) -> int:
    parser = argparse.ArgumentParser(
        prog="python -m examples.asl_trunk.session",
        description=__doc__,
        formatter_class=argparse.RawDescriptionHelpFormatter,
    )
    parser.add_argument("source", type=Path, metavar="SOURCE", help="folder of logs, or the CSV")
    count = make_session(parser.parse_args(arguments).source)
    print(f"{SESSION}: {count} logs and session.yaml")
    return 0


if __name__ == "__main__":
    sys.exit(main())
