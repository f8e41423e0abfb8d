"""A compiled MuJoCo model as the plain arrays that its statics need.

Every vector is in the base frame (the body that carries the first unit) with all joints at `qpos0`, so a unit's
own frame is the base frame moved to its joint, and the rotation of unit i is the product of its hinges' rotations.
"""

from typing import NamedTuple

import mujoco
import numpy as np

from trunkline.errors import InputError
from trunkline.frames import rotation_from_wxyz, wxyz_from_rotation
from trunkline.statics.supported import require_supported, unit_bodies

FORCE_ROUNDING = 1e-3  # share by which a tension may exceed the motors' force and count as within it
MIN_IMPEDANCE, MAX_IMPEDANCE = mujoco.mjMINIMP, mujoco.mjMAXIMP


class Chain(NamedTuple):
    """n units with two hinges each, K tendons, nq = 2 n joint angles ordered as in the model.

    Attributes:
        offset: from the joint of the unit before (from the base, for the first) to the unit's joint, m. Shape (n, 3).
        axes: directions of the two hinges. Shape (n, 2, 3).
        zero: joint angles of the reference configuration, rad. Shape (n, 2).
        mass: kg. Shape (n,).
        center: centre of mass from the unit's joint, m. Shape (n, 3).
        stiffness: a, b, c of the elastic torque -(a x + b x² + c x³), x the angle from `rest`. Shape (n, 2, 3).
        rest: spring references, rad. Shape (n, 2).
        torque: constant torques, N m; zero as read, dry friction where its band is sought. Shape (n, 2).
        limit: lower and upper angle at which a limit starts to push, rad (infinite if none). Shape (n, 2, 2).
        limit_gain: k / dof_invweight0, N m/rad: see `energy.limit_spring`. Shape (n, 2).
        limit_impedance: solimp. Shape (n, 2, 5).
        hole_in: site on the unit before, from the unit's joint, m. Shape (n, K, 3).
        hole_out: site on the unit, from its joint, m. Shape (n, K, 3).
        crosses: 1 where the tendon crosses the unit's joint, else 0. Shape (n, K).
        fixed_length: length of the path between sites on one body, m. Shape (K,).
        gain: position gain of the tendon's actuator, N/m. Shape (K,).
        max_tension: largest pull of the tendon's actuator, N. Shape (K,).
        tip: tip site from the last joint, m. Shape (3,).
        tip_quaternion: orientation of the tip site in the reference configuration. Shape (4,).
    """

    offset: np.ndarray
    axes: np.ndarray
    zero: np.ndarray
    mass: np.ndarray
    center: np.ndarray
    stiffness: np.ndarray
    rest: np.ndarray
    torque: np.ndarray
    limit: np.ndarray
    limit_gain: np.ndarray
    limit_impedance: np.ndarray
    hole_in: np.ndarray
    hole_out: np.ndarray
    crosses: np.ndarray
    fixed_length: np.ndarray
    gain: np.ndarray
    max_tension: np.ndarray
    tip: np.ndarray
    tip_quaternion: np.ndarray

    @property
    def units(self) -> int:
        return len(self.mass)

    @property
    def tendons(self) -> int:
        return len(self.gain)

    @property
    def length(self) -> float:
        """Length of the arm from its first joint to the tip, m."""
        return float(np.linalg.norm(self.offset[1:], axis=1).sum() + np.linalg.norm(self.tip))

    @property
    def straight_lengths(self) -> np.ndarray:
        """Path length of each tendon in the reference configuration, m. Shape (K,)."""
        chords = np.linalg.norm(self.hole_out - self.hole_in, axis=2)
        return self.fixed_length + (self.crosses * chords).sum(axis=0)


