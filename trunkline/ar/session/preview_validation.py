"""Predictions of a live session compared with what happened, from its log alone.

    python -m trunkline.ar.session.preview_validation LOG…

A line for each plan that was executed: how far the tip was from the preview's, whether it ended within the spread, and
the predicted and the actual outcome of the grasp. The robot begins a plan some ms after the command; this delay is the
one for which both paths are nearest, and is printed. On a real robot the arm is not measured: the mount, from the
measured joints, is compared in place of the tip, and neither spread nor grasp is judged.
"""

import argparse
import sys
from collections.abc import Iterator
from dataclasses import dataclass
from pathlib import Path

import numpy as np
from scipy.optimize import minimize_scalar

from trunkline.ar.session.log_format import SIMULATED, WRIST
from trunkline.ar.session.log_reader import LogReader, read_session_log, tip_path
from trunkline.errors import in_one_line
from trunkline.kinematics.panda.kinematics import FLANGE, mount_pose
from trunkline.kinematics.panda.maker_model import JOINTS

LATEST = 0.25  # s that a robot may need to begin
FEWEST = 5  # poses of a path that is compared


@dataclass(frozen=True)
class Execution:
    """Of a plan, `digest`, begun at `time`, s since the session began.

    end: last state of the robot. median, worst: distance of the tip from the preview's, m, over `seconds` of it;
    delay: s by which the robot was later; NaN without a path. within: whether the tip ended within the spread;
    None where it did not come so far. probability: predicted, of the grasp; success: whether the arm
    holds the object. None where nothing was to be grasped, or the plan did not end. visible: whether the arm was
    measured; if not, distances are the mount's, and `within` and `success` are None.
    """

    digest: str
    time: float
    end: str
    seconds: float
    median: float
    worst: float
    delay: float
    within: bool | None
    probability: float | None
    success: bool | None
    visible: bool = True


def executions(log: LogReader) -> Iterator[Execution]:
    """In their order, of those that the robot began."""
    events, begin = log.events, log.begin
    visible = log.hardware == SIMULATED
    rows, place = ("poses", begin["tip"]["place"]) if visible else (WRIST, (0.0, 0.0, FLANGE + begin["mount_offset"]))
    times, path = _visible_path(log, begin["tip"]["body"], place) if visible else _measured(log, begin["mount_offset"])
    for index, event in enumerate(events):
        if event["event"] != "execute" or event["refused"]:
            continue
        digest, since = event["digest"], event["time"]
        later = [other for other in events[index + 1 :]]
        end, until = _end(later, digest, float(times[-1]) if len(times) else since)
        frame_times, preview = _preview(events[:index], digest, rows, place)
        done = end == "done"
        seconds, median, worst, delay, last = _compared(times - since, path, frame_times, preview, until - since, done)
        prediction = next((e["foreseen"] for e in reversed(events[:index]) if _is_of(e, "foreseen", digest)), None)
        within = None
        if visible and prediction is not None and last is not None and prediction["spread"]:
            within = bool(np.linalg.norm(last - np.array(prediction["tip"][-1])) <= prediction["spread"][-1])
        probability = None if prediction is None else prediction["probability"]
        success = _grasped(events[:index], later) if visible and done and probability is not None else None
        since_begin = since - begin["time"]
        yield Execution(digest, since_begin, end, seconds, median, worst, delay, within, probability, success, visible)


def _is_of(event: dict, kind: str, digest: str) -> bool:
    return event["event"] == kind and event[kind]["digest"] == digest


def _visible_path(log: LogReader, body: str, place) -> tuple[np.ndarray, np.ndarray]:
    """Times of the log's clock, s (T,), and the tip from the logged poses (T, 3)."""
    poses = log.poses
    if poses is None or body not in poses.names or poses.quaternions is None:
        return np.empty(0), np.empty((0, 3))
    row = poses.names.index(body)
    there = poses.present[:, row]
    path = np.concatenate([poses.positions[there, row], poses.quaternions[there, row]], axis=1)
    return 1e-9 * (poses.stamps[there] - log.zero), tip_path(path, place)


def _measured(log: LogReader, mount_offset: float) -> tuple[np.ndarray, np.ndarray]:
    """Times of the log's clock, s (T,), and the mount from the measured joints (T, 3); none without them."""
    joints = log.joints
    if joints is None or not set(JOINTS) <= set(joints.names):
        return np.empty(0), np.empty((0, 3))
    positions = joints.positions[:, [joints.names.index(name) for name in JOINTS]]
    there = np.isfinite(positions).all(axis=1)
    return 1e-9 * (joints.stamps[there] - log.zero), mount_pose(positions[there], mount_offset)[0]


def _preview(before: list[dict], digest: str, rows: str, place) -> tuple[np.ndarray, np.ndarray]:
    """Times of the plan (F,), s, and the previewed point (F, 3) at `place`, m, of the body whose poses are `rows`."""
    begun = max((i for i, e in enumerate(before) if _is_of(e, "preview", digest)), default=None)
    if begun is None:
        return np.empty(0), np.empty((0, 3))
    step, times, poses = before[begun]["preview"]["step"], [], []
    for event in before[begun:]:
        if event["event"] == "piece":
            times += [event["begins"] + step * frame for frame in range(len(event[rows]))]
            poses += event[rows]
    return np.array(times), tip_path(np.array(poses).reshape(-1, 7), place)


