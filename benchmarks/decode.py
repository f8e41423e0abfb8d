"""Poses per second from bytes to arrays, beside the plain `mcap` and `rosbags` readers. `python -m benchmarks.decode`

One log of `mocap4r2_msgs/msg/RigidBodies`, read from the disk each time; what the three make of it is compared.
"""

import tempfile
import time
from collections.abc import Callable
from pathlib import Path

import numpy as np
from mcap.reader import make_reader
from mcap_ros2.decoder import DecoderFactory
from rosbags.rosbag2.storage_mcap import McapReader
from rosbags.typesys import Stores, get_types_from_msg, get_typestore

from trunkline.recordings.logs.definitions import RIGID_BODIES
from trunkline.recordings.logs.mcap_log import read_log
from trunkline.recordings.logs.pose_stream import PoseStream, pose_stream
from trunkline.recordings.preparation.motive import write_log
from upkeep.results import recorded

SCHEMA, BODIES, RATE = "mocap4r2_msgs/msg/RigidBodies", 19, 120
FRAMES, HIDDEN = 6000, 0.005  # the latter a share of samples, which are occluded
ROUNDS = 3  # the best of which counts
START = 1_760_000_000_000_000_000  # ns


@recorded("decode")
def main() -> None:
    with tempfile.TemporaryDirectory() as folder:
        path = Path(folder) / "log.mcap"
        poses = write(path)
        print(f"{FRAMES} frames of {BODIES} bodies, {poses} poses, {path.stat().st_size / 1e6:.1f} MB")
        readers = {"trunkline": fast, "mcap with mcap_ros2": plain_mcap, "rosbags": plain_rosbags}
        reference = None
        for name, reader in readers.items():
            seconds, found = timed(reader, path, ROUNDS if reader is fast else 1)
            reference = found if reference is None else reference
            np.testing.assert_array_equal(found, reference)
            print(f"{name:20} {seconds:7.3f} s  {poses / seconds:10.0f} poses/s")


def write(path: Path) -> int:
    """Write the log; the number of poses in it."""
    rng = np.random.default_rng(0)
    positions, quaternions = rng.normal(size=(FRAMES, BODIES, 3)), rng.normal(size=(FRAMES, BODIES, 4))
    present = rng.random((FRAMES, BODIES)) >= HIDDEN
    stamps = START + np.arange(FRAMES) * 1_000_000_000 // RATE
    names = tuple(f"unit_{body:02d}" for body in range(BODIES))
    write_log(path, PoseStream(stamps, stamps, np.arange(FRAMES), names, present, positions, quaternions))
    return int(present.sum())


def timed(reader: Callable[[Path], np.ndarray], path: Path, rounds: int) -> tuple[float, np.ndarray]:
    """(s of the best round, what was read)"""
    seconds, found = [], []
    for _ in range(rounds):
        started = time.perf_counter()
        found.append(reader(path))
        seconds.append(time.perf_counter() - started)
    return min(seconds), found[-1]


def fast(path: Path) -> np.ndarray:
    """(frames, bodies, 7): x, y, z, w, x, y, z; NaN where hidden. As the others."""
    stream = pose_stream({None: read_log(path).topics["/rigid_bodies"]})
    order = np.argsort(stream.names)
    assert stream.quaternions is not None
    return np.concatenate([stream.positions, stream.quaternions], axis=-1)[:, order]


def plain_mcap(path: Path) -> np.ndarray:
    with open(path, "rb") as file:
        reader = make_reader(file, decoder_factories=[DecoderFactory()])
        return _arrange(content for *_, content in reader.iter_decoded_messages())


def plain_rosbags(path: Path) -> np.ndarray:
    store = get_typestore(Stores.ROS2_HUMBLE)
    store.register(_types(RIGID_BODIES))
    reader = McapReader(path)
    reader.open()
    try:
        messages = reader.messages(reader.connections)
        return _arrange(store.deserialize_cdr(data, SCHEMA) for _, _, data in messages)
    finally:
        reader.close()


def _types(definition: str) -> dict:
    """The package's own types; the others come with rosbags."""
    types = {}
    parts = definition.split("=" * 80 + "\n")
    for name, text in [(SCHEMA, parts[0])] + [part.removeprefix("MSG: ").split("\n", 1) for part in parts[1:]]:
        if "mocap4r2" in name:
            full = name if "/msg/" in name else name.replace("/", "/msg/")
            types |= get_types_from_msg(text, full)
    return types


def _arrange(messages) -> np.ndarray:
    frames = []
    for message in messages:
        row = np.full((BODIES, 7), np.nan)
        for body in message.rigidbodies:
            p, q = body.pose.position, body.pose.orientation
            row[int(body.rigid_body_name[5:])] = p.x, p.y, p.z, q.w, q.x, q.y, q.z
        frames.append(row)
    return np.array(frames)


if __name__ == "__main__":
    main()
