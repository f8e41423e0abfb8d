"""What the shared vectors ask: sequences that drive the core through every transition and fault, and cases."""

import math
from collections.abc import Callable
from dataclasses import asdict

import numpy as np

from trunkline.errors import InputError
from trunkline.teleop.alignment import Aligned
from trunkline.teleop.core import Teleoperation
from trunkline.teleop.messages import Box, Controller, Input, Joints, Pose, World
from trunkline.teleop.recorder import AIMS, FAULTS, Recorder
from trunkline.teleop.settings import Teleop
from trunkline.teleop.transitions import TRANSITIONS
from trunkline.teleop.vectors import (
    DOWN,
    Vector,
    about,
    add,
    conjugate,
    distance,
    least_rotation,
    rotate,
    scale,
    subtract,
)
from trunkline.unity.answers import Answers, Case

DT = 0.09  # s a step: few of them, and none of the settings' times is a multiple of it, which rounding might decide
ALIGNMENT = Pose((1.3, 0.0, 0.6), (0.5, 0.5, 0.5, 0.5))  # the reference's y is up, its -z the base's -x
AHEAD: Vector = (0.0, 0.0, -1.0)  # of a controller
EXECUTING = ("nan position", "time goes back", "swapped")  # faults, as examples
AROUND = (np.array([0.0, -0.8, -0.4]), np.array([0.8, 0.8, 1.2]))  # m, where mounts are looked for
BELOW = (np.array([-0.3, -0.3, -0.5]), np.array([0.3, 0.3, 0.0]))  # m, where tips are, from the mount
TRIES = 20_000  # pairs of targets
APART = 0.15  # m from mount to tip, so that exchanged controllers are seen as such
FIRST = Aligned(0.0, 0, 0.0)
BENDS = np.radians(np.arange(-300, 301, 10))  # of the tip in its plane, of which the network likes one best
TILTS = np.radians([0.0, 30.0, 60.0, 90.0, 170.0])  # of gravity; no map knows the last
MANY = 24  # cases of a kind, about


def within_reach(answers: Answers, joints: Joints, rng: np.random.Generator) -> tuple[Vector, Vector]:
    """A mount and a tip target that can be reached, m.

    Raises:
        InputError: none are found.
    """
    for _ in range(TRIES):
        rigid = _vector(rng.uniform(*AROUND))
        if answers.rigid_reach(rigid, DOWN)["where"] != "inside":
            continue
        tip = add(rigid, _vector(rng.uniform(*BELOW)))
        found = answers.targets(rigid, tip, DOWN, joints, FIRST._asdict(), [])
        inside = found["rigid"]["reach"] == found["tip"]["reach"] == "inside"
        if inside and found["turned"] is not None and distance(rigid, tip) > APART:
            return rigid, tip
    raise InputError(f"maps: found no mount and tip within reach in {TRIES} tries, expected those of a robot")


def sequences(core: Teleoperation, joints: Joints, rigid: Vector, tip: Vector) -> dict[str, list[tuple[float, Input]]]:
    """By name: what the core is given from its start, with the time of each step, s. Both targets are within reach."""
    given = _first(core, joints, rigid, tip)
    scripts: dict[str, Callable[[Recorder], object]] = {
        f"{mode}, {event}": lambda one, mode=mode, event=event: (one.to(mode), one.cause(event))
        for mode, event in TRANSITIONS
    }
    scripts |= {
        f"{name} while executing": lambda one, name=name: (one.to("execute"), FAULTS[name](one)) for name in EXECUTING
    }
    scripts |= {"faults while aiming": _faults, "reach": _reach, "follow a hand": _follow, "tremble": _tremble}
    found = {}
    for name, script in scripts.items():
        recorder = Recorder(core, given, DT)
        script(recorder)
        found[name] = [(dt, heard) for dt, heard, _ in recorder.steps]
    return found


