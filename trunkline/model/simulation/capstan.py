"""Cables that rub on their holes while a batch moves: limits and arms of dry friction, which are no constants.

`trunkline/model/arm/guide_holes.py` says what rubs. The limit of a stretch is μ θ T exp(-s μ θ / 2) in N: θ the sum of
its units' bends, rad, T the cable's tension where the stretch begins, s the side to which the cable slides there, 1 to
the motor and -1 from it. Behind the stretch the tension is T exp(-s μ θ). MuJoCo's solver finds what friction acts
within limits. The friction's arms about the hinges are those that the cable itself has there.
"""

import mujoco
import numpy as np
from mujoco.batch import Batch

from trunkline.model.arm_model import CAPSTAN_FRICTION, ArmModel, stretch_edges

REFRESH = 1 / 120  # s between new limits: the motors' tensions and the bends change little within
CREEP = 1e-3  # m/s of sliding below which s is less than ±1


class CapstanFriction:
    """Sets the limits of `batch`'s simulations.

    Args:
        longest: s, of all steps taken now, in other batches too; this one's by default.

    Attributes:
        steps: after how many steps limits are to be set again.
    """

    def __init__(self, batch: Batch, longest: float | None = None) -> None:
        model = batch.model
        arm = ArmModel(model)
        self._batch, self._tendons, self._actuators = batch, arm.guide_holes, arm.actuators
        self._hinges = _hinges(model)
        self._begins = stretch_edges(self._hinges.shape[1], self._tendons.shape[1])[:-1]
        self._place = arm.places(CAPSTAN_FRICTION)
        if longest is None:
            timestep = batch.expanded("opt.timestep")
            longest = float(np.max(model.opt.timestep if timestep is None else timestep))
        self.steps = max(1, round(REFRESH / longest))
        self._entries, self._slopes = _arms(model, self._tendons)
        self._limits, self._arms = batch.expand("tendon_frictionloss"), batch.expand("wrap_prm")
        self._friction = batch.expand("numeric_data")
        self._angles, self._force = batch.bind("qpos"), batch.bind("actuator_force")
        self._speed, self._jacobian = batch.bind("ten_velocity"), batch.bind("ten_J")

    def begin(self, ids) -> None:
        """Find tensions, arms and speeds in simulations that have just been put where they are."""
        self._limits[np.ix_(ids, self._tendons.ravel())] = 0
        self._batch.forward(ids=ids)
        self._turn_arms(ids)
        self._batch.forward(ids=ids)

    def refresh(self, ids) -> None:
        """Set limits and arms for the next `steps` steps of the simulations `ids`, from their last one."""
        bends = np.linalg.norm(self._angles[ids][:, self._hinges], axis=3)  # (B, K, n)
        turns = self._friction[ids][:, self._place, None] * np.add.reduceat(bends, self._begins, axis=2)
        side = np.clip(-self._speed[ids][:, self._tendons] / CREEP, -1, 1)  # (B, K, P)
        falls = side * turns
        tension = np.maximum(-self._force[ids][:, self._actuators], 0)[..., None]
        with np.errstate(over="ignore", invalid="ignore"):  # bends of thousands of rad: MuJoCo warns that they diverge
            before = np.exp(-(np.cumsum(falls, axis=2) - falls / 2))
            limits = tension * before * turns
        self._limits[np.ix_(ids, self._tendons.ravel())] = limits.reshape(len(ids), -1)
        self._turn_arms(ids)

    def _turn_arms(self, ids) -> None:
        """Give friction the arms that the cables have now."""
        self._arms[np.ix_(ids, self._entries)] = self._jacobian[np.ix_(ids, self._slopes)]


def capstan_friction_of(batch: Batch, longest: float | None = None) -> CapstanFriction | None:
    """What sets the limits of a batch, None if nothing in it rubs; `longest` as in `CapstanFriction`."""
    arm = ArmModel(batch.model)
    if not arm.guide_holes.size:
        return None
    values = batch.expanded("numeric_data")
    values = batch.model.numeric_data[None] if values is None else values
    return CapstanFriction(batch, longest) if values[:, arm.places(CAPSTAN_FRICTION)].any() else None


def _hinges(model: mujoco.MjModel) -> np.ndarray:
    """Addresses of the two angles of each unit along each cable. Shape (K, n, 2)."""
    arm, addresses = ArmModel(model), []
    for cable in arm.cables:
        units = model.body_weldid[model.site_bodyid[arm.cable_sites(cable)]][1:]
        addresses.append(model.jnt_qposadr[model.body_jntadr[units][:, None] + np.arange(2)])
    return np.array(addresses)


def _arms(model: mujoco.MjModel, tendons: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
    """Addresses of the arms of friction in `wrap_prm`, and those of the cables' arms about the same hinges in `ten_J`.

    Args:
        tendons: by which cables rub. Shape (K, P).
    """
    entries, slopes = [], []
    for cable, stretches in zip(ArmModel(model).cables, tendons, strict=True):
        row = model.ten_J_rowadr[cable] + np.arange(model.ten_J_rownnz[cable])
        place = dict(zip(model.ten_J_colind[row].tolist(), row.tolist(), strict=True))
        for tendon in stretches:
            entries.append(model.tendon_adr[tendon] + np.arange(model.tendon_num[tendon]))
            slopes.append([place[dof] for dof in model.jnt_dofadr[model.wrap_objid[entries[-1]]].tolist()])
    return np.concatenate(entries), np.concatenate(slopes)
