"""Writes measurements as the lab's recorder does: a ROS 2 MCAP log a trial, and the session.yaml beside them."""

from pathlib import Path

import numpy as np
from mcap_ros2.writer import Writer

from demo.instruments import BASE, InstrumentSettings, Measurement
from trunkline.recordings.logs.definitions import JOINT_STATE, RIGID_BODIES

POSES, COMMANDS, TENDON_POSITIONS = "/rigid_bodies", "/tendon_commands", "/tendon_states"
CHUNK_SIZE = 64 * 1024  # bytes; what a crash of the recorder costs


def write_log(path: Path, measurement: Measurement) -> None:
    """Write one trial as an MCAP log; a hidden body is missing from its frame's message."""
    m = measurement
    messages = [
        (logged, POSES, stamp, _rigid_bodies(stamp, frame, m.bodies, positions, quaternions))
        for logged, stamp, frame, positions, quaternions in zip(
            m.logged, m.stamps, m.frames, m.positions, m.quaternions, strict=True
        )
    ]
    for topic, times, stamps, pulls in (
        (COMMANDS, m.command_logged, m.command_stamps, m.commands),
        (TENDON_POSITIONS, m.tendon_logged, m.tendon_stamps, m.tendon_positions),
    ):
        messages += [
            (
                logged,
                topic,
                stamp,
                {"header": _header(stamp, ""), "name": list(m.tendons), "position": pull.tolist()},
            )
            for logged, stamp, pull in zip(times, stamps, pulls, strict=True)
        ]
    messages.sort(key=lambda message: message[0])
    with open(path, "wb") as file, Writer(file, chunk_size=CHUNK_SIZE) as writer:
        rigid_bodies = writer.register_msgdef("mocap4r2_msgs/msg/RigidBodies", RIGID_BODIES)
        joint_state = writer.register_msgdef("sensor_msgs/msg/JointState", JOINT_STATE)
        for sequence, (logged, topic, stamp, content) in enumerate(messages):
            schema = rigid_bodies if topic == POSES else joint_state
            writer.write_message(topic, schema, content, int(logged), int(stamp), sequence)


def write_session(folder: Path, measurements: list[Measurement], settings: InstrumentSettings) -> None:
    """Write session.yaml for the logs `<trial>.mcap` in `folder`."""
    up = ", ".join(f"{value:g}" for value in settings.up)
    lines = [
        "# The stand-in lab's session. Tilt is measured from the base body; level is what the experimenter aimed at.",
        f"frame: {{up: [{up}], unit: m}}",
        f"base: {BASE}",
        "clock: frame",
        f"topics: {{poses: {POSES}, commands: {COMMANDS}, tendon_positions: {TENDON_POSITIONS}}}",
        "trials:",
    ]
    for m in measurements:
        level = "" if m.level is None else f", level: {m.level:g}"
        load = f", load: {m.load:g}" if m.load else ""
        lines.append(f"  - {{file: {m.name}.mcap, experiment: {m.experiment}{level}{load}, split: {m.split}}}")
    (Path(folder) / "session.yaml").write_text("\n".join(lines) + "\n", encoding="utf-8")


def _rigid_bodies(stamp: int, frame: int, bodies, positions: np.ndarray, quaternions: np.ndarray) -> dict:
    visible = np.isfinite(positions[:, 0])
    return {
        "header": _header(stamp, "mocap"),
        "frame_number": int(frame),
        "rigidbodies": [
            {
                "rigid_body_name": name,
                "pose": {
                    "position": dict(zip("xyz", position.tolist(), strict=True)),
                    "orientation": dict(zip("wxyz", quaternion.tolist(), strict=True)),
                },
            }
            for name, position, quaternion, tracked in zip(
                bodies, positions, quaternions, visible, strict=True
            )
            if tracked
        ],
    }


def _header(stamp: int, frame_id: str) -> dict:
    seconds, nanoseconds = divmod(int(stamp), 1_000_000_000)
    return {"stamp": {"sec": seconds, "nanosec": nanoseconds}, "frame_id": frame_id}