def _first(core: Teleoperation, joints: Joints, rigid: Vector, tip: Vector) -> Input:
    """Controllers whose rays end at both targets, nothing pressed."""
    back, settings = conjugate(ALIGNMENT.quaternion), core.settings
    held = [
        Controller(
            subtract(rotate(back, subtract(target, ALIGNMENT.position)), scale(AHEAD, settings.rays.start)),
            (1.0, 0.0, 0.0, 0.0),
        )
        for target in (rigid, tip)
    ]
    left, right = held if settings.rigid_hand == "left" else held[::-1]
    return Input(10.0, left, right, ALIGNMENT, joints, World("world"), core.package)


def _hands(settings: Teleop) -> tuple[str, str]:
    """Whose ray holds the rigid target, and whose the tip's."""
    return ("left", "right") if settings.rigid_hand == "left" else ("right", "left")


def _faults(recorder: Recorder) -> None:
    recorder.to("aim")
    for fault in FAULTS.values():
        fault(recorder)
        recorder.recover()


def _reach(recorder: Recorder) -> None:
    """The end effector tilted, so that gravity turns; a ray that grows too long; an offer taken; a solid in the way."""
    rigid, tip = _hands(recorder.core.settings)
    recorder.to("aim")
    recorder.wait(AIMS, left={"grip": True}, right={"grip": True})
    for roll in (20.0, -50.0, 100.0):  # about the ray, which stays where it is
        recorder.wait(0.8, **{rigid: {"primary": True, "quaternion": about((0.0, 0.0, 1.0), math.radians(roll))}})
    recorder.wait(1.0, **{rigid: {"quaternion": (1.0, 0.0, 0.0, 0.0)}})
    recorder.step(**{rigid: {"primary": False}})
    recorder.wait(0.8, **{tip: {"stick": (0.0, 1.0)}})
    recorder.step(**{tip: {"stick": (0.0, 0.0), "trigger": True}})
    recorder.step(**{tip: {"trigger": False, "grip": False}})
    recorder.step(**{tip: {"primary": True}})
    targets = recorder.step(**{tip: {"primary": False}}).targets
    assert targets is not None
    x, y, z = targets.tip.position
    box = Box("the table", (x - 0.1, y - 0.1, z - 0.1), (x + 0.1, y + 0.1, z + 0.1))
    recorder.wait(0.3, world=World("another", (box,)))
    recorder.step(**{tip: {"trigger": True}})
    recorder.step(world=World("world"), **{tip: {"trigger": False}})
    recorder.step(**{tip: {"trigger": True}})


def _follow(recorder: Recorder) -> None:
    """Sideways within reach, and then far out of it."""
    recorder.to("follow")
    x, y, z = recorder.given.left.position
    for number in range(10):
        recorder.step(left={"position": (x + 0.002 * number, y, z)})
    recorder.wait(0.8, left={"position": (x, y, z - 2.0)})


def _tremble(recorder: Recorder) -> None:
    rng = np.random.default_rng(0)
    recorder.to("aim")
    left, right = recorder.given.left.position, recorder.given.right.position
    for number in range(MANY):
        turn = about((0.0, 1.0, 0.0), float(rng.normal(scale=0.05)))
        recorder.step(
            left={"position": add(left, _vector(rng.normal(scale=0.01, size=3))), "quaternion": turn, "grip": True},
            right={
                "position": add(right, _vector(rng.normal(scale=0.01, size=3))), "quaternion": turn,
                "stick": (0.0, float(rng.uniform(-1, 1))), "grip": number % 8 > 2, "trigger": number % 6 == 5,
            },
        )  # fmt: skip


def cases(answers: Answers, joints: Joints, rigid: Vector, tip: Vector, rng: np.random.Generator) -> dict[str, list]:
    """Questions by the name of what answers them in `Answers`."""
    return {
        "alignment": _alignments(answers, joints, rigid, rng),
        "rigid_reach": _rigid(answers, rng),
        "soft_reach": _soft(answers, rng),
        "targets": _targets(joints, rigid, tip, rng),
        "network": _poses(answers, rng),
    }


