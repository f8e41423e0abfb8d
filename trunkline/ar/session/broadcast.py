"""What all clients see of the session, tick by tick."""

import numpy as np

from trunkline.ar.session import binary, messages
from trunkline.ar.session.controller import SessionController
from trunkline.ar.session.previewer import PreviewPiece
from trunkline.ar.session.robot_process import STALE
from trunkline.ar.session.scene import Shells
from trunkline.ar.teleop.alignment import base_quaternion
from trunkline.ar.teleop.vectors import DOWN, conjugate, rotate

STATES = 0.1  # s between states that tell no new mode
DIGITS = 4  # after the decimal point, of positions, m
TURNED = np.cos(np.radians(1.0))  # of gravity in the soft base, from which on there is a new shell


class Broadcast:
    """frames: of the robot so far. shell: of the tip's reach, the newest; empty where there are none."""

    def __init__(self, controller: SessionController, shells: Shells | None) -> None:
        self.frames, self.shell = 0, b""
        self._controller, self._shells = controller, shells
        self._sent: tuple[float, messages.StateMessage | None] = (0.0, None)
        self._down, self._shelled = None, 0
        self._measured = 0.0

    def robot(self, now: float) -> bytes:
        """A frame of its bodies and of the markers."""
        controller, robot_state = self._controller, self._controller.robot.robot_state()
        assert controller.intent is not None
        self.frames += 1
        rows = np.concatenate([robot_state.bodies, controller.markers()])
        flags = {
            name
            for name, is_set in (
                ("moving", controller.robot.state().mode == "running"),
                ("stopped", controller.intent.mode == "stopped"),
                ("stale", now - robot_state.time > STALE),
            )
            if is_set
        }
        return binary.frame("robot", flags, len(rows), self.frames & 0xFFFFFFFF, robot_state.time, rows)

    def new_shell(self, now: float) -> bytes:
        """Of the tip's reach, where gravity has turned; else nothing."""
        intent, shells = self._controller.intent, self._shells
        if shells is None or intent is None:
            return b""
        down = np.array(DOWN)
        if intent.targets is not None:
            turn = base_quaternion(intent.targets.pointing, intent.targets.heading)
            down = np.array(rotate(conjugate(turn), DOWN))
        if self._down is not None and down @ self._down > TURNED:
            return b""
        self._down, points = down, shells.at(down)
        self._shelled += 1
        self.shell = binary.frame("shell", set(), len(points), self._shelled, now, points)
        return self.shell

    def new_state(self, now: float, holder: str) -> messages.StateMessage | None:
        """What has changed, a new mode at once, all else every STATES; None where nothing is to be told."""
        (since, before), intent, robot = self._sent, self._controller.intent, self._controller.robot.state()
        assert intent is not None
        urgent = before is None or (intent.mode, robot.mode, robot.fault) != (before.mode, before.robot, before.fault)
        if not urgent and now - since < STATES:
            return None
        state = self._controller.state_message(holder)
        if state == before:
            return None
        self._sent = now, state
        return state

    def new_measured(self, now: float) -> messages.MeasuredMessage | None:
        """The arm as cameras see it, every STATES; None without, or too soon."""
        controller = self._controller
        arm = controller.arm
        if arm is None or now - self._measured < STATES:
            return None
        self._measured = now
        tip, apart = _point(arm.tip), None
        drawn = controller.drawn_tip()
        if tip is not None and drawn is not None:
            apart = round(float(np.linalg.norm(arm.tip - drawn)), DIGITS)
        from_preview, radius = None, None
        if tip is not None and controller.arrived is not None:
            place, radius = controller.arrived
            from_preview = round(float(np.linalg.norm(arm.tip - place)), DIGITS)
        markers = tuple(_point(pose[:3]) for pose in arm.poses)
        figures = round(arm.age, 3), round(arm.rate, 1), round(arm.loss, 3)
        preview = from_preview, radius
        return messages.MeasuredMessage(markers, tip, apart, *figures, arm.fault, *preview, controller.cameras_frame)


def _point(position: np.ndarray) -> messages.Point | None:
    if not np.isfinite(position).all():
        return None
    x, y, z = (round(float(value), DIGITS) for value in position)
    return x, y, z


def piece(frames: PreviewPiece) -> bytes:
    """Of a preview."""
    flags = {"last"} if frames.last else set()
    return binary.frame("preview", flags, frames.poses.shape[1], frames.first, frames.time, frames.poses)
