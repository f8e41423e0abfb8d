"""The tendons' commands for a tip target, by the network.

The network wants a whole tip pose, the user gives a position: of an arm that only bends, the one says the other. In the
target's plane through the arm's axis the tip's orientation is a turn by the bend. The network is asked for the target
at many bends, and the one for which it foresees the tip nearest to the target is taken. With the arm's statics, that is
corrected; the tip may still pass the target by some mm, as an arm that only bends reaches a surface.
"""

import math
from collections.abc import Callable
from dataclasses import dataclass
from functools import partial

import numpy as np
import onnxruntime
from onnxruntime.capi.onnxruntime_pybind11_state import Fail, InvalidGraph, InvalidProtobuf
from scipy.spatial.transform import Rotation

from trunkline.ar.teleop.correction import Bent, corrected, shift_of
from trunkline.ar.teleop.tilt_reach import AZIMUTH, STRAIGHT_DOWN, SYMMETRY
from trunkline.ar.teleop.vectors import Vector
from trunkline.errors import InputError
from trunkline.kinematics.ik.inference import ask
from trunkline.kinematics.ik.inputs import TILT
from trunkline.kinematics.residual.residual_map import ResidualMap
from trunkline.model.statics.chain import Chain

NO_NETWORK = Fail, InvalidGraph, InvalidProtobuf  # what a file that is none ends with
LEANING = 0.03  # m, by which an arm that leans may have its tip farther from its target, at most
BENDS = np.radians(np.arange(-330.0, 331.0, 2.0))  # of the tip in its plane; a spiral curls further than a turn


@dataclass(frozen=True)
class Network:
    """`ask`: as `trunkline.kinematics.ik.inference.ask`, of one network. `inputs`: how many numbers it takes, 8 or 10,
    which says in what form it is told of gravity (`trunkline/kinematics/ik/inputs.py`)."""

    ask: Callable[[np.ndarray], dict[str, np.ndarray]]
    inputs: int


def session_of(file: str | bytes) -> onnxruntime.InferenceSession:
    """Of an ONNX file of `train_ik`: its path, or its contents."""
    return onnxruntime.InferenceSession(file, providers=["CPUExecutionProvider"])


def network_of(session: onnxruntime.InferenceSession) -> Network:
    return Network(partial(ask, session), session.get_inputs()[0].shape[1])


def bend(
    network: Network, tip: Vector, gravity: Vector, tolerance: float, chain: Chain | None = None,
    learnt: ResidualMap | None = None, lean: Rotation | None = None,
) -> Bent:  # fmt: skip
    """Commands that bring the tip to `tip`, m, within `tolerance` m, under `gravity` (unit vector), all in the base
    frame. With `chain`, the arm's statics correct the network's answer, and the tip foreseen is theirs, moved by
    what is `learnt` of the arm if the network knows of that; then the arm may `lean` on its mount, too: what the
    network is asked for, and what is learnt, leans with it. By as much as that is elsewhere, LEANING at most,
    the tip may be farther.

    Raises:
        InputError: no bend comes so near, or a network of one tilt is asked about gravity out of its plane.
    """
    target, pull, by = tip, gravity, None if chain is None else lean
    if by is not None:
        tip, pull = _turned(by.inv(), tip), _turned(by.inv(), gravity)
        tolerance += min(float(np.linalg.norm(np.subtract(target, tip))), LEANING)
    if network.inputs == len(TILT):
        bent = _at_tilt(network, tip, gravity, chain, learnt)
    else:
        bent = _best_bend(network, tip, gravity)
    if chain is not None:
        better = corrected(chain, bent, tip, pull, learnt)
        if better is None:
            raise InputError("out of reach: the soft arm finds no rest under the commands for its target")
        bent = better if by is None else better._replace(tip=by.apply(better.tip))
    missed = float(np.linalg.norm(bent.tip - target))
    if missed > tolerance:
        raise InputError(f"out of reach: the soft arm's tip comes no nearer to its target than {1e3 * missed:.0f} mm")
    return bent


def _turned(by: Rotation, vector: Vector) -> Vector:
    x, y, z = (float(value) for value in by.apply(vector))
    return x, y, z


def _best_bend(network: Network, tip: Vector, gravity_inputs: tuple[float, ...]) -> Bent:
    """The answer that is foreseen nearest to `tip`, gravity being `gravity_inputs` as the network takes it."""
    plane = math.atan2(tip[1], tip[0])
    axis = [-math.sin(plane), math.cos(plane), 0.0]
    poses = np.empty((len(BENDS), len(gravity_inputs) + 7))
    poses[:, : len(gravity_inputs)], poses[:, -7:-4] = gravity_inputs, tip
    poses[:, -4], poses[:, -3:] = np.cos(BENDS / 2), np.outer(np.sin(BENDS / 2), axis)
    answer = network.ask(poses)
    best = int(np.argmin(np.linalg.norm(answer["tip"] - np.array(tip), axis=1)))
    return Bent(*(answer[name][best].astype(float) for name in ("commands", "lengths", "tip")))


def _at_tilt(
    network: Network, tip: Vector, gravity: Vector, chain: Chain | None = None, learnt: ResidualMap | None = None
) -> Bent:
    """Of a network that knows tilts about +y alone: gravity in another tendon's plane is the same twin, turned. What is
    `learnt` of the arm is not the same in both planes: the network's is of its own, and the arm's takes its place."""
    level = math.hypot(gravity[0], gravity[1])
    angle, turns = math.atan2(level, -gravity[2]), 0
    if angle > STRAIGHT_DOWN:
        azimuth = math.atan2(gravity[1], gravity[0])
        turns = round(azimuth / SYMMETRY)
        off = azimuth - turns * SYMMETRY
        if level * abs(math.sin(off)) > math.sin(AZIMUTH):
            raise InputError(f"gravity: comes {math.degrees(off):.0f}° beside a tendon's plane, which the package does "
                             "not know")  # fmt: skip
    cos, sin = math.cos(turns * SYMMETRY), math.sin(turns * SYMMETRY)
    bent = _best_bend(network, (cos * tip[0] + sin * tip[1], -sin * tip[0] + cos * tip[1], tip[2]), (angle,))
    # A tendon that stands where another one did does what that one did.
    commands, lengths = np.roll(bent.commands, turns), np.roll(bent.lengths, turns)
    in_plane, here = np.zeros(3), np.zeros(3)
    if turns and chain is not None and learnt is not None:
        in_plane = shift_of(learnt, chain, bent.commands, (math.sin(angle), 0.0, -math.cos(angle)))
        here = shift_of(learnt, chain, commands, gravity)
    x, y, z = bent.tip - in_plane
    return Bent(commands, lengths, np.array([cos * x - sin * y, sin * x + cos * y, z]) + here)
