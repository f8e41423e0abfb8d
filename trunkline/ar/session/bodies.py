"""Which bodies of a composed model are drawn, and their poses."""

import mujoco
import numpy as np

from trunkline.ar.hybrid.rollouts import Piece


def drawn_bodies(model: mujoco.MjModel) -> tuple[str, ...]:
    """Names of the bodies that have geoms and move, in the model's order; the object is there or not."""
    with_geoms = sorted({int(body) for body in model.geom_bodyid if body})
    return tuple(model.body(body).name for body in with_geoms)


class BodyPoses:
    """Poses (N, 7) of the bodies `names` of a model, position and quaternion, w first; NaN of those that it lacks."""

    def __init__(self, model: mujoco.MjModel, names: tuple[str, ...]) -> None:
        self._model, self._data = model, mujoco.MjData(model)
        numbers = [mujoco.mj_name2id(model, mujoco.mjtObj.mjOBJ_BODY, name) for name in names]
        self._there = [row for row, number in enumerate(numbers) if number >= 0]
        self._numbers, self._count = [number for number in numbers if number >= 0], len(names)

    def of(self, qpos: np.ndarray) -> np.ndarray:
        """At `qpos` (nq,)."""
        self._data.qpos[:] = qpos
        mujoco.mj_kinematics(self._model, self._data)
        poses = np.full((self._count, 7), np.nan)
        poses[self._there, :3] = self._data.xpos[self._numbers]
        poses[self._there, 3:] = self._data.xquat[self._numbers]
        return poses

    def of_piece(self, piece: Piece) -> np.ndarray:
        """Of its first future. Shape (F, N, 7), float32."""
        return np.array([self.of(qpos) for qpos in piece.qpos[0]], dtype=np.float32)