def _alignments(answers: Answers, joints: Joints, mount: Vector, rng: np.random.Generator) -> list[Case]:
    """At random, and around the arm and back in steps of 8°, each with the answer before: half-planes change late."""
    found = [
        {"tip": add(mount, _vector(rng.uniform(*BELOW))), "mount": mount, "pointing": _pointing(rng.uniform(0, 1), rng),
         "joints": joints, "last": FIRST._asdict()}
        for _ in range(MANY)
    ]  # fmt: skip
    way, last = [*range(0, 360, 8), *range(360, 0, -8)], FIRST._asdict()
    for degrees in way:
        angle = math.radians(degrees)
        tip = add(mount, (0.2 * math.cos(angle), 0.2 * math.sin(angle), -0.3))
        found.append({"tip": tip, "mount": mount, "pointing": DOWN, "joints": joints, "last": last})
        last = answers.alignment(**found[-1])["aligned"]
    return found


def _rigid(answers: Answers, rng: np.random.Generator) -> list[Case]:
    found = [{"mount": _vector(rng.uniform(*AROUND)), "pointing": DOWN} for _ in range(MANY)]
    found += _offered(answers.rigid_reach, "mount", found)
    return found + [{"mount": case["mount"], "pointing": _pointing(0.5, rng)} for case in found[:2]]


def _soft(answers: Answers, rng: np.random.Generator) -> list[Case]:
    found = [
        {"tip": _vector(rng.uniform(*BELOW)), "gravity": _pointing(tilt, rng)}
        for tilt in TILTS
        for _ in range(MANY // 4)
    ]
    return found + _offered(answers.soft_reach, "tip", found)


def _offered(ask: Callable[..., Case], name: str, found: list[Case]) -> list[Case]:
    """The same questions about the points that were offered, so that there are as many within reach."""
    answered = [(case, ask(**case)["offer"]) for case in found]
    return [case | {name: offer} for case, offer in answered if offer is not None]


def _targets(joints: Joints, rigid: Vector, tip: Vector, rng: np.random.Generator) -> list[Case]:
    """The arm near both targets, turned to several sides with them, some in a solid."""
    found = []
    for number in range(MANY):
        pointing = _pointing(float(TILTS[number % 4]), rng)
        away = rotate(least_rotation(DOWN, pointing), subtract(tip, rigid))
        mount = add(rigid, _vector(rng.normal(scale=0.05, size=3)))
        end = add(add(mount, away), _vector(rng.normal(scale=0.02, size=3)))
        x, y, z = (mount, end, (9.0, 9.0, 9.0))[number % 3]
        box = Box("the table", (x - 0.05, y - 0.05, z - 0.05), (x + 0.05, y + 0.05, z + 0.05))
        found.append({"rigid": mount, "tip": end, "pointing": pointing, "joints": joints, "last": FIRST._asdict(),
                      "boxes": [asdict(box)]})  # fmt: skip
    return found


def _poses(answers: Answers, rng: np.random.Generator) -> list[Case]:
    """Tip poses of an arm that only bends, at places that it reaches and that it cannot, as the network is asked."""
    found = []
    for number in range(MANY):
        tilt = float(rng.uniform(0, 1.2))
        gravity = _pointing(tilt, rng) if answers.inputs > 8 else (math.sin(tilt), 0.0, -math.cos(tilt))
        tip = _vector(rng.uniform(*BELOW))
        tip = answers.soft_reach(tip, gravity)["offer"] or tip if number % 4 else scale(tip, 3.0)
        axis = (-tip[1] / math.hypot(tip[0], tip[1]), tip[0] / math.hypot(tip[0], tip[1]), 0.0)
        told = gravity if answers.inputs > 8 else (tilt,)
        asked = [{"pose": [*told, *tip, *about(axis, float(bend))]} for bend in BENDS]
        found.append(min(asked, key=lambda case, tip=tip: distance(answers.network(**case)["tip"], tip)))
    return found


def _pointing(tilt: float, rng: np.random.Generator) -> Vector:
    """A direction `tilt` rad off straight down, any way round."""
    azimuth = float(rng.uniform(-math.pi, math.pi))
    return math.sin(tilt) * math.cos(azimuth), math.sin(tilt) * math.sin(azimuth), -math.cos(tilt)


def _vector(values: np.ndarray) -> Vector:
    x, y, z = (float(value) for value in values)
    return x, y, z
