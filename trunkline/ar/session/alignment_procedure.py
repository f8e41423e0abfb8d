"""How one client's room comes to stand in the robot's base, step by step: by eye, by touches, by an anchor.

It has no sockets and no clock. What it gives the core is None until the base's place may be relied on.

    place → tip → touch → done          touched anew: where the tip is, then six places
    place → done                        put there by eye, where the settings allow it
    place → (tip →) check → done        an anchor of another day, and one touch that says whether it still holds
    done → lost → done                  an anchor that was lost, and is back
"""

from datetime import UTC, datetime
from typing import NamedTuple

import numpy as np

from trunkline.ar.session import messages
from trunkline.ar.session.anchors import Anchor
from trunkline.ar.session.registration import (
    POSES,
    Dwell,
    after,
    expected_error,
    fit,
    in_base,
    inverse,
    residuals,
    suspect,
    tilt,
    tip_of,
)
from trunkline.ar.session.settings import AlignmentSettings
from trunkline.ar.teleop.messages import Pose, Vector
from trunkline.ar.teleop.vectors import Quaternion, add, angle_between, distance, rotate
from trunkline.errors import InputError

TURNED = 0.01  # rad by which a pose must differ from the last to tell of the tip
UNTRACKED = "The controller is not tracked, its position at most a guess: no touch."
UNIT = 1e-2  # by which the length of a quaternion may differ from 1
CREEP, CREEP_TURN = 0.002, 0.002  # m and rad that an anchor may creep: a new alignment voids a plan

NEXT: dict[messages.AligningStep, str] = {
    "place": "Hold both grips to carry the robot to its place. A: it stands there. Stick pressed: touch it instead.",
    "tip": "Rest the controller’s tip in a dent, and turn the controller about it, every way.",
    "touch": "Hold the tip still on the flange’s mark, touch {0} of {1}. Move the robot between touches.",
    "check": "Hold the tip still on the flange’s mark once: it says whether the base still is where it was. "
    "Stick pressed: align anew. A: put it there by eye.",
    "lost": "The headset has lost the robot’s place. Look around; the robot holds until it is found.",
    "done": "",
}


class ControllerPose(NamedTuple):
    """A tracked controller, in the reference frame."""

    position: Vector
    quaternion: Quaternion