def read_chain(model: mujoco.MjModel, tip_site: str = "tip") -> Chain:
    """The static chain of a compiled model.

    Args:
        model: an unbranched chain of units, two hinges at one point each, pulled by tendons through sites.
        tip_site: name of the site whose pose is the tip's.

    Raises:
        InputError: naming the element that the chain cannot represent.
    """
    require_supported(model)
    data = mujoco.MjData(model)
    data.qpos[:] = model.qpos0
    mujoco.mj_kinematics(model, data)
    mujoco.mj_comPos(model, data)

    units = unit_bodies(model)
    base = model.body_parentid[units[0]]
    to_base = data.xmat[base].reshape(3, 3).T
    joints = model.body_jntadr[units][:, None] + np.arange(2)  # (n, 2)
    anchors = (data.xanchor[joints[:, 0]] - data.xpos[base]) @ to_base.T
    mass, center = _unit_inertials(model, data, units)
    holes = _tendon_holes(model, data, units)
    hole_in, hole_out, crosses, fixed_length = _tendon_crossings(holes, data, base, to_base, anchors)
    order = [int(np.flatnonzero(model.actuator_trnid[:, 0] == t)[0]) for t in range(model.ntendon)]
    tip, tip_quaternion = _tip(model, data, tip_site, units, base, to_base)
    return Chain(
        offset=np.diff(anchors, axis=0, prepend=0.0),
        axes=data.xaxis[joints] @ to_base.T,
        zero=model.qpos0[joints],
        mass=mass,
        center=(center - data.xpos[base]) @ to_base.T - anchors,
        stiffness=np.concatenate([model.jnt_stiffness[joints][..., None], model.jnt_stiffnesspoly[joints]], axis=2),
        rest=model.qpos_spring[joints],
        torque=np.zeros((len(units), 2)),
        limit=_limits(model, joints),
        limit_gain=_limit_gains(model, joints),
        limit_impedance=_limit_impedances(model, joints),
        hole_in=hole_in,
        hole_out=hole_out,
        crosses=crosses,
        fixed_length=fixed_length,
        gain=model.actuator_gainprm[order, 0],
        max_tension=_max_tensions(model, order),
        tip=tip - anchors[-1],
        tip_quaternion=tip_quaternion,
    )


def _unit_inertials(model: mujoco.MjModel, data: mujoco.MjData, units: np.ndarray):
    """Mass (n,) and world centre of mass (n, 3) of each unit with all that is welded to it."""
    mass, center = np.zeros(len(units)), np.zeros((len(units), 3))
    for index, unit in enumerate(units):
        welded = model.body_weldid == unit
        mass[index] = model.body_mass[welded].sum()
        moment = (model.body_mass[welded, None] * data.xipos[welded]).sum(axis=0)
        center[index] = moment / mass[index] if mass[index] > 0 else data.xpos[unit]
    return mass, center


def _tendon_holes(model: mujoco.MjModel, data: mujoco.MjData, units: np.ndarray):
    """Per tendon its name and its sites as (unit index, -1 for the base; world position)."""
    index_of = {0: -1} | {int(body): index for index, body in enumerate(units)}
    holes = []
    for tendon in range(model.ntendon):
        start = model.tendon_adr[tendon]
        sites = model.wrap_objid[start : start + model.tendon_num[tendon]]
        bodies = model.body_weldid[model.site_bodyid[sites]]
        path = [(index_of[int(b)], data.site_xpos[s]) for b, s in zip(bodies, sites, strict=True)]
        holes.append((model.tendon(tendon).name, path))
    return holes


