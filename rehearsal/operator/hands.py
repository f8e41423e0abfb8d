"""One hand that holds a controller: its ray is moved to where the operator aims, trembles, and misses a little."""

from dataclasses import dataclass
from typing import Annotated

import numpy as np
from pydantic import Field
from scipy.spatial.transform import Rotation

from trunkline.ar.teleop.messages import Controller, Pose
from trunkline.ar.teleop.minimum_jerk import minimum_jerk
from trunkline.frames import STANDARD_GRAVITY, rotation_from_wxyz, wxyz_from_rotation

AXES = 3  # of the tremor: two turns of the ray and one about it
STICK_RAMP = 0.1  # m of missing length below which the stick is let back
STICK_STILL = 1e-3  # m of missing length that nobody corrects
Positive = Annotated[float, Field(gt=0, le=100)]
Zero = Annotated[float, Field(ge=0, le=100)]


@dataclass
class HumanOperator:
    """What the operator's hands and eyes are like: see conf/rehearse/operator/typical.yaml."""

    tremor_g: Zero
    tremor_hz: Annotated[list[Positive], Field(min_length=2, max_length=2)]
    wrist: Positive
    widths: Positive
    disparity_deg: Zero
    pupils: Positive
    reaction: Positive
    reaction_spread: Zero
    movement: Positive
    unnoticed_deg: Zero
    correction: Positive
    forecast: Annotated[float, Field(ge=0, le=1)]
    jerk_deg: Zero
    patience: Annotated[int, Field(ge=1, le=100)]


def as_hands_move(share: float) -> float:
    """From 0 to 1, before and after which it stays."""
    return minimum_jerk(min(max(share, 0.0), 1.0))


class RayHand:
    """A hand at `origin` (3,), m, of the reference frame. What it aims at is in the base frame, m."""

    def __init__(
        self, origin: np.ndarray, alignment: Pose, person: HumanOperator, dead_zone: float, rng: np.random.Generator
    ) -> None:
        self.origin, self.person, self.rng, self.dead_zone = origin, person, rng, dead_zone
        self.turn = rotation_from_wxyz(np.array(alignment.quaternion))
        self.shift = np.array(alignment.position)
        self.rates = rng.uniform(person.tremor_hz[0], person.tremor_hz[1], AXES) * 2 * np.pi
        self.phases = rng.uniform(0, 2 * np.pi, AXES)
        self.pressed: set[str] = set()
        self.start = self.goal = self.turn.apply(origin + [0.0, 0.0, -0.6]) + self.shift
        self.begun, self.lasting, self.jerked = -np.inf, person.movement, -np.inf
        self.error, self.last_error = np.zeros(3), np.zeros(3)  # of this aim, and of that before

    def aim(self, place: np.ndarray, width: float, now: float) -> None:
        """Begin to move the ray's end to `place` (3,); what is aimed at is `width` m wide."""
        self.start, self.last_error = self.wished(now), self.missed(now)
        self.goal = np.array(place, dtype=float)
        self.error = self._missing(width / self.person.widths)
        self.begun, self.lasting = now, self.person.movement

    def follow(self, place: np.ndarray, now: float) -> None:
        """Keep the ray's end at a moving `place` (3,): one correction after the other, each with an error of its own,
        spread across the ray as errors are that lie evenly within `unnoticed_deg` to either side."""
        missed = self.missed(now)
        self.start = self.goal = np.array(place, dtype=float)
        if now >= self.begun + self.lasting:
            across = np.radians(self.person.unnoticed_deg) * self._distance() / np.sqrt(3)
            self.last_error, self.error = missed, self._missing(across)
            self.begun, self.lasting = now, self.person.correction

    def _missing(self, across: float) -> np.ndarray:
        """An error drawn across the ray, twice, of this standard deviation, and along it, (3,), m."""
        return np.array([across, across, self.depth_spread(self._distance())]) * self.rng.normal(size=3)

    def _distance(self) -> float:
        """m, from the hand to what it aims at."""
        return float(np.linalg.norm(self._reference(self.goal) - self.origin))

    def depth_spread(self, distance: float) -> float:
        """Δd = d² η / b, m, of a disparity η seen by eyes b apart."""
        return float(distance**2 * np.radians(self.person.disparity_deg) / self.person.pupils)

    def wished(self, now: float) -> np.ndarray:
        """Where the ray's end shall be now, (3,), m, without error and tremor."""
        return self.start + as_hands_move((now - self.begun) / self.lasting) * (self.goal - self.start)

    def missed(self, now: float) -> np.ndarray:
        """By how much the aim is off now, across the ray, twice, and along it, (3,), m."""
        share = as_hands_move((now - self.begun) / self.lasting)
        return self.last_error + share * (self.error - self.last_error)

    def press(self, name: str, now: float) -> None:
        self.pressed.add(name)
        if name == "trigger":
            self.jerked = now

    def let_go(self, name: str) -> None:
        self.pressed.discard(name)

    def controller(self, now: float, end: tuple[float, float, float] | None) -> Controller:
        """What is tracked; `end` is the end of the ray as it is seen, base frame, m."""
        place = self._reference(self.wished(now))
        away = place - self.origin
        frame = _looking(away / np.linalg.norm(away))
        aimed = place + frame.apply(self.missed(now))
        away = aimed - self.origin
        length = float(np.linalg.norm(away))
        lever = self.person.tremor_g * STANDARD_GRAVITY / self.person.wrist
        tremor = lever / self.rates**2 * np.sin(self.rates * now + self.phases)
        tremor[0] += np.radians(self.person.jerk_deg) * np.exp(-(((now - self.jerked) / 0.05) ** 2))
        ray = _looking(away / length) * Rotation.from_rotvec(tremor)
        missing = 0.0 if end is None else length - float(np.linalg.norm(self._reference(np.array(end)) - self.origin))
        stick = 0.0
        if abs(missing) > STICK_STILL:
            stick = np.sign(missing) * (self.dead_zone + (1 - self.dead_zone) * min(abs(missing) / STICK_RAMP, 1.0))
        w, x, y, z = (float(value) for value in wxyz_from_rotation(ray))
        ox, oy, oz = (float(value) for value in self.origin)
        buttons = {name: True for name in sorted(self.pressed)}
        return Controller((ox, oy, oz), (w, x, y, z), stick=(0.0, float(stick)), **buttons)

    def _reference(self, place: np.ndarray) -> np.ndarray:
        return self.turn.inv().apply(place - self.shift)


def _looking(away: np.ndarray) -> Rotation:
    """Controller frame whose ray, -z, points along the unit vector `away`; y as far up as it can be."""
    z = -away
    x = np.cross([0.0, 1.0, 0.0], z)
    x /= np.linalg.norm(x)
    return Rotation.from_matrix(np.column_stack([x, np.cross(z, x), z]))
