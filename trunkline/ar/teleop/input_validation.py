"""Whether an input can be trusted. What cannot has a one-line answer, and the robot holds."""

import math
from collections.abc import Iterable

from trunkline.ar.teleop.messages import Controller, Input, Pose
from trunkline.ar.teleop.tracked_controller import Hand
from trunkline.ar.teleop.vectors import distance

UNIT = 1e-2  # by which the length of a quaternion may differ from 1


def fault_of(controller: Controller) -> str:
    """Why a controller's pose cannot be used, "" where it can."""
    if not controller.tracked:
        return "not tracked"
    if not _finite((*controller.position, *controller.quaternion, *controller.stick)):
        return "pose is not a number"
    if abs(math.sqrt(sum(x * x for x in controller.quaternion)) - 1) > UNIT:
        return "quaternion is not of unit length"
    return ""


def clock_fault(last: float | None, message: Input, dt: float) -> str:
    """Why time cannot be trusted, "" where it can."""
    if not math.isfinite(dt) or dt <= 0:
        return f"step of {dt:g} s: expected a positive time; holding"
    if not math.isfinite(message.stamp):
        return "stamp is not a number; holding"
    return (
        f"clock went back by {last - message.stamp:.3g} s; holding" if last is not None and message.stamp < last else ""
    )


def setting_fault(message: Input, package: str) -> str:
    """Why the robot, its base or the package cannot be trusted."""
    if message.package != package:
        return f"package: found digest {message.package[:12] or 'none'}, expected {package[:12]}; holding"
    if message.alignment is None:
        return "base is not aligned; holding"
    if not _sound(message.alignment):
        return "base alignment is not a pose; holding"
    if not _finite(message.joints):
        return "robot's joints are not numbers; holding"
    return ""


def swapped(left: Hand, right: Hand, message: Input, within: float) -> bool:
    """Whether each controller appears where the other was: at most `within` m from there, and further from its own."""
    if left.controller is None or right.controller is None:
        return False
    a, b, c, d = left.controller.position, right.controller.position, message.left.position, message.right.position
    across, along = max(distance(c, b), distance(d, a)), min(distance(c, a), distance(d, b))
    return across <= within and along > 2 * within


def _sound(pose: Pose) -> bool:
    values = (*pose.position, *pose.quaternion)
    return _finite(values) and abs(math.sqrt(sum(x * x for x in pose.quaternion)) - 1) <= UNIT


def _finite(values: Iterable[float]) -> bool:
    return all(math.isfinite(value) for value in values)
