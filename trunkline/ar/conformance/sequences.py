"""Sequences of inputs for the shared vectors: they drive the core through every transition and fault."""

import math
from collections.abc import Callable
from typing import Any

import numpy as np

from trunkline.ar.teleop.core import Teleoperation
from trunkline.ar.teleop.messages import Controller, Input, Joints, Obstacle, Pose, World
from trunkline.ar.teleop.recorder import AIMS, FAULTS, Recorder
from trunkline.ar.teleop.settings import Teleop
from trunkline.ar.teleop.transitions import TRANSITIONS
from trunkline.ar.teleop.vectors import Vector, about, add, conjugate, rotate, scale, subtract

DT = 0.09  # s a step: few of them, and none of the settings' times is a multiple of it, which rounding might decide
ALIGNMENT = Pose((1.3, 0.0, 0.6), (0.5, 0.5, 0.5, 0.5))  # the reference's y is up, its -z the base's -x
AHEAD: Vector = (0.0, 0.0, -1.0)  # of a controller
EXECUTING = ("nan position", "time goes back", "swapped")  # faults, as examples
WATCHING = ("controller gone", "silent")  # likewise, of a user who watches a preview
TREMBLING = 24  # steps


def sequences(core: Teleoperation, joints: Joints, rigid: Vector, tip: Vector) -> dict[str, list[tuple[float, Input]]]:
    """By name: what the core is given from its start, with the time of each step, s. Both targets are within reach."""
    first_input = _first(core, joints, rigid, tip)
    scripts: dict[str, Callable[[Recorder], object]] = {
        f"{mode}, {event}": lambda recorder, mode=mode, event=event: (recorder.to(mode), recorder.cause(event))
        for mode, event in TRANSITIONS
    }
    scripts |= {
        f"{name} while executing": lambda recorder, name=name: (recorder.to("execute"), FAULTS[name](recorder))
        for name in EXECUTING
    }
    scripts |= {
        f"{name} while watching": lambda recorder, name=name: _unheard(recorder, FAULTS[name]) for name in WATCHING
    }
    scripts |= {"faults while aiming": _faults, "reach": _reach, "follow a hand": _follow, "tremble": _tremble}
    recorded = {}
    for name, script in scripts.items():
        recorder = Recorder(core, first_input, DT)
        script(recorder)
        recorded[name] = [(dt, message) for dt, message, _ in recorder.steps]
    return recorded


def _first(core: Teleoperation, joints: Joints, rigid: Vector, tip: Vector) -> Input:
    """Controllers whose rays end at both targets, nothing pressed."""
    back, settings = conjugate(ALIGNMENT.quaternion), core.settings
    controllers = [
        Controller(
            subtract(rotate(back, subtract(target, ALIGNMENT.position)), scale(AHEAD, settings.rays.start)),
            (1.0, 0.0, 0.0, 0.0),
        )
        for target in (rigid, tip)
    ]
    left, right = controllers if settings.rigid_hand == "left" else controllers[::-1]
    return Input(10.0, left, right, ALIGNMENT, joints, World("world"), core.package)


def _hands(settings: Teleop) -> tuple[str, str]:
    """Whose ray holds the rigid target, and whose the tip's."""
    return ("left", "right") if settings.rigid_hand == "left" else ("right", "left")


def _of(hand: str, **changes: object) -> dict[str, Any]:
    """Changes of one hand's controller, for `Recorder.step`."""
    return {hand: changes}


def _faults(recorder: Recorder) -> None:
    recorder.to("aim")
    for fault in FAULTS.values():
        fault(recorder)
        recorder.recover()


def _unheard(recorder: Recorder, fault: Callable[[Recorder], object]) -> None:
    """The plan is kept meanwhile, and confirmed by a user who is heard again."""
    recorder.to("preview")
    fault(recorder)
    recorder.cause("shown")
    recorder.cause("confirm")
    recorder.step(left={"tracked": True}, right={"tracked": True})
    recorder.cause("confirm")


def _reach(recorder: Recorder) -> None:
    """The end effector tilted, so that gravity turns; a ray too long; an offer taken; an obstacle in the way."""
    rigid, tip = _hands(recorder.core.settings)
    recorder.to("aim")
    recorder.wait(AIMS, left={"grip": True}, right={"grip": True})
    for roll in (20.0, -50.0, 100.0):  # about the ray, which stays where it is
        recorder.wait(0.8, **_of(rigid, primary=True, quaternion=about((0.0, 0.0, 1.0), math.radians(roll))))
    recorder.wait(1.0, **_of(rigid, quaternion=(1.0, 0.0, 0.0, 0.0)))
    recorder.step(**_of(rigid, primary=False))
    recorder.wait(0.8, **_of(tip, stick=(0.0, 1.0)))
    recorder.step(**_of(tip, stick=(0.0, 0.0), trigger=True))
    recorder.step(**_of(tip, trigger=False, grip=False))
    recorder.step(**_of(tip, primary=True))
    targets = recorder.step(**_of(tip, primary=False)).targets
    assert targets is not None
    x, y, z = targets.tip.position
    obstacle = Obstacle("the table", (x - 0.1, y - 0.1, z - 0.1), (x + 0.1, y + 0.1, z + 0.1))
    recorder.wait(0.3, world=World("another", (obstacle,)))
    recorder.step(**_of(tip, trigger=True))
    recorder.step(world=World("world"), **_of(tip, trigger=False))
    recorder.step(**_of(tip, trigger=True))


def _follow(recorder: Recorder) -> None:
    """Sideways within reach, and then far out of it."""
    recorder.to("follow")
    x, y, z = recorder.message.left.position
    for number in range(10):
        recorder.step(left={"position": (x + 0.002 * number, y, z)})
    recorder.wait(0.8, left={"position": (x, y, z - 2.0)})


def _tremble(recorder: Recorder) -> None:
    rng = np.random.default_rng(0)
    recorder.to("aim")
    left, right = recorder.message.left.position, recorder.message.right.position
    for number in range(TREMBLING):
        turn = about((0.0, 1.0, 0.0), float(rng.normal(scale=0.05)))
        recorder.step(
            left={"position": add(left, _noise(rng)), "quaternion": turn, "grip": True},
            right={
                "position": add(right, _noise(rng)), "quaternion": turn,
                "stick": (0.0, float(rng.uniform(-1, 1))), "grip": number % 8 > 2, "trigger": number % 6 == 5,
            },
        )  # fmt: skip


def _noise(rng: np.random.Generator) -> Vector:
    x, y, z = rng.normal(scale=0.01, size=3).tolist()
    return x, y, z
