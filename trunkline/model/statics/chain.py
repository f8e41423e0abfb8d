"""A compiled MuJoCo model as the plain arrays that its statics need.

Every vector is in the base frame (the body that carries the first unit) with all joints at `qpos0`, so a unit's
own frame is the base frame moved to its joint, and the rotation of unit i is the product of its hinges' rotations.
"""

from typing import NamedTuple

import mujoco
import numpy as np

from trunkline.errors import InputError
from trunkline.frames import rotation_from_wxyz, wxyz_from_rotation
from trunkline.model.arm_model import ArmModel
from trunkline.model.statics.limits import hinge_limits, limit_energies, tendon_limits
from trunkline.model.statics.supported import require_supported
from trunkline.model.statics.tendon_paths import tendon_crossings, tendon_holes

FORCE_ROUNDING = 1e-3  # share by which a tension may exceed the motors' force and count as within it


class Chain(NamedTuple):
    """n units with two hinges each, K tendons, nq = 2 n joint angles ordered as in the model.

    Attributes:
        offset: from the joint of the unit before (from the base, for the first) to the unit's joint, m. Shape (n, 3).
        axes: directions of the two hinges. Shape (n, 2, 3).
        zero: joint angles of the reference configuration, rad. Shape (n, 2).
        mass: kg. Shape (n,).
        center: centre of mass from the unit's joint, m. Shape (n, 3).
        stiffness: a, b, c of the elastic torque -(a x + b x² + c x³), x the angle from `rest`. Shape (n, 2, 3).
        diagonal, slack: c and l of the torque -c (x - l)³ on the sum x of both angles, and on their difference, of
            joints that are round. Shape (n, 2).
        rest: spring references, rad. Shape (n, 2).
        limit: lower and upper angle at which a limit starts to push, rad (infinite if none): of the hinges, of the sum
            of both angles and of their difference. Shape (n, 4, 2).
        limit_gain: k / invweight0, N m/rad: see `limits.limit_torque`. Shape (n, 4).
        limit_impedance: solimp. Shape (n, 4, 5).
        limit_energy: of a limit at the depth from which its impedance is constant, J. Shape (n, 4).
        hole_in: site on the unit before, from the unit's joint, m. Shape (n, K, 3).
        hole_out: site on the unit, from its joint, m. Shape (n, K, 3).
        crosses: 1 where the tendon crosses the unit's joint, else 0. Shape (n, K).
        fixed_length: length of the path between sites on one body, m. Shape (K,).
        gain: position gain of the tendon's actuator, N/m, 0 of all that hold tensions. Shape (K,).
        max_tension: largest pull of the tendon's actuator, N. Shape (K,).
        capstan: μ of capstan friction; less than zero stands for an arm let go, see
        `trunkline/model/statics/capstan.py`.
        slip: m of a tendon's sliding within which it builds up.
        tip: tip site from the last joint, m. Shape (3,).
        tip_quaternion: orientation of the tip site in the reference configuration. Shape (4,).
    """

    offset: np.ndarray
    axes: np.ndarray
    zero: np.ndarray
    mass: np.ndarray
    center: np.ndarray
    stiffness: np.ndarray
    diagonal: np.ndarray
    slack: np.ndarray
    rest: np.ndarray
    limit: np.ndarray
    limit_gain: np.ndarray
    limit_impedance: np.ndarray
    limit_energy: np.ndarray
    hole_in: np.ndarray
    hole_out: np.ndarray
    crosses: np.ndarray
    fixed_length: np.ndarray
    gain: np.ndarray
    max_tension: np.ndarray
    capstan: float
    slip: float
    tip: np.ndarray
    tip_quaternion: np.ndarray

    @property
    def smooth(self) -> "Chain":
        """The same arm, its tendons sliding without friction: its rest is between what friction can hold."""
        return self._replace(capstan=0.0)

    def loaded(self, load: float) -> "Chain":
        """The same arm with a point mass at its tip, kg, as `simulation.load.hang` gives it to a batch."""
        if not load:
            return self
        mass, center = self.mass.copy(), self.center.copy()
        mass[-1] += load
        center[-1] += (load / mass[-1]) * (self.tip - center[-1])
        return self._replace(mass=mass, center=center)

    @property
    def units(self) -> int:
        return len(self.mass)

    @property
    def tendons(self) -> int:
        return len(self.gain)

    @property
    def by_force(self) -> bool:
        """Whether its motors are commanded by force: then a command is a tension."""
        return self.tendons > 0 and not self.gain.any()

    def pulls(self, commands: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
        """λ and L, in the words of `energy.Pull`, of motors that are sent `commands`, m or N. All of one shape
        (..., K)."""
        commands = np.ascontiguousarray(commands, float)
        if self.by_force:
            return np.clip(commands, 0, self.max_tension), np.zeros_like(commands)
        return np.zeros_like(commands), commands

    def commands(self, lengths: np.ndarray, tensions: np.ndarray) -> np.ndarray:
        """What motors are sent that hold `tensions`, N, at path `lengths`, m. All of shape (..., K)."""
        return np.array(tensions) if self.by_force else lengths - tensions / self.gain

    @property
    def length(self) -> float:
        """Length of the arm from its mount, over all joints, to the tip, m."""
        return float(np.linalg.norm(self.offset, axis=1).sum() + np.linalg.norm(self.tip))

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

    arm = ArmModel(model)
    units = arm.unit_bodies
    base = model.body_parentid[units[0]]
    to_base = data.xmat[base].reshape(3, 3).T
    joints = model.body_jntadr[units][:, None] + np.arange(2)  # (n, 2)
    anchors = (data.xanchor[joints[:, 0]] - data.xpos[base]) @ to_base.T
    mass, center = _unit_inertials(model, data, units)
    holes = tendon_holes(model, data, units)
    hole_in, hole_out, crosses, fixed_length = tendon_crossings(holes, data, base, to_base, anchors)
    tip, tip_quaternion = _tip(model, data, tip_site, units, base, to_base)
    diagonal, slack, tendons = _diagonals(model, joints)
    both = zip(hinge_limits(model, joints), tendon_limits(model, tendons), strict=True)
    limit, gains, impedances = (np.concatenate(pair, axis=1) for pair in both)
    return Chain(
        offset=np.diff(anchors, axis=0, prepend=0.0),
        axes=data.xaxis[joints] @ to_base.T,
        zero=model.qpos0[joints],
        mass=mass,
        center=(center - data.xpos[base]) @ to_base.T - anchors,
        stiffness=np.concatenate([model.jnt_stiffness[joints][..., None], model.jnt_stiffnesspoly[joints]], axis=2),
        diagonal=diagonal,
        slack=slack,
        rest=model.qpos_spring[joints],
        limit=limit,
        limit_gain=gains,
        limit_impedance=impedances,
        limit_energy=limit_energies(gains, impedances),
        hole_in=hole_in,
        hole_out=hole_out,
        crosses=crosses,
        fixed_length=fixed_length,
        gain=np.maximum(model.actuator_gainprm[arm.actuators, 0], 0),  # a motor that is sent its tension has -1
        max_tension=_max_tensions(arm),
        capstan=arm.capstan_friction,
        slip=arm.slip_length,
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


def _diagonals(model: mujoco.MjModel, joints: np.ndarray) -> tuple[np.ndarray, np.ndarray, np.ndarray]:
    """`diagonal` and `slack` of units with the hinges `joints` (n, 2), see `Chain`, and the numbers of their tendons,
    -1 for none. Shape (n, 2)."""
    stiffness, slack, tendons = np.zeros(joints.shape), np.zeros(joints.shape), np.full(joints.shape, -1)
    for column, group in enumerate(ArmModel(model).diagonals):
        units = np.searchsorted(joints[:, 0], group.hinge)
        stiffness[units, column] = model.tendon_stiffnesspoly[group.tendon, 1]
        slack[units, column] = model.tendon_lengthspring[group.tendon, 0]
        tendons[units, column] = group.tendon
    return stiffness, slack, tendons


def _max_tensions(arm: ArmModel) -> np.ndarray:
    force, model = -arm.model.actuator_forcerange[arm.actuators, 0], arm.model
    tendon_limit = np.where(model.tendon_actfrclimited, -model.tendon_actfrcrange[:, 0], np.inf)[arm.cables]
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