def _end(later: list[dict], digest: str, last: float) -> tuple[str, float]:
    """State of the robot at the end of a plan, and the time, s, until which that plan ran as it was previewed."""
    end, until = "the log ends", last
    for event in later:
        if event["event"] == "waits" and end == "the log ends":  # for its page: it is later from then on
            last = min(last, event["time"])
        if event["event"] in ("execute", "correction"):  # the tip's place is looked at before it is corrected
            return end, min(until, last, event["time"])
        robot = event.get("robot") if event["event"] == "robot" else None
        if robot is None or end != "the log ends":
            continue
        if robot["mode"] in ("done", "fault") or (robot["mode"] == "idle" and robot["digest"] == digest):
            end = str(robot["fault"] or ("held" if robot["mode"] == "idle" else robot["mode"]))
            until = last if end == "done" else min(last, event["time"])
    return end, min(until, last)


def _compared(
    times: np.ndarray, tips: np.ndarray, frame_times: np.ndarray, path: np.ndarray, until: float, done: bool
) -> tuple[float, float, float, float, np.ndarray | None]:
    """s compared, median and largest distance, delay, and where the tip was at the preview's end, if it came there."""
    if len(frame_times) < FEWEST:
        return 0.0, np.nan, np.nan, np.nan, None

    def away(delay: float) -> np.ndarray:
        rows = (times - delay >= frame_times[0]) & (times - delay <= frame_times[-1]) & (times <= until)
        foreseen = np.stack([np.interp(times[rows] - delay, frame_times, axis) for axis in path.T], axis=1)
        return np.linalg.norm(tips[rows] - foreseen, axis=1)

    if len(away(0.0)) < FEWEST or len(away(LATEST)) < FEWEST:
        return 0.0, np.nan, np.nan, np.nan, None
    fit = minimize_scalar(lambda delay: float(np.mean(away(delay) ** 2)), bounds=(0.0, LATEST), method="bounded")
    far, delay = away(float(fit.x)), float(fit.x)
    seconds = min(until, float(times[-1])) - delay - float(frame_times[0])
    arrived = done and times[-1] >= frame_times[-1] and until >= frame_times[-1]
    last = tips[np.searchsorted(times, frame_times[-1])] if arrived else None
    return min(seconds, float(frame_times[-1] - frame_times[0])), float(np.median(far)), float(far.max()), delay, last


def _grasped(before: list[dict], later: list[dict]) -> bool:
    """Whether the arm holds something that it did not, as believed until the next plan is asked for."""
    success = holds(before)
    for event in later:
        if event["event"] == "request":
            break
        success = holds([event]) if event["event"] == "world" else success
    return success


def holds(events: list[dict]) -> bool:
    world = next((event["world"] for event in reversed(events) if event["event"] == "world"), {"things": []})
    return any(object["support"] == "held" for object in world["things"])


def lines(results: list[Execution]) -> list[str]:
    """For people to read."""
    report = []
    for execution in results:
        parts = [f"{execution.time:8.1f} s  {execution.digest[:12]}  {execution.end}"]
        if np.isfinite(execution.median):
            point = "tip" if execution.visible else "mount"
            apart = f"{point} {1e3 * execution.median:.1f} mm, at most {1e3 * execution.worst:.1f} mm"
            parts.append(
                f"{apart} from the preview over {execution.seconds:.1f} s, {1e3 * execution.delay:.0f} ms later"
            )
        if execution.within is not None:
            parts.append("ended within the spread" if execution.within else "ended beyond the spread")
        if execution.probability is not None:
            came = "not tried to its end" if execution.success is None else "held" if execution.success else "not held"
            came = came if execution.visible else "which nobody saw"
            parts.append(f"grasp foreseen at {execution.probability:.2f}, {came}")
        report.append("; ".join(parts))
    judged = [
        (execution.probability, execution.success)
        for execution in results
        if execution.probability is not None and execution.success is not None
    ]
    ended = [execution.within for execution in results if execution.within is not None]
    report.append(f"{len(results)} executed")
    if ended:
        report[-1] += f"; {sum(ended)} of {len(ended)} tips ended within the spread"
    if judged:
        agreed = sum((probability >= 0.5) == success for probability, success in judged)
        brier = sum((probability - success) ** 2 for probability, success in judged) / len(judged)
        report[-1] += f"; outcome as foreseen in {agreed} of {len(judged)}, Brier score {brier:.3f}"
    if not all(execution.visible for execution in results):
        report.append("nobody saw the arm: its shape, its tip and its grasps are not judged")
    return report


@in_one_line
def main(arguments: list[str]) -> int:
    summary = (__doc__ or "").split("\n")[0]
    parser = argparse.ArgumentParser(prog="python -m trunkline.ar.session.preview_validation", description=summary)
    parser.add_argument("logs", type=Path, nargs="+", metavar="log")
    for path in parser.parse_args(arguments).logs:
        log = read_session_log(path)
        print("\n".join([f"{path}", *(f"  {line}" for line in [*log.damage, *lines(list(executions(log)))])]))
    return 0


if __name__ == "__main__":
    sys.exit(main(sys.argv[1:]))
