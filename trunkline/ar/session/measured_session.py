"""What cameras measured in a live session, as a session that `ingest`, `evaluate` and `monitor` read: the folder
live_logs/RUN/ beside the log live_logs/RUN.mcap.

    python -m trunkline.ar.session.measured_session LOG…

A plan moves the mount as well as the motors, so what can be identified from is the rest that it leads to: a
`static_pull`. The folder has a log for each plan after which the arm came to rest: bodies as cameras saw them in that
rest, and what joints and motors were sent and measured since the plan began; session.yaml; identify.yaml, the list
with which `trunkline batch` identifies from it; and marker_validation.json.
"""

import argparse
import sys
from collections.abc import Iterator, Sequence
from dataclasses import dataclass
from pathlib import Path

import numpy as np
import yaml
from mcap.writer import Writer

from trunkline.ar.correction.rest import WINDOW, RestWatch
from trunkline.ar.session.log_format import BASE, JOINTS, JOINTS_SENT, MEASURED, TENDONS, TENDONS_SENT
from trunkline.ar.session.log_reader import LogReader, session_log
from trunkline.ar.session.preview_validation import holds
from trunkline.errors import InputError, in_one_line
from trunkline.pipeline.stage import output_folder, write_json
from trunkline.program import COMMAND
from trunkline.recordings.logs.joint_stream import joint_stream
from trunkline.recordings.logs.mcap_log import Log, read_log
from trunkline.recordings.logs.pose_stream import PoseStream, pose_stream
from trunkline.recordings.trials.splits import IDENTIFY, TEST, VALIDATE

CUT = (MEASURED, JOINTS_SENT, JOINTS, TENDONS_SENT, TENDONS)  # topics of a plan's log
SPLITS = (IDENTIFY, VALIDATE, TEST, IDENTIFY, IDENTIFY)  # of plans, in their order, again and again
LONGEST = 10.0  # s of rest: later, the log has a few samples a second
SPACING = 1 / 24  # s between poses: of a camera's frames a session looks at the newest of each tick, unevenly
BEFORE = 1.0  # s before a plan from which on its log has commands
UNCHANGED = 1e-9  # rad and m, by which what is sent to a robot at rest differs
VISIBLE = 0.3  # share of a rest's poses in which each body is, at least
STATICS = "static_pull"
LIST, VALIDATION = "identify.yaml", "marker_validation.json"


@dataclass(frozen=True)
class PlanRest:
    """A rest that an executed plan led to.

    number: of the plan, from 1. begun: when it was started, since and until: of the rest, s of the events' clock.
    positions: of the bodies, mean over the rest, m, NaN where a body is not seen in it. Shape (B, 3). foreseen: where
    the plan's preview ends with them, m, NaN where that is unknown. Shape (B, 3). corrected: whether commands were
    corrected before it.
    """

    number: int
    begun: float
    since: float
    until: float
    positions: np.ndarray
    foreseen: np.ndarray
    corrected: bool


@dataclass(frozen=True)
class PlanRests:
    """rests: after plans, in their order. left_out: why others have none, a line each. names: of the bodies."""

    rests: tuple[PlanRest, ...]
    left_out: tuple[str, ...]
    names: tuple[str, ...]


def plan_rests(reader: LogReader, log: Log) -> PlanRests:
    """What cameras measured of an arm at rest after the plans of a session. log: the same, read as messages."""
    names, mount = tuple(reader.begin.get("measured", ())), reader.begin.get("mount", "")
    if not names:
        return PlanRests((), ("the session had no cameras (--cameras)",), ())
    if not mount:
        return PlanRests((), ("no body is at the arm's mount, in whose frame the others would be",), names)
    if MEASURED not in log.topics:
        return PlanRests((), ("the cameras' poses are not in the log",), names)
    poses = pose_stream({None: log.topics[MEASURED]})
    changes = _changes(log, reader.zero)
    rests, left_out, number = [], [], 0
    for index, event in enumerate(reader.events):
        if event["event"] != "execute" or event["refused"]:
            continue
        number += 1
        try:
            rests += _rests_of(number, index, reader, poses, names, changes)
        except ValueError as error:
            left_out.append(f"plan {number} at {event['time'] - reader.begin['time']:.0f} s: {error}")
    if not number:
        left_out.append("no plan was executed")
    return PlanRests(tuple(rests), tuple(left_out), names)


