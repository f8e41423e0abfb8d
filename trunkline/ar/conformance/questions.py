"""What the shared vectors ask of the core's parts and of the network, and two targets to begin with."""

import math
from collections.abc import Callable
from dataclasses import asdict

import numpy as np

from trunkline.ar.conformance.answers import Answers, Case
from trunkline.ar.teleop.alignment import Aligned
from trunkline.ar.teleop.messages import Joints, Obstacle
from trunkline.ar.teleop.vectors import (
    DOWN,
    Vector,
    about,
    add,
    distance,
    least_rotation,
    rotate,
    scale,
    subtract,
)
from trunkline.errors import InputError

AROUND = (np.array([0.0, -0.8, -0.4]), np.array([0.8, 0.8, 1.2]))  # m, where mounts are looked for
BELOW = (np.array([-0.3, -0.3, -0.5]), np.array([0.3, 0.3, 0.0]))  # m, where tips are, from the mount
TRIES = 20_000  # pairs of targets
APART = 0.15  # m from mount to tip, so that exchanged controllers are seen as such
FIRST = Aligned(0.0, 0, 0.0)
BENDS = np.radians(np.arange(-300, 301, 10))  # of the tip in its plane, of which the network likes one best
TILTS = [math.radians(angle) for angle in (0.0, 30.0, 60.0, 90.0, 170.0)]  # of gravity; no map knows the last
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
        targets = answers.targets(rigid, tip, DOWN, joints, FIRST._asdict(), [])
        inside = targets["rigid"]["reach"] == targets["tip"]["reach"] == "inside"
        if inside and targets["turned"] is not None and distance(rigid, tip) > APART:
            return rigid, tip
    raise InputError(f"maps: found no mount and tip within reach in {TRIES} tries, expected those of a robot")


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
    cases = [
        {"tip": add(mount, _vector(rng.uniform(*BELOW))), "mount": mount, "pointing": _pointing(rng.uniform(0, 1), rng),
         "joints": joints, "last": FIRST._asdict()}
        for _ in range(MANY)
    ]  # fmt: skip
    angles, last = [*range(0, 360, 8), *range(360, 0, -8)], FIRST._asdict()
    for degrees in angles:
        angle = math.radians(degrees)
        tip = add(mount, (0.2 * math.cos(angle), 0.2 * math.sin(angle), -0.3))
        cases.append({"tip": tip, "mount": mount, "pointing": DOWN, "joints": joints, "last": last})
        last = answers.alignment(**cases[-1])["aligned"]
    return cases


def _rigid(answers: Answers, rng: np.random.Generator) -> list[Case]:
    cases = [{"mount": _vector(rng.uniform(*AROUND)), "pointing": DOWN} for _ in range(MANY)]
    cases += _offered(answers.rigid_reach, "mount", cases)
    return cases + [{"mount": case["mount"], "pointing": _pointing(0.5, rng)} for case in cases[:2]]


def _soft(answers: Answers, rng: np.random.Generator) -> list[Case]:
    """Under gravity from any side, and in the plane of tendon 1, which maps of one tilt know."""
    cases = [
        {"tip": _vector(rng.uniform(*BELOW)), "gravity": _tilted(tilt) if number % 2 else _pointing(tilt, rng)}
        for tilt in TILTS
        for number in range(MANY // 4)
    ]
    return cases + _offered(answers.soft_reach, "tip", cases)


def _offered(ask: Callable[..., Case], name: str, cases: list[Case]) -> list[Case]:
    """The same questions about the points that were offered, so that there are as many within reach."""
    answered = [(case, ask(**case)["offer"]) for case in cases]
    return [case | {name: offer} for case, offer in answered if offer is not None]


def _targets(joints: Joints, rigid: Vector, tip: Vector, rng: np.random.Generator) -> list[Case]:
    """The arm near both targets, turned to several sides with them, some in an obstacle."""
    cases = []
    for number in range(MANY):
        pointing = _pointing(TILTS[number % 4], rng)
        away = rotate(least_rotation(DOWN, pointing), subtract(tip, rigid))
        mount = add(rigid, _vector(rng.normal(scale=0.05, size=3)))
        end = add(add(mount, away), _vector(rng.normal(scale=0.02, size=3)))
        x, y, z = (mount, end, (9.0, 9.0, 9.0))[number % 3]
        obstacle = Obstacle("the table", (x - 0.05, y - 0.05, z - 0.05), (x + 0.05, y + 0.05, z + 0.05))
        cases.append({"rigid": mount, "tip": end, "pointing": pointing, "joints": joints, "last": FIRST._asdict(),
                      "boxes": [asdict(obstacle)]})  # fmt: skip
    return cases


def _poses(answers: Answers, rng: np.random.Generator) -> list[Case]:
    """Tip poses of an arm that only bends, at places that it reaches and that it cannot, as the network is asked."""
    cases = []
    for number in range(MANY):
        tilt = float(rng.uniform(0, 1.2))
        gravity = _pointing(tilt, rng) if answers.inputs > 8 else _tilted(tilt)
        tip = _vector(rng.uniform(*BELOW))
        tip = answers.soft_reach(tip, gravity)["offer"] or tip if number % 4 else scale(tip, 3.0)
        axis = (-tip[1] / math.hypot(tip[0], tip[1]), tip[0] / math.hypot(tip[0], tip[1]), 0.0)
        gravity_inputs = gravity if answers.inputs > 8 else (tilt,)
        candidates = [{"pose": [*gravity_inputs, *tip, *about(axis, float(bend))]} for bend in BENDS]
        cases.append(min(candidates, key=lambda case, tip=tip: distance(answers.network(**case)["tip"], tip)))
    return cases


def _tilted(tilt: float) -> Vector:
    """Gravity where the mount is tilted about +y by `tilt` rad."""
    return math.sin(tilt), 0.0, -math.cos(tilt)


def _pointing(tilt: float, rng: np.random.Generator) -> Vector:
    """A direction `tilt` rad off straight down, any way round."""
    azimuth = float(rng.uniform(-math.pi, math.pi))
    return math.sin(tilt) * math.cos(azimuth), math.sin(tilt) * math.sin(azimuth), -math.cos(tilt)


def _vector(values: np.ndarray) -> Vector:
    x, y, z = (float(value) for value in values)
    return x, y, z
