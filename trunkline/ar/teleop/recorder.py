"""An operator at the core, recorded: what leads from mode to mode, and what may go wrong.

The shared vectors of the package are made with it (`trunkline/ar/conformance/vectors.py`), and the core's own tests.
"""

import math
from collections.abc import Callable
from dataclasses import replace

from trunkline.ar.teleop.core import Teleoperation
from trunkline.ar.teleop.messages import ExecutorReport, Input, Intent, Mode, PlanReport, Pose
from trunkline.ar.teleop.transitions import Event

PLAN = "d" * 64  # digest of the plan that is always found
NAN, INFINITY = float("nan"), float("inf")
AIMS = 0.3  # s for which both grips are held until the targets stand still
LONGEST = 3.0  # s in which a mode must come


class Recorder:
    """Drives a core step by step, `dt` s each, from its start with `message`; each call of `step` may change what the
    operator does and what is reported. What the core heard and wanted is in `steps`, with the time given to it, s."""

    def __init__(self, core: Teleoperation, message: Input, dt: float) -> None:
        self.core, self.state, self.dt = core, core.start(), dt
        self.message = self._begin = message
        self._stamp = message.stamp
        self.steps: list[tuple[float, Input, Intent]] = []

    @property
    def inputs(self) -> list[Input]:
        return [message for _, message, _ in self.steps]

    @property
    def intents(self) -> list[Intent]:
        return [intent for _, _, intent in self.steps]

    def step(self, seconds: float | None = None, dt: float | None = None, left=None, right=None, **changes) -> Intent:
        """One step: the stamp goes on by `seconds`; `left` and `right` are changes of the controllers."""
        message = replace(self.message, stamp=self.message.stamp + (self.dt if seconds is None else seconds), **changes)
        self.message = replace(
            message, left=replace(message.left, **(left or {})), right=replace(message.right, **(right or {}))
        )
        self._stamp = message.stamp if math.isfinite(message.stamp) else self._stamp
        step_dt = self.dt if dt is None else dt
        self.state, intent = self.core.step(self.state, self.message, step_dt)
        self.steps.append((step_dt, self.message, intent))
        return intent

    def wait(self, duration: float, **changes) -> Intent:
        """Steps for so long, s; the last intent."""
        for _ in range(max(round(duration / self.dt), 1)):
            intent = self.step(**changes)
        return intent

    def until(self, mode: Mode, **changes) -> Intent:
        """Steps until `mode` comes; its first intent.

        Raises:
            ValueError: it does not.
        """
        for _ in range(round(LONGEST / self.dt)):
            if (intent := self.step(**changes)).mode == mode:
                return intent
        raise ValueError(f"found {intent.mode} ({intent.notice}), expected {mode} within {LONGEST:g} s")

    def to(self, mode: Mode) -> Intent:
        """Do what brings the core from its start, or from aiming with all let go, to `mode`; the last intent."""
        intent = self.wait(0.5)
        if mode == "hold":
            return self.step(left={"tracked": False}, seconds=0.2)
        if mode == "aim":
            return intent
        if mode == "stopped":
            self.step(left={"secondary": True})
            return self.step(left={"secondary": False})
        self.wait(AIMS, left={"grip": True}, right={"grip": True})
        if mode == "follow":
            self.step(left={"stick_pressed": True})
            return self.wait(0.7, left={"stick_pressed": False})
        intent = self.step(right={"trigger": True})
        if mode == "plan":
            return intent
        intent = self.step(plan=self._answer(), right={"trigger": False})
        if mode == "preview":
            return intent
        intent = self.step(shown=PLAN)
        if mode == "ready":
            return intent
        self.wait(0.1)
        intent = self.step(right={"trigger": True})
        if mode == "delay":
            return intent
        self.until("execute", right={"trigger": False})
        return self.wait(0.1, executor=ExecutorReport("running", PLAN))

    def recover(self) -> Intent:
        """Put all right that went wrong, let everything go, and aim again; its first intent."""
        self.message = replace(self._begin, stamp=self._stamp)
        self.step()
        if self.state.mode == "stopped":
            self.step(right={"primary": True})
        return self.until("aim", right={"primary": False})

    def cause(self, event: Event) -> Intent:
        """Make `event` happen, whatever the mode; the intent once it has."""
        message, mode = self.message, self.state.mode
        if event == "stop":
            return self.step(left={"secondary": True})
        if event == "fault":
            return self.step(executor=ExecutorReport("fault", PLAN, "joint 3 reflex"))
        if event == "lost":
            return self.step(alignment=None)
        if event == "void":
            return self.step(world=replace(message.world, digest="another"))
        if event == "released":
            return self.step(left={"grip": False}, right={"grip": False})
        if event == "refused":
            return self.step(plan=PlanReport(self.state.serial, refused="joint limit"))
        if event == "settled":
            return self.wait(
                0.5 if mode == "hold" else 0.0,
                left={"tracked": True, "grip": False},
                right={"grip": False, "trigger": False},
            )
        if event == "reset":
            return self.step(right={"primary": True})
        if event in ("ask", "confirm") and mode == "aim":
            self.wait(0.2, left={"grip": True}, right={"grip": True})
        if event in ("ask", "confirm"):
            self.step(right={"trigger": False})
            return self.step(right={"trigger": True, "grip": True})
        if event == "planned":
            return self.step(plan=self._answer())
        if event == "shown":
            return self.step(shown=PLAN)
        if event == "elapsed":
            return self.wait(0.6)
        if event == "done":
            return self.step(executor=ExecutorReport("done", PLAN))
        assert event in ("follow", "unfollow")
        if mode == "aim":
            self.wait(0.2, left={"grip": True}, right={"grip": True})
        self.step(left={"stick_pressed": False})
        return self.step(left={"stick_pressed": True})

    def _answer(self) -> PlanReport:
        return PlanReport(self.state.serial, PLAN, "", self.message.package, self.message.world.digest)


def _swap(recorder: Recorder) -> Intent:
    left, right = recorder.message.left, recorder.message.right
    return recorder.step(left={"position": right.position}, right={"position": left.position})


# What goes wrong with an input, so that the robot must hold.
FAULTS: dict[str, Callable[[Recorder], Intent]] = {
    "nan position": lambda r: r.wait(0.2, left={"position": (NAN, 0.0, 0.0)}),
    "infinite quaternion": lambda r: r.wait(0.2, right={"quaternion": (1.0, 0.0, 0.0, INFINITY)}),
    "nan stick": lambda r: r.wait(0.2, right={"stick": (0.0, NAN)}),
    "quaternion of length 2": lambda r: r.wait(0.2, right={"quaternion": (2.0, 0.0, 0.0, 0.0)}),
    "controller gone": lambda r: r.wait(0.2, right={"tracked": False}),
    "time goes back": lambda r: r.step(seconds=-0.5),
    "nan stamp": lambda r: r.step(seconds=NAN),
    "gap": lambda r: r.step(seconds=0.4),
    "silent": lambda r: r.wait(0.3, seconds=0.0),
    "no step": lambda r: r.step(dt=0.0),
    "nan step": lambda r: r.step(dt=NAN),
    "swapped": _swap,
    "other package": lambda r: r.step(package="b" * 64),
    "no package": lambda r: r.step(package=""),
    "no alignment": lambda r: r.step(alignment=None),
    "alignment is no pose": lambda r: r.step(alignment=Pose((0.0, 0.0, 0.0), (0.0, 0.0, 0.0, 0.0))),
    "nan joints": lambda r: r.step(joints=(NAN,) * 7),
}