def _rests_of(
    number: int, index: int, reader: LogReader, poses: PoseStream, names: tuple[str, ...], changes: np.ndarray
) -> list[PlanRest]:
    """
    Raises:
        ValueError: why there is none.
    """
    event, before, later = reader.events[index], reader.events[:index], reader.events[index + 1 :]
    begun, digest, times = event["time"], event["digest"], 1e-9 * (poses.stamps - reader.zero)
    request = next((e["request"]["targets"] for e in reversed(before) if e["event"] == "request"), {})
    if request.get("thing") or holds(before):
        raise ValueError("the arm grasps or holds something, whose weight nobody measured")
    after = [e["time"] for e in later if e["event"] == "request" or not e.get("refused", True)]  # or execute, follow
    until = min([*after[:1], float(times[-1])])
    done = next((e["time"] for e in later if e["event"] == "robot" and e["robot"]["mode"] == "done"
                 and e["robot"]["digest"] == digest and e["time"] <= until), None)  # fmt: skip
    if done is None:
        raise ValueError("it did not arrive")
    corrections = [e["time"] for e in later if e["event"] == "correction" and e["digest"] == digest]
    moved = changes[(changes > begun) & (changes < until)]
    edges = [max(moved[moved <= done], default=done), *moved[moved > done], until]
    foreseen = _foreseen(before, digest, len(names))
    rests, reason = [], "the arm was not seen at rest"
    if names[-1] not in poses.names:
        raise ValueError(f"no camera saw {names[-1]!r}")
    tips = poses.positions[:, poses.names.index(names[-1])]
    for since, end in zip(edges[:-1], edges[1:], strict=True):
        rows = np.flatnonzero((times > since) & (times < end))
        span = _rest(times[rows], tips[rows])
        if span is None:
            continue
        rows = rows[(times[rows] >= span[0]) & (times[rows] <= span[1])]
        if fault := _fault(reader.events, span[1]):
            reason = f"cameras: {fault}"
            continue
        positions, shares = _means(poses, rows, names)
        if (shares < VISIBLE).any():
            worst = int(np.argmin(shares))
            reason = f"{names[worst]!r} is in {100 * shares[worst]:.0f} % of the poses, expected {100 * VISIBLE:g} %"
            continue
        corrected = sum(time <= span[1] for time in corrections) > 1
        rests.append(PlanRest(number, begun, *span, positions, foreseen, corrected))
    if not rests:
        raise ValueError(reason)
    return rests


def _changes(log: Log, zero: int) -> np.ndarray:
    """Times, s, at which joints or motors were sent anything new, in their order. Shape (N,)."""
    times = [np.empty(0)]
    for topic in (JOINTS_SENT, TENDONS_SENT):
        if topic in log.topics:
            stream = joint_stream(log.topics[topic])
            changed = np.abs(np.diff(stream.positions, axis=0)).max(axis=1) > UNCHANGED
            times.append(1e-9 * (stream.stamps[1:][changed] - zero))
    return np.sort(np.concatenate(times))


def _rest(times: np.ndarray, tip: np.ndarray) -> tuple[float, float] | None:
    """From when, s, until when a body rests whose positions (T, 3) are of `times` (T,); None where it does not."""
    watch = RestWatch()
    for time, position in zip(times, tip, strict=True):
        if watch.observe(float(time), position):
            return float(time) - WINDOW, min(float(times[-1]), float(time) - WINDOW + LONGEST)
    return None


