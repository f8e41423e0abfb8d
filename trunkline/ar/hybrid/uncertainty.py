"""What is not known of a grasp: the arm's parameters, the friction of what it holds, and where that stands.

Parameters are drawn from the twin's posterior. Friction is log-normal about what is believed, the object's place is
normal.
"""

from dataclasses import dataclass, field
from typing import Annotated

import mujoco
import numpy as np
from pydantic import Field

from trunkline.errors import InputError
from trunkline.identification.parameters.parameters import parameter_named
from trunkline.twin.posterior import Posterior

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
    """posterior: of the arm's parameters; nothing of them is open where none is given."""

    contact: Contact = field(default_factory=Contact)
    posterior: Posterior = field(default_factory=lambda: Posterior.from_tables({}))


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
    rng = np.random.default_rng(seed)
    drawn = uncertainty.posterior.sample(count, rng)
    values = {name: column for name, column in drawn.items() if name not in OF_THE_MARKER}
    for name in values:
        if not parameter_named(name).belongs_to(arm):
            raise InputError(f"{name}: found an arm without its part, expected one of which it is a parameter")
    contact = uncertainty.contact
    friction = np.exp(contact.friction * rng.normal(size=count))
    offsets = np.array(contact.place) * rng.normal(size=(count, 3))
    return PosteriorSamples(values, friction, offsets, contact.turn * rng.normal(size=count))


def nominal_sample() -> PosteriorSamples:
    """One future: all as believed."""
    return PosteriorSamples({}, np.ones(1), np.zeros((1, 3)), np.zeros(1))
