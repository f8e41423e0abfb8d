"""Where arms have their tips at rest: the twin, and others that are like it but for what is not known of it."""

import copy
from collections.abc import Iterator
from dataclasses import dataclass, replace

import mujoco
import numpy as np

from trunkline.identification.parameters.parameters import candidate_fields, set_fields
from trunkline.identification.parameters.spool_scale import wound
from trunkline.identification.simulate.experiment import SLACK
from trunkline.kinematics.residual.residual_map import ResidualMap, RestingPoses
from trunkline.model.arm_model import ArmModel
from trunkline.model.simulation.rest import base_frame
from trunkline.model.statics.chain import Chain, read_chain
from trunkline.model.statics.equilibria import Equilibrium, actuated
from trunkline.model.statics.hysteresis import friction_band, model_friction
from trunkline.model.statics.restart import actuated_from
from trunkline.report.certificate.poses import StaticPoses


@dataclass
class StaticArm:
    """chain: of a model, its cables not rubbing. origin, turn: of its mount in the frame of the tracked base, m (3,)
    and (3, 3). model: itself."""

    model: mujoco.MjModel
    chain: Chain
    origin: np.ndarray
    turn: np.ndarray

    def rest(self, poses: StaticPoses, near: np.ndarray | None = None) -> Equilibrium:
        """Where it rests, in the middle of what friction can hold, in the mount's frame: as it comes there from without
        pull, or beside the joint angles `near` (N, nq), rad, where an arm that is like it rests."""
        order = ArmModel(self.model).actuators
        controls = np.empty_like(poses.commands)
        controls[:, order] = poses.commands
        sent = wound(self.model, controls)[:, order]
        if near is not None:
            return actuated_from(self.chain, near, sent, poses.gravity @ self.turn)
        return actuated(self.chain, sent, poses.gravity @ self.turn)

    def tips(self, poses: StaticPoses, near: np.ndarray | None = None) -> np.ndarray:
        """Its tip at rest, in the frame of the tracked base, m, NaN where none is found. Shape (N, 3)."""
        return self.placed(self.rest(poses, near))

    def shift(self, learnt: ResidualMap | None, poses: StaticPoses) -> np.ndarray:
        """By how far the tip of the arm that it stands for rests beside its own, in the frame of the tracked base, m; 0
        where nothing is learnt. Shape (N, 3)."""
        if learnt is None:
            return np.zeros((len(poses), 3))
        return learnt.mean(self.resting(poses)) @ self.turn.T

    def resting(self, poses: StaticPoses) -> RestingPoses:
        """In its mount's frame, pulls NaN where it finds no rest."""
        rest = self.rest(poses)
        resting = RestingPoses.of(self.chain, rest, poses.gravity @ self.turn)
        return replace(resting, pulls=np.where(rest.converged[:, None], resting.pulls, np.nan))

    def placed(self, equilibrium: Equilibrium) -> np.ndarray:
        tips = np.where(equilibrium.converged[:, None], equilibrium.position, np.nan)
        return self.origin + tips @ self.turn.T

    def friction(self, poses: StaticPoses) -> np.ndarray:
        """From the tip at rest to one end of the band in which friction can hold it, m, half of it where the ends lie
        unevenly; 0 where none is found. Shape (N, 3)."""
        equilibrium = self.rest(poses)
        dry, mu = model_friction(self.model), self.whole.capstan
        if mu == 0 and not any(part.any() for part in dry):
            return np.zeros((len(poses), 3))
        band = friction_band(self.chain, equilibrium.tensions, poses.gravity @ self.turn, *dry, capstan=mu)
        return np.nan_to_num((band.loaded - band.unloaded) / 2) @ self.turn.T

    @property
    def whole(self) -> Chain:
        """Its chain with the friction of its cables."""
        return read_chain(self.model)

    def ways(self, poses: StaticPoses) -> np.ndarray:
        """How far gravity moves the tip from where the arm without weight has it, and how far the cables move it from
        there, m. Shape (N, 2)."""
        loose = StaticPoses(poses.gravity, np.broadcast_to(self.chain.straight_lengths + SLACK, poses.commands.shape))
        weightless = self.tips(StaticPoses(np.zeros((1, 3)), loose.commands[:1])) if len(poses) else np.zeros((0, 3))
        hanging, pulled = self.tips(loose), self.tips(poses)
        return np.linalg.norm([hanging - weightless, pulled - hanging], axis=2).T


def arm_of(model: mujoco.MjModel) -> StaticArm:
    return StaticArm(model, read_chain(model).smooth, *base_frame(model))


def arms_with(model: mujoco.MjModel, values: dict[str, np.ndarray]) -> Iterator[StaticArm]:
    """`model` with each of the values of its parameters in turn, one copy that changes.

    Args:
        values: by name. Each of shape (D,).
    """
    variant, data = copy.copy(model), mujoco.MjData(model)
    fields = candidate_fields(model, values)
    for candidate in range(len(next(iter(values.values())))):
        set_fields(variant, fields, candidate)
        mujoco.mj_setConst(variant, data)  # what softens joint limits follows from where hinges are
        yield arm_of(variant)
