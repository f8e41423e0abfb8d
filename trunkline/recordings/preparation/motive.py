"""OptiTrack Motive's CSV export as MCAP logs: `trunkline import-motive --session
data/raw/NAME CSV…`

Rigid bodies become `mocap4r2_msgs/msg/RigidBodies`, and where an export has none, its labelled markers become
`mocap4r2_msgs/msg/Markers`. A session.yaml is proposed unless there is one; up in it is +y, or what the arm shows.
"""

import sys
import tempfile
from pathlib import Path

import numpy as np
from mcap_ros2.writer import Writer

from trunkline.errors import InputError, in_one_line
from trunkline.files import written_whole
from trunkline.program import command_parser
from trunkline.recordings.logs.definitions import MARKERS, RIGID_BODIES
from trunkline.recordings.logs.pose_stream import PoseStream
from trunkline.recordings.preparation.export import METRES, read_export
from trunkline.recordings.preparation.proposal import propose
from trunkline.recordings.preparation.survey import survey
from trunkline.recordings.session.session import named_logs

UPS = ((0, 1, 0), (0, 0, 1))  # of an export: as Motive makes it by default, and as it can


def write_log(path: Path, poses: PoseStream) -> None:
    """Write poses as an MCAP log, whole or not at all; an occluded body is missing from its frame's message."""
    assert poses.frames is not None, "an export numbers its frames"
    oriented = poses.quaternions is not None
    with written_whole(path) as part, open(part, "wb") as file, Writer(file) as writer:
        name, text = ("RigidBodies", RIGID_BODIES) if oriented else ("Markers", MARKERS)
        schema = writer.register_msgdef(f"mocap4r2_msgs/msg/{name}", text)
        for index, stamp in enumerate(poses.stamps.tolist()):
            seconds, nanoseconds = divmod(stamp, 1_000_000_000)
            bodies = [_body(poses, index, body) for body in np.flatnonzero(poses.present[index]).tolist()]
            message = {
                "header": {"stamp": {"sec": seconds, "nanosec": nanoseconds}, "frame_id": "mocap"},
                "frame_number": int(poses.frames[index]),
                "rigidbodies" if oriented else "markers": bodies,
            }
            writer.write_message("/rigid_bodies" if oriented else "/markers", schema, message, stamp, stamp)


def _body(poses: PoseStream, frame: int, body: int) -> dict:
    position = dict(zip("xyz", poses.positions[frame, body].tolist(), strict=True))
    if poses.quaternions is None:
        return {"id_type": 0, "marker_index": body, "marker_name": poses.names[body], "translation": position}
    orientation = dict(zip("wxyz", poses.quaternions[frame, body].tolist(), strict=True))
    return {"rigid_body_name": poses.names[body], "pose": {"position": position, "orientation": orientation}}


@in_one_line
def main(arguments: list[str] | None = None) -> int:
    parser = command_parser("import-motive", __doc__)
    parser.add_argument("exports", nargs="+", type=Path, metavar="CSV", help="an export of Motive's, a trial each")
    parser.add_argument("--session", required=True, type=Path, help="folder that becomes the session")
    parser.add_argument("--unit", choices=METRES, help="of exports whose header has no Length Units")
    chosen = parser.parse_args(arguments)
    chosen.session.mkdir(parents=True, exist_ok=True)
    logs = {path: chosen.session / f"{path.stem}.mcap" for path in chosen.exports}
    _require_new(logs, chosen.exports, chosen.unit)
    for path, log in logs.items():
        poses, remarks = read_export(path, chosen.unit)
        write_log(log, poses)
        visible = 100 * poses.present.mean()
        print(f"{log}: {len(poses.stamps)} frames of {len(poses.names)} bodies, {visible:.1f} % seen")
        for remark in remarks:
            print(f"import-motive: warning: {path}: {remark}", file=sys.stderr)
    target = chosen.session / "session.yaml"
    if not target.exists():
        target.write_text(propose([survey(log) for log in sorted(chosen.session.glob("*.mcap"))], UPS))
        print(f"{target}: proposed; check each trial's experiment, level and split")
    elif new := [log.name for log in logs.values() if log.name not in named_logs(target)]:
        print(f"{target}: left as it is, without {', '.join(new)}: add what is missing to its trials")
    return 0


def _require_new(logs: dict[Path, Path], exports: list[Path], unit: str | None) -> None:
    """Refuse exports that would become one log, and one that would replace a log of another take."""
    first: dict[Path, Path] = {}
    for path in exports:
        log = logs[path]
        if log in first:
            problem = f"{path}: found {first[log]} of the same name, and both would become {log}"
            raise InputError(f"{problem}, expected each take under a name of its own")
        first[log] = path
    for path, log in logs.items():
        if log.exists() and not _becomes(path, log, unit):
            problem = f"{path}: found {log} there already, of another take or unit"
            raise InputError(f"{problem}, expected a name of its own, or that you delete that log first")


def _becomes(path: Path, log: Path, unit: str | None) -> bool:
    """Whether a log is what an export would be converted to."""
    with tempfile.TemporaryDirectory() as folder:
        anew = Path(folder) / log.name
        write_log(anew, read_export(path, unit).poses)
        return anew.read_bytes() == log.read_bytes()


if __name__ == "__main__":
    sys.exit(main())