def _tendon_crossings(holes, data, base, to_base, anchors):
    """Split each path into chords that cross one joint and chords within one unit, which never change."""
    units, tendons = len(anchors), len(holes)
    hole_in, hole_out = np.zeros((units, tendons, 3)), np.zeros((units, tendons, 3))
    crosses, fixed_length = np.zeros((units, tendons)), np.zeros(tendons)
    for tendon, (name, path) in enumerate(holes):
        for (unit_a, world_a), (unit_b, world_b) in zip(path[:-1], path[1:], strict=True):
            if unit_a == unit_b:
                fixed_length[tendon] += np.linalg.norm(world_b - world_a)
                continue
            if abs(unit_a - unit_b) != 1:
                raise InputError(f"model: tendon {name!r}: found sites that skip a unit, expected one in each")
            (_, world_in), (outer, world_out) = sorted([(unit_a, world_a), (unit_b, world_b)], key=_unit_of)
            if crosses[outer, tendon]:
                raise InputError(f"model: tendon {name!r}: found a joint that it crosses twice, expected once")
            hole_in[outer, tendon] = to_base @ (world_in - data.xpos[base]) - anchors[outer]
            hole_out[outer, tendon] = to_base @ (world_out - data.xpos[base]) - anchors[outer]
            crosses[outer, tendon] = 1
    return hole_in, hole_out, crosses, fixed_length


def _unit_of(hole: tuple) -> int:
    return hole[0]


def _limits(model: mujoco.MjModel, joints: np.ndarray) -> np.ndarray:
    """Angles at which the limit's distance falls below its margin."""
    margin = model.jnt_margin[joints][..., None] * [1, -1]
    limited = model.jnt_limited[joints][..., None].astype(bool)
    return np.where(limited, model.jnt_range[joints] + margin, [-np.inf, np.inf])


def _limit_gains(model: mujoco.MjModel, joints: np.ndarray) -> np.ndarray:
    """k / dof_invweight0 with k from solref (MuJoCo docs, "Solver parameters: Reference")."""
    solref, d_width = model.jnt_solref[joints], _limit_impedances(model, joints)[..., 1]
    time_constant, damping_ratio = solref[..., 0], solref[..., 1]
    if not model.opt.disableflags & mujoco.mjtDisableBit.mjDSBL_REFSAFE:
        time_constant = np.where(time_constant > 0, np.maximum(time_constant, 2 * model.opt.timestep), time_constant)
    with np.errstate(divide="ignore"):
        standard = 1 / np.maximum(mujoco.mjMINVAL, (d_width * time_constant * damping_ratio) ** 2)
    direct = -solref[..., 0] / d_width**2
    k = np.where(solref[..., 0] > 0, standard, direct)
    dofs = model.jnt_dofadr[joints]
    return k / model.dof_invweight0[dofs]


def _limit_impedances(model: mujoco.MjModel, joints: np.ndarray) -> np.ndarray:
    """solimp as MuJoCo clamps it."""
    solimp = model.jnt_solimp[joints].copy()
    solimp[..., [0, 1, 3]] = np.clip(solimp[..., [0, 1, 3]], MIN_IMPEDANCE, MAX_IMPEDANCE)
    solimp[..., 2] = np.maximum(0, solimp[..., 2])
    solimp[..., 4] = np.maximum(1, solimp[..., 4])
    return solimp


def _max_tensions(model: mujoco.MjModel, order: list[int]) -> np.ndarray:
    force = -model.actuator_forcerange[order, 0]
    tendon_limit = np.where(model.tendon_actfrclimited, -model.tendon_actfrcrange[:, 0], np.inf)
    return np.minimum(force, tendon_limit)


def _tip(model, data, tip_site, units, base, to_base):
    """Position in the base frame and orientation of the tip site in the reference configuration."""
    site = mujoco.mj_name2id(model, mujoco.mjtObj.mjOBJ_SITE, tip_site)
    if site < 0:
        raise InputError(f"model: found no site {tip_site!r}, expected one at the tip")
    if model.body_weldid[model.site_bodyid[site]] != units[-1]:
        body = model.body(model.site_bodyid[site]).name
        raise InputError(f"model: site {tip_site!r}: found on body {body!r}, expected on the last unit")
    world, base_world = np.zeros(4), data.xquat[base]
    mujoco.mju_mat2Quat(world, data.site_xmat[site])
    rotation = rotation_from_wxyz(base_world).inv() * rotation_from_wxyz(world)
    return to_base @ (data.site_xpos[site] - data.xpos[base]), wxyz_from_rotation(rotation)
