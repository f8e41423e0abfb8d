"""What is not known of a grasp: the arm's parameters, the friction of what it holds, and where that stands.

A parameter's 95 % interval is that of identification, [l, h]; on its own axis, z, which is the logarithm where it must
be positive, the parameter is taken as normal with

    σ = (z(h) - z(l)) / (2 · 1.96)

about the value that the model has, together with others of its stage as they correlate. So what must be positive is
log-normal. Friction is log-normal about what is believed, the object's place normal.
"""

from dataclasses import dataclass, field
from typing import Annotated

import mujoco
import numpy as np
from pydantic import Field
from scipy.stats import norm

from trunkline.errors import InputError
from trunkline.identification.parameters.parameters import NAMES, parameter_named

Z95 = float(norm.ppf(0.975))
# In the arm's own file these turn the body `base`, and a composed model has none of it
# (`trunkline/ar/hybrid/compose.py`).
OF_THE_MARKER = ("mount_tilt_x", "mount_tilt_y", "mount_twist")
Spread = Annotated[float, Field(ge=0, le=1)]


@dataclass(frozen=True)
class Contact:
    """How sure contacts are.

    Attributes:
        friction: standard deviation of the logarithm of the friction coefficient.
        place: standard deviations of the object's centre along x, y and z of the world, m. Shape (3,).
        turn: standard deviation of its turn about the vertical, rad.
    """

    friction: Spread = 0.2
    place: tuple[Spread, Spread, Spread] = (0.005, 0.005, 0.0)
    turn: Spread = 0.0


@dataclass(frozen=True)
class GraspUncertainty:
    """names: of P parameters. deviation: of each on its own axis. Shape (P,). correlation: shape (P, P)."""

    names: tuple[str, ...] = ()
    deviation: np.ndarray = field(default_factory=lambda: np.zeros(0))
    correlation: np.ndarray = field(default_factory=lambda: np.zeros((0, 0)))
    contact: Contact = field(default_factory=Contact)

    def scaled(self, factor: float) -> "GraspUncertainty":
        """The same with all deviations of the parameters times `factor`."""
        return GraspUncertainty(self.names, factor * self.deviation, self.correlation, self.contact)


@dataclass(frozen=True)
class PosteriorSamples:
    """B futures: `values` of the parameters by name (B,), `friction` factors (B,), `offsets` of the object's centre
    (B, 3), m, and its `turns` about the vertical (B,), rad."""

    values: dict[str, np.ndarray]
    friction: np.ndarray
    offsets: np.ndarray
    turns: np.ndarray

    def __len__(self) -> int:
        return len(self.friction)


def sample(uncertainty: GraspUncertainty, arm: mujoco.MjModel, count: int, seed: int) -> PosteriorSamples:
    """`count` futures of the identified `arm`; the same for the same seed.

    Raises:
        InputError: naming a parameter that the arm has not.
    """
    for name in uncertainty.names:
        if not parameter_named(name).belongs_to(arm):
            raise InputError(f"{name}: found an arm without its part, expected one of which it is a parameter")
    rng = np.random.default_rng(seed)
    values, vectors = np.linalg.eigh(uncertainty.correlation)
    off = rng.normal(size=(count, len(values))) * np.sqrt(np.maximum(values, 0)) @ vectors.T * uncertainty.deviation
    drawn = {}
    for name, column in zip(uncertainty.names, off.T, strict=True):
        parameter = parameter_named(name)
        drawn[name] = np.asarray(parameter.value(parameter.coordinate(parameter.read(arm)) + column))
    contact = uncertainty.contact
    friction = np.exp(contact.friction * rng.normal(size=count))
    offsets = np.array(contact.place) * rng.normal(size=(count, 3))
    return PosteriorSamples(drawn, friction, offsets, contact.turn * rng.normal(size=count))


def nominal_sample() -> PosteriorSamples:
    """One future: all as believed."""
    return PosteriorSamples({}, np.ones(1), np.zeros((1, 3)), np.zeros(1))


def uncertainty_of(stages: list[dict], contact: Contact | None = None) -> GraspUncertainty:
    """What `parameters.json` of stages says, the latest last: it counts for what several have identified.

    Raises:
        InputError: naming a parameter that is unknown or whose interval is none.
    """
    identified: dict[str, tuple[int, float]] = {}
    for number, stage in enumerate(stages):
        for name, row in stage["parameters"].items():
            if name in OF_THE_MARKER:
                continue
            if name not in NAMES:
                raise InputError(f"parameters.{name}: found no such parameter, expected one of {', '.join(NAMES)}")
            identified[name] = (number, _deviation(name, row["interval_95_given_model"]))
    names = tuple(identified)
    correlation = np.eye(len(names))
    for i, name in enumerate(names):
        for j, other in enumerate(names[:i]):
            if identified[name][0] == identified[other][0]:
                correlation[i, j] = correlation[j, i] = stages[identified[name][0]]["correlation"][name][other]
    deviation = np.array([identified[name][1] for name in names])
    return GraspUncertainty(names, deviation, correlation, contact or Contact())


def _deviation(name: str, interval: list[float | None]) -> float:
    low, high = interval
    if low is None or high is None or not low <= high or (low <= 0 and not parameter_named(name).signed):
        raise InputError(f"parameters.{name}.interval_95_given_model: found {interval}, expected two numbers that rise")
    ends = parameter_named(name).coordinate(np.array([low, high]))
    return float(ends[1] - ends[0]) / (2 * Z95)