class AlignmentProcedure:
    """Of one client. `stored`: its anchor of another day, to be restored; None where there is none.

    `alignment`: pose of the reference frame in the base, None where it must not be relied on. `expected`: error where
    it is told, m; None where nothing tells.
    """

    def __init__(self, settings: AlignmentSettings, stored: Anchor | None = None) -> None:
        self.settings = settings
        self.stored = stored if self._is_trusted(stored) else None
        self.reset()

    def reset(self) -> None:
        """Nothing is known of the room any more, but the anchors."""
        self.step: messages.AligningStep = "place"
        self.message, self.place, self.fasten = "", None, False
        self.tip: Vector | None = None
        self.expected: float | None = None
        self.residual: float | None = None
        self.anchor: Anchor | None = None
        self._anchor_pose: Pose | None = None  # the anchor's pose
        self._then: messages.AligningStep = "touch"  # after the tip
        self._back: messages.AligningStep = "done"  # once a lost anchor is
        self._former = ""  # id of the anchor that was left
        self._forget()

    def _forget(self) -> None:
        self._poses: list[ControllerPose] = []
        self._dwell = Dwell()
        self._reference: list[np.ndarray] = []
        self._base: list[np.ndarray] = []
        self._cameras: list[np.ndarray] = []

    @property
    def alignment(self) -> Pose | None:
        return inverse(self.place) if self.step == "done" and self.place is not None else None

    @property
    def unfit(self) -> str:
        """Why nothing may be executed though it is aligned, "" where it may."""
        limit = self.settings.limit
        if self.step != "done" or self.expected is None or self.expected <= limit:
            return ""
        reason = f"expected error {_mm(self.expected)}, more than {_mm(limit)}"
        return f"alignment: {reason}: align anew; nothing is executed"

    def progress(self) -> messages.AlignmentProgress:
        words = NEXT[self.step].format(len(self._base) + 1, self.settings.places)
        anchor = self.anchor or (self.stored if self.step == "place" else None)
        id = anchor.id if anchor is not None else ""
        return messages.AlignmentProgress(
            self.step, words, self.message, self.place, self.expected, self.residual, id, self.fasten
        )

    # --- what the user wants

    def by_eye(self, place: Pose) -> str:
        """The base stands at `place` of the reference frame, as the user sees it; why that does not count."""
        if not self.settings.by_eye:
            return "alignment: by eye is for a simulated robot alone; touch it"
        if not _is_pose(place):
            return "alignment: found what is no pose"
        self._placed(place, None, None, "Put there by eye: good enough for a simulated robot alone.")
        return ""

    def touch(self) -> None:
        """Align anew, by touches."""
        self._forget()
        self.step, self._then, self.message, self.fasten = "tip", "touch", "", False
        self.expected = self.residual = None
        self._leave_anchor()

    # --- what is seen

    def hear(
        self, time: float, controller: ControllerPose | None, mark: np.ndarray | None, cameras: np.ndarray | None = None
    ) -> None:
        """At `time`, s, the touching hand, None where it is not tracked; the flange's mark in the base, m (3,), None
        where the robot moves, and the same as cameras see it, None where they do not."""
        if self.step in ("tip", "touch", "check") and controller is None:
            self.message = UNTRACKED
        elif self.message == UNTRACKED:
            self.message = ""
        if self.step == "tip":
            self._turned(controller)
        elif self.step in ("touch", "check"):
            point = None
            if controller is not None and self.tip is not None:
                point = np.array(add(controller.position, rotate(controller.quaternion, self.tip)))
            touched = self._dwell.hear(time, point, mark)
            if touched is not None and mark is not None:
                self._checked(touched, mark) if self.step == "check" else self._touched(touched, mark, cameras)

    def anchored(self, id: str, pose: Pose | None, stored: Anchor | None) -> str:
        """The anchor `id` is at `pose` of the reference frame, None where it is lost; `stored`: its stored form. Why
        that does not count. One that nobody asked for does nothing."""
        if pose is not None and not _is_pose(pose):
            return "anchor: found what is no pose"
        if self.fasten and pose is not None and self.place is not None and id != self._former:
            transform = after(inverse(pose), self.place)
            date = datetime.now(UTC).isoformat(timespec="seconds")
            self.anchor, self.fasten = Anchor(id, transform, self.residual, self.tip, date), False
            self._anchor_pose = pose
            return ""
        if self.anchor is None and self._is_trusted(stored) and self.step == "place" and pose is not None:
            assert stored is not None
            self.anchor, self.tip, self.residual = stored, stored.tip, stored.residual
            self._then = "check"
            self.step = "tip" if self.tip is None else "check"
        if self.anchor is None or self.anchor.id != id:
            return ""
        if pose is None:
            if self.step in ("done", "check"):
                self._back, self.step, self._anchor_pose = self.step, "lost", None
            return ""
        if self._anchor_pose is None or _crept(self._anchor_pose, pose):
            self._anchor_pose, self.place = pose, after(pose, self.anchor.transform)
        self.step = self._back if self.step == "lost" else self.step
        return ""

    def _is_trusted(self, anchor: Anchor | None) -> bool:
        """One that was put there by eye is for a simulated robot too: one touch tells nothing of its turn."""
        return anchor is not None and (anchor.residual is not None or self.settings.by_eye)

    def lose(self) -> None:
        """It is not known whether all is still where it was: an anchor tells, once it is seen again."""
        if self.anchor is None:
            self.reset()
        else:
            self.anchored(self.anchor.id, None, None)

    def _leave_anchor(self) -> None:
        self._former = self.anchor.id if self.anchor is not None else self._former
        self.anchor = self._anchor_pose = None

    # --- steps

    def _turned(self, controller: ControllerPose | None) -> None:
        poses = self._poses
        if controller is None or (poses and angle_between(poses[-1].quaternion, controller.quaternion) < TURNED):
            return
        poses.append(controller)
        if len(poses) < POSES:
            return
        try:
            tip = tip_of(*(np.array([pose[index] for pose in poses]) for index in (0, 1)))
        except InputError as error:
            self.message = f"{str(error)[:1].upper()}{str(error)[1:]}."
            del poses[: POSES // 4]  # it may rest by now
            return
        x, y, z = (float(value) for value in tip.place)
        self.tip, self.step, self.message = (x, y, z), self._then, f"The tip is found, within {_mm(tip.missed)}."
        self._poses = []

    def _touched(self, point: np.ndarray, mark: np.ndarray, cameras: np.ndarray | None) -> None:
        reference, base = self._reference, self._base
        if any(np.linalg.norm(mark - other) < self.settings.apart for other in base):
            self.message = "Move the robot further before the next touch."
            return
        reference.append(point)
        base.append(mark)
        self._cameras.append(np.full(3, np.nan) if cameras is None else cameras)
        self.message = f"Touch {len(base)} is heard."
        if len(base) < self.settings.places:
            return
        touched, marks = np.array(reference), np.array(base)
        wrong = suspect(touched, marks)
        if wrong is not None:
            self.message = f"Touch {wrong.index + 1} is {_mm(wrong.off)} off the others; touch there again."
            del reference[wrong.index], base[wrong.index], self._cameras[wrong.index]
            return
        try:
            pose = fit(touched, marks)
        except InputError as error:
            self.message = f"{str(error)[:1].upper()}{str(error)[1:]}."
            del reference[-1], base[-1], self._cameras[-1]
            return
        level, most = np.degrees(tilt(pose)), self.settings.level_deg
        if level > most:
            self._forget()
            self.message = f"The headset’s vertical is {level:.1f}° off the robot’s, more than {most:g}°: touch again."
            return
        self.expected = expected_error(pose, touched, marks, np.array(self.settings.at))
        missed = float(np.sqrt(np.mean(residuals(pose, touched, marks) ** 2)))
        message = f"Aligned by touches; expected error {_mm(self.expected)} where the arm works."
        message += self._by_cameras(pose, touched)
        self._placed(inverse(pose), missed, self.expected, self.unfit or message)
        self.message = self.unfit or message

    def _by_cameras(self, pose: Pose, touched: np.ndarray) -> str:
        """By how much cameras have the base elsewhere than touches, which are in use; "" where they tell nothing."""
        marks = np.array(self._cameras)
        visible = np.isfinite(marks).all(axis=1)
        at = np.array(self.settings.at)
        try:
            other = fit(touched[visible], marks[visible])
        except InputError:  # too few, or too near to a plane
            return ""
        apart = float(np.linalg.norm(in_base(other, in_base(inverse(pose), at)) - at))
        error = expected_error(other, touched[visible], marks[visible], at)
        return f" By the cameras the base is {_mm(apart)} elsewhere there, expected error {_mm(error)}."

    def _checked(self, point: np.ndarray, mark: np.ndarray) -> None:
        assert self.place is not None
        off, limit = float(np.linalg.norm(in_base(inverse(self.place), point) - mark)), self.settings.limit
        self.expected = off
        if off <= limit:
            self.step, self.message = "done", f"The base is within {_mm(off)} of where it was."
            return
        self.touch()
        self.step = "touch"  # the tip is known
        self.message = f"The touch is {_mm(off)} off, more than {_mm(limit)}: align again."

    def _placed(self, place: Pose, residual: float | None, expected: float | None, message: str) -> None:
        self.place, self.residual, self.expected, self.message = place, residual, expected, message
        self.step = "done"
        self.fasten = not self.unfit  # what is not good enough today is not kept for tomorrow
        self._leave_anchor()


def _mm(metres: float) -> str:
    return f"{1e3 * metres:.1f} mm"


def _is_pose(pose: Pose) -> bool:
    values = np.array([*pose.position, *pose.quaternion])
    return bool(np.isfinite(values).all() and abs(np.linalg.norm(values[3:]) - 1) <= UNIT)


def _crept(before: Pose, now: Pose) -> bool:
    """Whether an anchor has moved by more than it may."""
    turned = angle_between(before.quaternion, now.quaternion)
    return distance(before.position, now.position) > CREEP or turned > CREEP_TURN
