"""A body for the arm to touch with: one convex geom a unit, that changes nothing of how the arm moves by itself.

A unit of the spiral is a double cone: the gap between two units is a wedge of the angle Δθ, so that they close on each
other at the joint's limit Δθ, and each unit gives half of it. With upper and lower widths W and W', length l and
k = tan(Δθ/2), its outline in (r, z) is (0, 0), (W/2, -k W/2), (W'/2, -l + k W'/2), (0, -l), which is convex.

A geom is the hull of two rings and two points on the axis. The rings' corners lie outside of the circle by as much as
the middles of their sides inside. Everything is read from the arm's MJCF, so another chain may take the spiral's place.
"""

import mujoco
import numpy as np

from trunkline.errors import InputError
from trunkline.model.arm.geometry import ChainGeometry
from trunkline.model.arm.mjcf import unit_name

CORNERS = 24  # of a ring: it is off the circle by 0.43 % of the radius at most
TOUCH = "_touch"  # ends the name of a unit's mesh and geom
ROBOT, ARM, OBJECT, WORLD = 1, 2, 4, 8  # bits of contype and conaffinity


def read_geometry(spec: mujoco.MjSpec) -> ChainGeometry:
    """The units' shape, as the arm's MJCF has it in its bodies, limits and visible geoms.

    Raises:
        InputError: a unit has no visible cylinder of its own, or the arm no site `tip`.
    """
    tops, radii, ranges = [], [], []
    while (body := spec.body(unit_name(len(tops)))) is not None:
        geom = spec.geom(f"{body.name}_geom")
        if geom is None or geom.type != mujoco.mjtGeom.mjGEOM_CYLINDER:
            raise InputError(f"arm.xml: found no cylinder {body.name}_geom, expected one that is as wide as the unit")
        tops.append(float(body.pos[2]))
        radii.append(float(geom.size[0]))
        ranges.append(float(body.joints[0].range[1]))
    tip = spec.site("tip")
    if not tops or tip is None:
        raise InputError(
            f"arm.xml: found {len(tops)} bodies unit_01, … and {'a' if tip else 'no'} site 'tip', "
            "expected a chain of units that ends in one"
        )
    lengths = -np.array([*tops[1:], float(tip.pos[2])])
    ratio = radii[1] / radii[0] if len(radii) > 1 else 1.0
    return ChainGeometry(lengths, 2 * np.array(radii), np.array(ranges), ratio)


def outline(geometry: ChainGeometry, unit: int) -> np.ndarray:
    """Rows (r, z) of a unit's outline, m, from its upper end in the joint's plane to its lower end. Shape (4, 2)."""
    upper, lower = geometry.widths[unit] / 2, geometry.ratio * geometry.widths[unit] / 2
    length, slope = geometry.lengths[unit], np.tan(geometry.joint_range[unit] / 2)
    slope = min(slope, 0.8 * length / (upper + lower))  # a rim of no height would be no rim
    return np.array([(0, 0), (upper, -slope * upper), (lower, slope * lower - length), (0, -length)])


def unit_corners(geometry: ChainGeometry, unit: int) -> np.ndarray:
    """The corners whose hull is a unit, m, in its body's frame. Shape (2 + 2 CORNERS, 3)."""
    (_, top), (upper, upper_z), (lower, lower_z), (_, bottom) = outline(geometry, unit)
    angle = 2 * np.pi * np.arange(CORNERS) / CORNERS
    outside = 2 / (1 + np.cos(np.pi / CORNERS))
    circle = outside * np.column_stack([np.cos(angle), np.sin(angle)])
    rings = [np.column_stack([radius * circle, np.full(CORNERS, z)])
             for radius, z in ((upper, upper_z), (lower, lower_z))]  # fmt: skip
    return np.concatenate([[(0, 0, top)], *rings, [(0, 0, bottom)]])


def add_touch(
    spec: mujoco.MjSpec, friction: tuple[float, float, float], solref: tuple[float, float], solimp: tuple[float, ...]
) -> None:
    """Give every unit of an arm its geom, in place: weightless, and without contact between neighbours.

    Args:
        friction: sliding, torsional (m) and rolling (m) coefficients. solref, solimp: MuJoCo's, of the
            contact.
    """
    geometry = read_geometry(spec)
    for unit in range(geometry.units):
        name = unit_name(unit)
        mesh = spec.add_mesh(name=f"{name}{TOUCH}")
        mesh.uservert = unit_corners(geometry, unit).ravel()
        spec.body(name).add_geom(
            name=f"{name}{TOUCH}", type=mujoco.mjtGeom.mjGEOM_MESH, meshname=mesh.name, mass=0, group=3,
            contype=ARM, conaffinity=WORLD | ARM, condim=4, friction=friction, solref=solref,
            solimp=solimp,
        )  # fmt: skip
        if unit:
            spec.add_exclude(name=f"{name}_neighbour", bodyname1=unit_name(unit - 1), bodyname2=name)
