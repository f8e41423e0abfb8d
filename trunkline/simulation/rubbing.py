"""Cables that rub on their holes while a batch moves: the limits of dry friction that MJCF cannot keep up with.

`trunkline/arm/holes.py` says what rubs. The limit of a stretch is μ θ T exp(-s μ θ / 2) in N: θ the sum of its units'
bends, rad, T the cable's tension where the stretch begins, s the side to which the cable slides there, 1 to the motor
and -1 from it. Behind the stretch the tension is T exp(-s μ θ). MuJoCo's solver finds what friction acts within limits.
"""

import mujoco
import numpy as np
from mujoco.batch import Batch

from trunkline.elements import CAPSTAN_FRICTION, cables, capstan_friction, holes

REFRESH = 1 / 120  # s between new limits: the motors' tensions and the bends change little within
CREEP = 1e-3  # m/s of sliding below which s is less than ±1


class Rubbing:
    """Sets the limits of `batch`'s simulations.

    Attributes:
        steps: after how many steps limits are to be set again.
    """

    def __init__(self, batch: Batch) -> None:
        model = batch.model
        self._batch, self._tendons = batch, holes(model)
        self._actuators = [int(np.flatnonzero(model.actuator_trnid[:, 0] == cable)[0]) for cable in cables(model)]
        self._hinges = _hinges(model)
        stretches = self._tendons.shape[1]
        count = self._hinges.shape[1]
        self._edges = np.arange(stretches) * count // stretches
        self._address = model.numeric_adr[model.numeric(CAPSTAN_FRICTION).id]
        timestep = batch.expanded("opt.timestep")
        longest = float(np.max(model.opt.timestep if timestep is None else timestep))
        self.steps = max(1, round(REFRESH / longest))
        self._limits = batch.expand("tendon_frictionloss")
        self._friction = batch.expand("numeric_data")
        self._angles, self._force = batch.bind("qpos"), batch.bind("actuator_force")
        self._speed = batch.bind("ten_velocity")

    def begin(self, ids) -> None:
        """Find the tensions of simulations that have just been put where they are."""
        self._limits[np.ix_(ids, self._tendons.ravel())] = 0
        self._batch.forward(ids=ids)

    def refresh(self, ids) -> None:
        """Set the limits for the next `steps` steps of the simulations `ids`, from their last one."""
        bends = np.linalg.norm(self._angles[ids][:, self._hinges], axis=3)  # (B, K, n)
        turns = self._friction[ids, self._address, None, None] * np.add.reduceat(bends, self._edges, axis=2)
        side = np.clip(-self._speed[ids][:, self._tendons] / CREEP, -1, 1)  # (B, K, P)
        falls = side * turns
        tension = np.maximum(-self._force[ids][:, self._actuators], 0)[..., None]
        before = np.exp(-(np.cumsum(falls, axis=2) - falls / 2))
        limits = tension * before * turns
        self._limits[np.ix_(ids, self._tendons.ravel())] = limits.reshape(len(ids), -1)


def rubbing(batch: Batch) -> Rubbing | None:
    """What sets the limits of a batch, None if nothing in it rubs."""
    friction = batch.expanded("numeric_data")
    rubs = capstan_friction(batch.model) > 0 if friction is None else bool(np.any(friction))
    return Rubbing(batch) if rubs and holes(batch.model).size else None


def _hinges(model: mujoco.MjModel) -> np.ndarray:
    """Addresses of the two angles of each unit along each cable. Shape (K, n, 2)."""
    found = []
    for cable in cables(model):
        path = slice(model.tendon_adr[cable], model.tendon_adr[cable] + model.tendon_num[cable])
        units = model.body_weldid[model.site_bodyid[model.wrap_objid[path]]][1:]
        found.append(model.jnt_qposadr[model.body_jntadr[units][:, None] + np.arange(2)])
    return np.array(found)
