"""Writes measurements as the lab's recorder does: a ROS 2 MCAP log a trial, and the session.yaml beside them."""

from pathlib import Path

import numpy as np
from mcap_ros2.writer import Writer

from demo.instruments import BASE, InstrumentSettings, Measurement

POSES, COMMANDS, TENDON_POSITIONS = "/rigid_bodies", "/tendon_commands", "/tendon_states"
CHUNK_SIZE = 64 * 1024  # bytes; what a crash of the recorder costs

SEPARATOR = "=" * 80 + "\n"
HEADER = f"""{SEPARATOR}MSG: std_msgs/Header
builtin_interfaces/Time stamp
string frame_id
{SEPARATOR}MSG: builtin_interfaces/Time
int32 sec
uint32 nanosec
"""
# mocap4r2_msgs of the MOCAP4ROS2 project
RIGID_BODIES = f"""std_msgs/Header header
uint32 frame_number
mocap4r2_msgs/RigidBody[] rigidbodies
{HEADER}{SEPARATOR}MSG: mocap4r2_msgs/RigidBody
string rigid_body_name
mocap4r2_msgs/Marker[] markers
geometry_msgs/Pose pose
{SEPARATOR}MSG: mocap4r2_msgs/Marker
int8 USE_NAME=0
int8 USE_INDEX=1
int8 USE_BOTH=2
int8 id_type
int32 marker_index
string marker_name
geometry_msgs/Point translation
{SEPARATOR}MSG: geometry_msgs/Pose
geometry_msgs/Point position
geometry_msgs/Quaternion orientation
{SEPARATOR}MSG: geometry_msgs/Point
float64 x
float64 y
float64 z
{SEPARATOR}MSG: geometry_msgs/Quaternion
float64 x 0
float64 y 0
float64 z 0
float64 w 1
"""
JOINT_STATE = f"""std_msgs/Header header
string[] name
float64[] position
float64[] velocity
float64[] effort
{HEADER}"""


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
        lines.append(f"  - {{file: {m.name}.mcap, experiment: {m.experiment}{level}, split: {m.split}}}")
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
            for name, position, quaternion, seen in zip(
                bodies, positions, quaternions, visible, strict=True
            )
            if seen
        ],
    }


def _header(stamp: int, frame_id: str) -> dict:
    seconds, nanoseconds = divmod(int(stamp), 1_000_000_000)
    return {"stamp": {"sec": seconds, "nanosec": nanoseconds}, "frame_id": frame_id}
