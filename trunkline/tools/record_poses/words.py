"""Poses to record in words: the table, the trials of session.yaml, and what to do."""

import csv
import io
import textwrap
from dataclasses import dataclass

import numpy as np
import yaml

from trunkline.model.arm_model import ArmModel
from trunkline.recordings.trials.splits import VALIDATE
from trunkline.tools.record_poses.draw import Mounts, PosesToRecord

CREEP = 0.01  # share of the way to rest that may be left
LEAST_WAIT = 20.0  # s to rest at least: releases of some seconds do not show how a printed arm creeps after that
RAMP, LEAD, RECORDED = 3.0, 2.0, 3.0  # s to let cables out or draw them in; of a log before that; of a log at rest


@dataclass(frozen=True)
class Schedule:
    """hang: s that the arm hangs with loose cables before a pose. wait: s from the end of a ramp to rest."""

    hang: float
    wait: float

    @classmethod
    def of(cls, arm: ArmModel) -> "Schedule":
        """By which the slowest branch of an arm creeps to rest but for a hundredth of the way."""
        times = [arm.model.dof_damping[part.branch] / arm.model.tendon_stiffness[part.tendon] for part in arm.branches]
        slowest = max((float(time.max(initial=0.0)) for time in times), default=0.0)
        rest = float(np.ceil(-np.log(CREEP) * slowest))
        return cls(max(rest, LEAD), max(rest, LEAST_WAIT))

    @property
    def window(self) -> tuple[float, float]:
        """At rest, s from the first pose of a log."""
        begin = LEAD + RAMP + self.wait
        return begin, begin + RECORDED

    @property
    def cycle(self) -> float:
        """From one pose to the next, s."""
        return RAMP + self.hang + RAMP + self.wait + RECORDED

    def minutes(self, poses: PosesToRecord, mount_minutes: float) -> float:
        """That all `poses` take in their order, with so many for each turn of the mount."""
        moved = int((poses.mounts[0] != 0).any()) + int((np.diff(poses.mounts, axis=0) != 0).any(axis=1).sum())
        return len(poses) * self.cycle / 60 + moved * mount_minutes


def pose_names(count: int) -> list[str]:
    digits = max(2, len(str(count)))
    return [f"pose_{number:0{digits}d}" for number in range(1, count + 1)]


def table(poses: PosesToRecord, names: list[str]) -> str:
    """poses.csv, a row a pose: the mount in degrees, what each motor is sent and the twin's tip in mm."""
    file = io.StringIO()
    writer = csv.writer(file, lineterminator="\n")
    tendons = [f"{name}_mm" for name in names]
    writer.writerow(["pose", "tilt_deg", "azimuth_deg", *tendons, "tip_x_mm", "tip_y_mm", "tip_z_mm"])
    for name, mount, pulls, tip in zip(pose_names(len(poses)), poses.mounts, poses.pulls, poses.tips, strict=True):
        numbers = [*(f"{value:g}" for value in mount), *(f"{1e3 * value:.1f}" for value in (*pulls, *tip))]
        writer.writerow([name, *numbers])
    return file.getvalue()


def session_lines(count: int, names: list[str], mounts: Mounts, schedule: Schedule) -> list[str]:
    """A session.yaml with a trial a pose. All above `trials` is for a session of its own, and partly guessed."""
    frame = {"up": [0, 0, 1]} | ({"gravity": "none"} if mounts.weightless else {})
    lines = [
        "# Poses at rest of `trunkline record-poses`. To add them to the session from which the arm was identified,",
        "# put their logs beside that one's, and the lines below `trials` into its session.yaml. To use this file as",
        "# it is, check the lines above `trials`.",
        f"frame: {_flow(frame)}  # a guess: the direction against gravity in the cameras' frame",
        "base: base  # a guess: the name of the body on the mount",
        f"tendons: {_flow({name: name for name in names})}  # a guess: names in the log, to the model's",
        "trials:",
    ]
    for name in pose_names(count):
        entry = {"file": f"{name}.mcap", "window": [*map(_plain, schedule.window)]}
        lines.append(f"  - {_flow(entry | {'experiment': 'static_pull', 'split': VALIDATE})}")
    return lines


def how_lines(poses: PosesToRecord, mounts: Mounts, schedule: Schedule, mount_minutes: float) -> list[str]:
    """What a lab does with each row of the table."""
    out, begin, lines = -1e3 * poses.pulls.min(), schedule.window[0], []
    if mounts.tilt_deg:
        count, rest = len(np.unique(poses.mounts, axis=0)), "standing" if mounts.standing else "hanging"
        lines.append(
            f"the mount has {count} tilts, one after the other: turn it by tilt_deg from the {rest} arm, so that "
            "gravity pulls the arm towards azimuth_deg of its base (0° is x, 90° is y); a few degrees more or less do "
            "no harm"
        )  # fmt: skip
    elif not mounts.weightless:
        lines.append(f"the mount stays as it is, the arm {'standing' if mounts.standing else 'hanging'} straight")
    lines += [
        f"let all cables out by {out:.0f} mm from the straight arm within {RAMP:g} s, and wait {schedule.hang:g} s",
        f"start the pose's log, and {LEAD:g} s later draw its motors in to the row's pulls, evenly within {RAMP:g} s; "
        f"those at {-out:.0f} mm stay loose",
        f"touch nothing for {schedule.wait:g} s, until the arm has crept to rest, record {RECORDED:g} s more, "
        f"and stop the log: its trial is from {begin:g} s on",
        "compare the tip, in the base's frame, with the row's: centimetres beside it mean wrong signs, units, names "
        "or sides",
        "a map holds for how poses were reached: where the arm is later driven from pose to pose, do so here, "
        "in the order of the rows",
    ]  # fmt: skip
    minutes = schedule.minutes(poses, mount_minutes)
    by_hand = f", with {mount_minutes:g} for each tilt of the mount" if mounts.tilt_deg else ""
    wrapped = [textwrap.fill(line, 110, initial_indent="  - ", subsequent_indent="    ") for line in lines]
    return [f"how, for each row, in all some {minutes:.0f} minutes{by_hand}:", *wrapped]


def _flow(value: dict) -> str:
    return yaml.safe_dump(value, default_flow_style=True, sort_keys=False, width=1000).strip()


def _plain(value: float) -> int | float:
    return int(value) if value == int(value) else value
