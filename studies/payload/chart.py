"""The payload chart: the heaviest mass held through lift and shake, by object, friction, pull and support.

A cell is one row of the chart. How far the arm is to go round the object is chosen with the lightest mass; the heaviest
is then looked for on a ladder of masses by bisection. A mass is held if at least `share` of its placements are, each
off the grasp frame by its own draw. What is held is `Tried.success`.

An object hangs from a hook above it, its axis level and across the bending plane, or stands on a table: a basket with
its bar level, all others with their axis upright. The arm hangs straight down beside it and bends in a vertical plane.
"""

from dataclasses import dataclass
from itertools import product
from typing import Annotated, Literal

import mujoco
import numpy as np
from pydantic import Field

from studies.payload.trials import Schedule, Tried, Tries, try_grasps
from trunkline.ar.hybrid.compose import Placed, compose
from trunkline.ar.hybrid.grasps import Grasp, Pull, object_in_base, pulls_of
from trunkline.ar.hybrid.objects import GraspObject, Shape
from trunkline.ar.hybrid.worlds import SupportSurface, WorldGeometry
from trunkline.errors import InputError
from trunkline.kinematics.panda.mounts import FixedMount
from trunkline.model.arm.contact_geometry import read_geometry
from trunkline.settings import Seed, settings

LEVEL = (np.sqrt(0.5), np.sqrt(0.5), 0.0, 0.0)  # turns an object's z to base y
UPRIGHT = (1.0, 0.0, 0.0, 0.0)
HOOK_ABOVE = 0.15  # m, of an object's upper side: the length of what it hangs by
BEGIN = 0.1  # kg, of the object as it is compiled; each trial has its own
TABLE, TABLE_SIZE = "table", (1.0, 1.0, 0.03)  # m

Support = Literal["hanging", "standing"]
Positive = Annotated[float, Field(gt=0, le=20)]
Metres = Annotated[float, Field(gt=0, le=0.5)]


@dataclass
class ChartGrid:
    """Cells of a part of the chart: every combination of supports, shapes, diameters (m), frictions (sliding
    coefficients), pulls (dorsal or ventral) and shortenings (m of cable, as commanded)."""

    supports: Annotated[list[Support], Field(min_length=1)]
    shapes: Annotated[list[Shape], Field(min_length=1)]
    diameters: Annotated[list[Metres], Field(min_length=1)]
    frictions: Annotated[list[Annotated[float, Field(gt=0, le=3)]], Field(min_length=1)]
    pulls: Annotated[list[Pull], Field(min_length=1)]
    shortenings: Annotated[list[Metres], Field(min_length=1)]


@settings
class PayloadSettings:
    """What the chart goes over, and how each cell is tried.

    Attributes:
        grids: the cells; one that several have counts once.
        height: of objects, m, if they are not wider.
        masses: the ladder, kg, rising.
        wraps: turns of the arm round the object, of which the best is taken. gap: between arm and object at first, m.
        placements: of each mass. spread: standard deviation of placements, m, across and along the arm.
        share: of placements that must hold.
        sag, slip: m, what counts as held, see `Tried.success`.
        timestep: s.
        schedule: what is done.
    """

    grids: Annotated[list[ChartGrid], Field(min_length=1)]
    height: Metres
    masses: Annotated[list[Positive], Field(min_length=1)]
    wraps: Annotated[list[Annotated[float, Field(gt=0, le=3)]], Field(min_length=1)]
    gap: Annotated[float, Field(ge=0, le=0.2)]
    placements: Annotated[int, Field(ge=1, le=1000)]
    spread: Annotated[float, Field(ge=0, le=0.1)]
    share: Annotated[float, Field(gt=0, le=1)]
    sag: Metres
    slip: Metres
    timestep: Annotated[float, Field(gt=0, le=0.005)]
    seed: Seed
    schedule: Schedule

    def __post_init__(self):
        if self.masses != sorted(set(self.masses)):
            raise ValueError(f"masses: found {self.masses}, expected each once, the lightest first")


@dataclass(frozen=True)
class Cell:
    """One row of the chart; units as in `PayloadSettings`."""

    support: Support
    shape: Shape
    diameter: float
    friction: float
    pull: Pull
    shortening: float


