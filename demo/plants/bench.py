"""What a plant on the bench does: commands and pulls of a hand go in, what cameras and motors could see comes out."""

from dataclasses import dataclass
from typing import Annotated, Protocol

import numpy as np
from pydantic import Field

COMMAND_RATE = 2000.0  # Hz, of commands as sent and of a hand's pull
SAMPLE_RATE = 500.0  # Hz, of what is seen
LOOSE = 0.3  # m of cable paid out, far more than any bend takes up

Share = Annotated[float, Field(gt=0, lt=1)]


@dataclass
class PrintedArm:
    """The truth that every arm on the bench has settings of.

    modulus: Pa, of what lasts. density: kg/m³. core_ratio: core diameter over width. mass_factor: of every body's mass.
    stiffness_scatter: relative, uniform, from joint to joint along the arm. hardening: relative growth of the stiffness
    per rad² of bend of a unit. hole_ratio: distance of the cables from the axis over the unit's radius.
    cable_stiffness: N/m. cable_damping: N s/m.
    """

    modulus: Annotated[float, Field(ge=1e3, le=1e12)]
    density: Annotated[float, Field(ge=1, le=30000)]
    core_ratio: Share
    mass_factor: Annotated[float, Field(gt=0, le=100)]
    stiffness_scatter: Annotated[float, Field(ge=0, lt=1)]
    hardening: Annotated[float, Field(ge=0, le=1e6)]
    hole_ratio: Annotated[float, Field(gt=0, le=1)]
    cable_stiffness: Annotated[float, Field(gt=0, le=1e7)]
    cable_damping: Annotated[float, Field(ge=0, le=1e6)]


@dataclass
class Bench:
    """n trials of one length, all at once, each from rest.

    gravity: in the frame of the base marker, m/s². Shape (n, 3).
    commands: m of pull, as sent at COMMAND_RATE. Shape (n, T, K).
    pulls: of a hand at each cable, N. Shape (n, T, K).
    loads: at the tip, kg. Shape (n,).
    steady, steady_factor: a hand steadies the arm for so many s, all damping is so many times as large.
    since: s, from when on the trials are seen.
    hanging: whether the mount is tilted beforehand, so that the rest is under `gravity`; else under an upright mount.
    """

    gravity: np.ndarray
    commands: np.ndarray
    pulls: np.ndarray
    loads: np.ndarray
    steady: float = 0.0
    steady_factor: float = 1.0
    since: float = 0.0
    hanging: bool = False

    @property
    def stride(self) -> int:
        """Commands a sample."""
        return round(COMMAND_RATE / SAMPLE_RATE)

    @property
    def skipped(self) -> int:
        """Samples before `since`."""
        return round(self.since * SAMPLE_RATE)


@dataclass
class PlantMotion:
    """F samples at SAMPLE_RATE, from `since` on; the base marker's frame.

    positions (n, F, S, 3): m, of the tracked units' centres. rotations (n, F, S, 3, 3): of their axes.
    wound (n, F, K): m of pull, by the motors' encoders.
    """

    positions: np.ndarray
    rotations: np.ndarray
    wound: np.ndarray


class Plant(Protocol):
    """An arm with its motors and cables."""

    tendons: int

    def run(self, label: str, bench: Bench, tracked: list[int]) -> PlantMotion:
        """Do the trials and look at the units of these indices. `label` says what is done, for a bar of progress."""
        ...

    def answers(self) -> dict:
        """What is true of it, see `demo.answers`."""
        ...
