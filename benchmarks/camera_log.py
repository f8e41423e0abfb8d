"""Peak memory of reading a log with a big camera topic beside its poses. `python -m benchmarks.camera_log`

Each reading is a process of its own, as peaks never fall: with the poses' messages alone, as a session is read, and
with those of all topics. The first line is a process that reads nothing.
"""

import argparse
import multiprocessing
import resource
import tempfile
import time
from collections.abc import Callable
from pathlib import Path

import numpy as np
from mcap_ros2.writer import Writer

from trunkline.recordings.logs.definitions import HEADER, RIGID_BODIES
from trunkline.recordings.logs.log import read_log
from trunkline.recordings.logs.messages import JOINTS, POSES
from upkeep.results import recorded

RATE, FRAME = 30, 640 * 480 * 3  # Hz; bytes of an image
START = 1_760_000_000_000_000_000  # ns
IMAGE = f"std_msgs/Header header\nuint8[] data\n{HEADER}"


@recorded("camera_log")
def main() -> None:
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("--mib", type=int, default=588, help="size of the camera topic")
    arguments = parser.parse_args()
    with tempfile.TemporaryDirectory() as folder:
        path = Path(folder) / "log.mcap"
        write(path, arguments.mib * 2**20 // FRAME)
        print(f"{path.stat().st_size / 2**20:.0f} MiB")
        readers = {"nothing": _nothing, "poses alone": _poses, "all topics": _everything}
        for name, reader in readers.items():
            with multiprocessing.get_context("spawn").Pool(1) as pool:
                seconds, mib = pool.apply(_measured, (reader, path))
            print(f"{name:12} {seconds:6.2f} s  peak {mib:6.0f} MiB")


def write(path: Path, images: int) -> None:
    """Noise, which does not compress, in chunks of 1 MiB; a frame of one body beside each image."""
    rng = np.random.default_rng(0)
    with open(path, "wb") as file, Writer(file, chunk_size=2**20) as writer:
        camera = writer.register_msgdef("sensor_msgs/msg/CompressedImage", IMAGE)
        poses = writer.register_msgdef("mocap4r2_msgs/msg/RigidBodies", RIGID_BODIES)
        for frame in range(images):
            stamp = START + frame * 1_000_000_000 // RATE
            header = {"stamp": dict(zip(("sec", "nanosec"), divmod(stamp, 10**9), strict=True)), "frame_id": "mocap"}
            body = {"rigid_body_name": "base", "pose": {"position": {"z": 1.0}, "orientation": {"w": 1.0}}}
            content = {"header": header, "frame_number": frame, "rigidbodies": [body]}
            writer.write_message("/rigid_bodies", poses, content, stamp, stamp, frame)
            writer.write_message("/camera", camera, {"header": header, "data": rng.bytes(FRAME)}, stamp, stamp, frame)


def _measured(reader: Callable[[Path], object], path: Path) -> tuple[float, float]:
    """(s, MiB at the peak)"""
    started = time.perf_counter()
    reader(path)
    return time.perf_counter() - started, resource.getrusage(resource.RUSAGE_SELF).ru_maxrss / 1024


def _nothing(path: Path) -> None:
    pass


def _poses(path: Path) -> None:
    read_log(path, POSES.keys() | JOINTS.keys())


def _everything(path: Path) -> None:
    read_log(path)


if __name__ == "__main__":
    main()