def _fault(events: list[dict], until: float) -> str:
    """Why cameras were not to be relied on at `until`, s; "" where they were."""
    return next((e["fault"] for e in reversed(events) if e["event"] == "cameras" and e["time"] <= until), "")


def _means(poses: PoseStream, rows: np.ndarray, names: tuple[str, ...]) -> tuple[np.ndarray, np.ndarray]:
    """Mean positions (B, 3), m, of the bodies in some rows, and the shares (B,) of these in which they are seen."""
    positions, shares = np.full((len(names), 3), np.nan), np.zeros(len(names))
    for body, name in enumerate(names):
        column = poses.names.index(name) if name in poses.names else None
        if column is None:
            continue
        visible = poses.present[rows, column]
        shares[body] = visible.mean()
        if visible.any():
            positions[body] = np.median(poses.positions[rows[visible], column], axis=0)
    return positions, shares


def _foreseen(before: list[dict], digest: str, bodies: int) -> np.ndarray:
    """Where the preview of a plan ends with the bodies, m, NaN where that is unknown. Shape (B, 3)."""
    positions = np.full((bodies, 3), np.nan)
    begun = max((i for i, e in enumerate(before) if e["event"] == "preview" and e["preview"]["digest"] == digest),
                default=len(before))  # fmt: skip
    for event in before[begun:]:
        if event["event"] == "piece" and event.get("markers"):
            positions = np.array([[np.nan] * 3 if place is None else place for place in event["markers"]])
    return positions


def marker_validation(measured: PlanRests) -> dict:
    """Previews against what happened, by markers at rest, before anything was corrected: a row a plan, and their
    medians. In mm."""
    first: dict[int, PlanRest] = {}
    for rest in measured.rests:
        if not rest.corrected and np.isfinite(rest.foreseen).any():
            first.setdefault(rest.number, rest)
    rows = []
    for rest in first.values():
        errors = 1e3 * np.linalg.norm(rest.positions - rest.foreseen, axis=1)
        finite = errors[1:][np.isfinite(errors[1:])]
        if len(finite):
            rows.append({"plan": rest.number, "mean_mm": float(finite.mean()),
                         "worst_mm": float(finite.max()),
                         "last_mm": float(errors[-1]) if np.isfinite(errors[-1]) else None,
                         "mount_mm": float(errors[0]) if np.isfinite(errors[0]) else None})  # fmt: skip
    table: dict = {"markers": list(measured.names[1:]), "plans": rows}
    for key in ("mean_mm", "last_mm", "mount_mm"):
        values = [row[key] for row in rows if row[key] is not None]
        table[key] = float(np.median(values)) if values else None
    return table


def write_session(path: Path, out: Path | None = None) -> list[str]:
    """Write the session of the log at `path` into the folder `out`, by default that of the log's name beside it, and
    say what it is, a line each. Where nothing was measured there is none, and the first line says so.

    Raises:
        InputError: it is no log of a live session, or the folder cannot be written.
    """
    out = out or path.with_suffix("")
    log = read_log(path)
    reader = session_log(log)
    measured = plan_rests(reader, log)
    left_out = [f"session: left out: {line}" for line in measured.left_out]
    if not measured.rests:
        return [f"session: nothing was measured: {'; '.join(measured.left_out)}"]
    last = {rest.number: rest for rest in measured.rests}  # of each plan: after its corrections
    trials = []
    validation = marker_validation(measured)
    try:
        with output_folder(out) as folder:
            for rest, split in zip(last.values(), _splits(), strict=False):
                name = f"plan_{rest.number:02d}"
                _write_log(folder / f"{name}.mcap", log, rest, reader.zero)
                trials.append({"file": f"{name}.mcap", "experiment": STATICS, "split": split})
            _write_yaml(folder / "session.yaml", _session(reader, trials))
            _write_yaml(folder / LIST, identification(out.name))
            write_json(folder / VALIDATION, validation, digits=4)
    except OSError as error:
        raise InputError(f"{out}: {(error.strerror or str(error)).lower()}, expected a folder to write") from error
    counted = f"{len(trials)} of {len(trials) + len(measured.left_out)} plans"
    lines = [f"session: {out}: the arm at rest after {counted}", *left_out]
    if validation["plans"]:
        mean, count = validation["mean_mm"], len(validation["plans"])
        lines.append(f"session: markers at rest {mean:.1f} mm from their previews, median of {count} plans")
    return [*lines, how_to_identify(out, [trial["split"] for trial in trials])]


