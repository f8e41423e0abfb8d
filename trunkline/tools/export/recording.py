"""An MCAP file of tracks, one after another, and the layout in which Foxglove shows it."""

from typing import BinaryIO

import numpy as np
from foxglove_schemas_protobuf.Color_pb2 import Color
from google.protobuf.message import Message
from mcap.well_known import MessageEncoding, SchemaEncoding
from mcap.writer import IndexType, Writer
from mcap_protobuf.schema import build_file_descriptor_set

from trunkline.model.arm_model import ArmModel
from trunkline.program import COMMAND
from trunkline.recordings.trials.recording import FORCE, LENGTH
from trunkline.tools.export.messages import BASE, cloud, identifier, line, numbers_type, scene, transforms
from trunkline.tools.export.tracks import Track

MEASURED, SIMULATED = "measured", "simulated"
TRIAL, ERRORS, COMMANDS, PULLS, TENSIONS = "/trial", "/errors_mm", "/commands_mm", "/pulls_mm", "/commands_N"
MEAN, TIP = "mean", "tip"
COLORS = {MEASURED: Color(r=0.13, g=0.13, b=0.13, a=1.0), SIMULATED: Color(r=0.16, g=0.44, b=0.59, a=0.6)}
BRIGHT = {MEASURED: Color(r=0.9, g=0.62, b=0.0, a=1.0), SIMULATED: Color(r=0.34, g=0.71, b=0.91, a=1.0)}  # on black
GRAVITY = tuple(f"gravity_{axis}_m_s2" for axis in "xyz")
THINNEST = 3e-3  # m, as which a body without a shape is drawn
FASTEST = 40.0  # shapes of the arm a second, at most
BEGIN = 1_000_000_000  # ns, the first stamp: 0 stands for none
PAUSE = 1_000_000_000  # ns between two trials


class Recording:
    """Writes tracks of `arm`, all with these markers and some of these tendons, to `file`."""

    def __init__(self, file: BinaryIO, arm: ArmModel, markers: tuple[str, ...], tendons: list[str]) -> None:
        self._arm, self._markers, self._tendons = arm, markers, [identifier(name) for name in tendons]
        self._tip = int(np.argmax(arm.model.site_bodyid[arm.marker_sites(markers)]))
        self._errors = numbers_type("Errors", dict.fromkeys([MEAN, TIP, *map(identifier, markers)]))
        self._pulls = numbers_type("Pulls", self._tendons)
        indexed = IndexType.CHUNK | IndexType.MESSAGE | IndexType.METADATA  # of attachments it would be an empty group
        self._writer, self._stamp = Writer(file, index_types=indexed), BEGIN
        self._writer.start(library=COMMAND)
        self._schemas: dict[str, int] = {}
        self._channels: dict[str, int] = {}

    def add(self, track: Track) -> None:
        """The trial's line, its frames, and its metadata."""
        trial, errors, begin = track.trial, track.errors, self._stamp
        tip = _mean(errors[:, self._tip])
        self._write(TRIAL, line(begin, f"{trial.name}: {trial.experiment}, {trial.split}, tip {tip:.1f} mm"))
        every = max(1, round(1 / (FASTEST * np.diff(track.time).mean()))) if len(track.time) > 1 else 1
        for frame, time in enumerate(track.time):
            self._stamp = begin + round(1e9 * time)
            self._frame(track, frame, errors[frame])
            if frame % every == 0:
                self._shape(MEASURED, self._markers, track.measured[frame])
                self._shape(SIMULATED, tuple(self._arm.markers), track.bodies[frame])
        numbers = {"begin_ns": begin, "end_ns": self._stamp, "load_kg": trial.load, "error_mm": _mean(errors),
                   "tip_error_mm": tip} | dict(zip(GRAVITY, trial.gravity, strict=True))  # fmt: skip
        words = {"trial": trial.name, "experiment": trial.experiment, "split": trial.split}
        words |= {name: f"{value:.12g}" for name, value in numbers.items()}
        self._writer.add_metadata(f"trial {trial.name}", words)  # Rerun keeps the last of a name
        self._stamp += PAUSE

    def finish(self) -> None:
        self._writer.finish()

    def _frame(self, track: Track, frame: int, errors: np.ndarray) -> None:
        turns = None if track.quaternions is None else track.quaternions[frame]
        for name, places, turned in ((MEASURED, track.measured, turns), (SIMULATED, track.simulated, None)):
            self._write(f"/{name}/tf", transforms(self._stamp, name, self._markers, places[frame], turned))
        of_markers = dict(zip(map(identifier, self._markers), errors, strict=True))
        self._write(ERRORS, self._errors(**{MEAN: _mean(errors), TIP: errors[self._tip]} | of_markers))
        moved = {COMMANDS: 1e3 * track.commands[frame], PULLS: 1e3 * track.pulls[frame]}
        if track.trial.command_unit == FORCE:
            moved = {TENSIONS: track.commands[frame]}
        for topic, values in moved.items():
            pulls = dict(zip(map(identifier, track.trial.tendons), values, strict=True))
            if pulls:
                self._write(topic, self._pulls(**dict.fromkeys(self._tendons, np.nan) | pulls))

    def _shape(self, name: str, bodies: tuple[str, ...], points: np.ndarray) -> None:
        """From the mount through the bodies' centers, each as thick as it is; and the centers alone."""
        model = self._arm.model
        owners = model.site_bodyid[self._arm.marker_sites(bodies)]
        order = np.argsort(owners)
        radii = [model.geom_size[model.geom_bodyid == body, 0].max(initial=THINNEST) for body in owners[order]]
        chain = np.concatenate([np.zeros((1, 3)), points[order]])
        self._write(f"/{name}/arm", scene(self._stamp, name, chain, np.array([radii[0], *radii]), COLORS[name]))
        self._write(f"/{name}/points", cloud(self._stamp, points, BRIGHT[name]))

    def _write(self, topic: str, message: Message) -> None:
        name = message.DESCRIPTOR.full_name
        if name not in self._schemas:
            definition = build_file_descriptor_set(type(message)).SerializeToString()
            self._schemas[name] = self._writer.register_schema(name, SchemaEncoding.Protobuf, definition)
        if topic not in self._channels:
            schema = self._schemas[name]
            self._channels[topic] = self._writer.register_channel(topic, MessageEncoding.Protobuf, schema)
        self._writer.add_message(self._channels[topic], self._stamp, message.SerializeToString(), self._stamp)