@dataclass
class HeaviestMass:
    """mass: kg, the heaviest held, 0 if none is. share: of placements that hold it, NaN for none. wrap: turns round the
    object. grasps: tried."""

    mass: float
    share: float
    wrap: float
    grasps: int


def cells(chart: PayloadSettings) -> list[Cell]:
    """Every cell, in the order in which they are tried."""
    combinations = [
        Cell(*values)
        for grid in chart.grids
        for values in product(
            grid.supports, grid.shapes, grid.diameters, grid.frictions, grid.pulls, grid.shortenings
        )
    ]  # fmt: skip
    return list(dict.fromkeys(combinations))


def try_masses(arm: mujoco.MjSpec, chart: PayloadSettings, cell: Cell, wrap: float, masses: np.ndarray) -> Tried:
    """Try each of `masses` (M,), kg, at every placement, `wrap` turns round it. Rows: M times `placements`.

    Raises:
        InputError: the object does not fit between table and mount.
    """
    geometry = read_geometry(arm)
    object = GraspObject(cell.shape, cell.diameter, max(chart.height, cell.diameter), BEGIN, "plastic")
    middle = object_in_base(geometry, cell.diameter, Grasp(wrap, chart.gap), cell.pull) - object.grip
    hanging = cell.support == "hanging"
    quaternion, surfaces, hook = (LEVEL if hanging else UPRIGHT), {}, None
    if hanging:
        hook = [float(value) for value in middle + [0, 0, cell.diameter / 2 + HOOK_ABOVE]]
    else:
        if cell.shape == "basket":  # its bar is where the arm wraps it
            top = middle[2] - object.half_height
        else:  # the tip just above the table, the object beside it
            top = -geometry.length - chart.spread
            middle[2] = top + object.half_height
            if middle[2] + object.half_height > 0:
                raise InputError(f"height: found {chart.height} m, expected an object below the mount")
        surfaces = {TABLE: SupportSurface([0.0, 0.0, top], list(TABLE_SIZE), "wood")}
    world = WorldGeometry(None, surfaces, hook)
    model = compose(arm, FixedMount("fixed"), world, Placed(object, middle, quaternion, hanging)).compile()
    model.opt.timestep = chart.timestep
    draws = np.random.default_rng(chart.seed).normal(size=(chart.placements, 2)) * chart.spread
    poses = np.tile([*middle, *quaternion], (chart.placements, 1))
    poses[:, 0] += draws[:, 0]
    if hanging:
        poses[:, 2] += draws[:, 1]
    count = len(masses) * chart.placements
    pulls = np.tile(pulls_of(cell.pull, cell.shortening), (count, 1))
    tries = Tries(
        np.tile(poses, (len(masses), 1)), np.repeat(masses, chart.placements), pulls, np.full(count, cell.friction)
    )
    return try_grasps(model, tries, chart.schedule, tuple(surfaces))


def heaviest(arm: mujoco.MjSpec, chart: PayloadSettings, cell: Cell) -> HeaviestMass:
    """The heaviest mass of the ladder that is held: bisection, as a lighter object is held where a heavier one is."""

    def share_of(wrap: float, rung: int) -> float:
        tried = try_masses(arm, chart, cell, wrap, np.array([chart.masses[rung]]))
        return float(np.mean(tried.success(chart.sag, chart.slip)))

    lightest = {wrap: share_of(wrap, 0) for wrap in chart.wraps}
    wrap = max(lightest, key=lambda wrap: lightest[wrap])
    grasps, best = len(chart.wraps) * chart.placements, lightest[wrap]
    if best < chart.share:
        return HeaviestMass(0.0, np.nan, wrap, grasps)
    heaviest_held, lost = 0, len(chart.masses)
    while lost - heaviest_held > 1:
        rung = (heaviest_held + lost) // 2
        share, grasps = share_of(wrap, rung), grasps + chart.placements
        if share >= chart.share:
            heaviest_held, best = rung, share
        else:
            lost = rung
    return HeaviestMass(chart.masses[heaviest_held], best, wrap, grasps)