def how_to_identify(folder: Path, splits: Sequence[str]) -> str:
    """The command that identifies from a session of such trials, or what they lack for it."""
    if missing := [split for split in (IDENTIFY, VALIDATE) if split not in splits]:
        count = f"{len(splits)} plan{'' if len(splits) == 1 else 's'} at rest"
        return f"session: found {count} and none to {missing[0]}, expected at least 2 to identify from"
    return f"session: to identify from it: {COMMAND} batch {folder / LIST} --until identify_stiffness"


def _splits() -> Iterator[str]:
    while True:
        yield from SPLITS


def identification(name: str) -> dict:
    """identify.yaml of the session `name`: the project's pipeline, with what shapes at rest under pull tell alone."""
    kinds = {"source": "statics", "experiments": [STATICS], "reported": [STATICS]}
    return {"reference": "none", "arms": [{"name": name, "session": ".", "params": {"identify_stiffness": kinds}}]}


def _session(reader: LogReader, trials: list[dict]) -> dict:
    return {
        "frame": {"name": BASE, "up": [0.0, 0.0, 1.0]},
        "base": reader.begin["mount"],
        "markers": {name: name for name in reader.begin["measured"][1:]},
        "topics": {"poses": MEASURED, "commands": TENDONS_SENT, "tendon_positions": TENDONS},
        "even_times": False,  # a pose is dated by when it was taken, and looks are seldom where nothing moves
        "trials": trials,
    }


def _write_yaml(path: Path, content: dict) -> None:
    path.write_text(yaml.safe_dump(content, sort_keys=False, allow_unicode=True), encoding="utf-8")


def _write_log(path: Path, log: Log, rest: PlanRest, zero: int) -> None:
    """The messages of a plan, as they are: poses of its rest, and what was sent and measured since it began."""
    begin, since, until = (zero + round(1e9 * time) for time in (rest.begun - BEFORE, rest.since, rest.until))
    with open(path, "wb") as file:
        writer, messages = Writer(file), []
        writer.start(profile="ros2", library=COMMAND)
        for name in CUT:
            topic = log.topics.get(name)
            if topic is None:
                continue
            channel = writer.register_channel(
                name, topic.encoding, writer.register_schema(topic.schema, topic.schema_encoding, topic.definition)
            )
            times = topic.log_times
            inside = np.flatnonzero((times >= (since if name == MEASURED else begin)) & (times <= until))
            if name == MEASURED:
                inside = _spaced(times, inside)
            messages += [(int(times[row]), channel, topic.messages[row]) for row in inside]
        for time, channel, message in sorted(messages, key=lambda entry: entry[0]):
            writer.add_message(channel, time, message, time)
        writer.finish()


def _spaced(times: np.ndarray, rows: np.ndarray) -> list[int]:
    """Those of `rows` of ns (N,) that are SPACING apart, but for some frames."""
    chosen: list[int] = []
    for row in rows:
        if not chosen or times[row] - times[chosen[-1]] >= 0.8e9 * SPACING:
            chosen.append(int(row))
    return chosen


@in_one_line
def main(arguments: list[str]) -> int:
    summary = (__doc__ or "").split("\n")[0]
    parser = argparse.ArgumentParser(prog="python -m trunkline.ar.session.measured_session", description=summary)
    parser.add_argument("logs", type=Path, nargs="+", metavar="log")
    for path in parser.parse_args(arguments).logs:
        print("\n".join(write_session(path)))
    return 0


if __name__ == "__main__":
    sys.exit(main(sys.argv[1:]))