def layout(tendons: list[str], unit: str = LENGTH) -> dict:
    """What Foxglove imports by "Import layout from file": both arms, errors over time, and pulls, or tensions, by the
    commands' `unit`, if there are any."""
    views = {f"/{name}/{what}": {"visible": True} for name in (MEASURED, SIMULATED) for what in ("arm", "tf")}
    camera = {"distance": 1.5, "phi": 75, "thetaOffset": 45, "targetOffset": [0, 0, -0.3], "near": 0.01, "far": 100}
    title, topics = ("Tension, N", (TENSIONS,)) if unit == FORCE else ("Pull, mm", (COMMANDS, PULLS))
    series = [(topic, identifier(name)) for name in tendons for topic in topics]
    panels = {
        "3D!arm": {"topics": views, "followMode": "follow-none", "followTf": BASE, "cameraState": camera},
        "Plot!errors": _plot("Error, mm", [(ERRORS, MEAN), (ERRORS, TIP)]),
        "RosOut!trials": {"minLogLevel": 1, "topicToRender": TRIAL},
    } | ({"Plot!pulls": _plot(title, series)} if series else {})
    lower = _beside("column", "Plot!pulls", "RosOut!trials", 60) if series else "RosOut!trials"
    whole = _beside("row", "3D!arm", _beside("column", "Plot!errors", lower, 40), 55)
    return {"configById": panels, "globalVariables": {}, "userNodes": {}, "layout": whole}


def _beside(direction: str, first: str, second: str | dict, share: int) -> dict:
    return {"direction": direction, "first": first, "second": second, "splitPercentage": share}


def _plot(title: str, series: list[tuple[str, str]]) -> dict:
    every = {"enabled": True, "timestampMethod": "receiveTime"}
    paths = [{"value": f"{topic}.{field}"} | every for topic, field in series]
    return {"title": title, "paths": paths, "showLegend": True, "isSynced": True, "xAxisVal": "timestamp"}


def _mean(values: np.ndarray) -> float:
    """Over what is finite; NaN where nothing is."""
    return float(np.mean(values, where=np.isfinite(values))) if np.isfinite(values).any() else float("nan")
