"""The inverse kinematics: a small network from gravity and tip pose to the commands of the motors."""

from typing import NamedTuple

import numpy as np
import torch
from torch import nn

from trunkline.kinematics.ik.inputs import position_of

OUTPUTS = ("commands", "lengths", "tip")
# products of quaternion components: a rotation matrix is linear in them, and q and -q give the same ones. The
# quaternion is the last of the inputs.
FIRST = [-4, -4, -4, -4, -3, -3, -3, -2, -2, -1]
SECOND = [-4, -3, -2, -1, -3, -2, -1, -2, -1, -1]


class Answer(NamedTuple):
    """What the network says of B targets.

    Attributes:
        commands: of the position actuators, m. Shape (B, K).
        lengths: path length of each tendon at rest, m; a slack one may be given more. Shape (B, K).
        tip: where the tip will come to rest, m, base frame. Shape (B, 3). If that is not where it was asked to be, the
            arm cannot take the pose.
    """

    commands: torch.Tensor
    lengths: torch.Tensor
    tip: torch.Tensor


class InverseKinematics(nn.Module):
    """(θ_G or g_x, g_y, g_z, x, y, z, q_w, q_x, q_y, q_z) to an `Answer`: features, normalisation, three hidden layers,
    ReLU.

    SI units; gravity is told as in `inputs`; the quaternion is of unit length, of either sign. Commands stay within
    those of the training set. The tip is foreseen by layers of their own from gravity and the commands alone: they
    do not know the pose that was asked.
    """

    mean: torch.Tensor  # of the features over the training set, as is 1 / scale their standard deviation
    scale: torch.Tensor
    middle: torch.Tensor  # of the commands' range, m
    half_range: torch.Tensor
    most_stretch: torch.Tensor  # of lengths over commands, m
    tip_middle: torch.Tensor  # of the tips' range, m
    tip_half_range: torch.Tensor

    def __init__(self, width: int, inputs: np.ndarray, commands: np.ndarray, lengths: np.ndarray):
        """Args: width: of each hidden layer, half of it where the tip is foreseen; inputs (N, 7, 8 or 10), commands,
        lengths (N, K): the training set."""
        super().__init__()
        raw = features(torch.tensor(inputs, dtype=torch.float64))
        buffers = {"mean": raw.mean(dim=0), "scale": 1 / raw.std(dim=0).clamp_min(1e-6)}
        buffers["middle"], buffers["half_range"] = _range(commands)
        buffers["tip_middle"], buffers["tip_half_range"] = _range(position_of(inputs))
        buffers["most_stretch"] = torch.tensor((lengths - commands).max(axis=0))
        for name, values in buffers.items():
            self.register_buffer(name, values.to(torch.float32))
        tendons, columns = commands.shape[1], inputs.shape[1] - 7
        self.inputs = inputs.shape[1]
        self.layers = _perceptron(raw.shape[1], width, 2 * tendons)
        self.tip_layers = _perceptron((2 if columns == 1 else columns) + tendons, max(1, width // 2), 3)

    def normalise(self, inputs: torch.Tensor) -> torch.Tensor:
        return (features(inputs) - self.mean) * self.scale

    def unclipped(self, normalised: torch.Tensor) -> tuple[torch.Tensor, torch.Tensor]:
        """Commands and stretches (lengths over commands), m, not yet kept within range: what is trained."""
        commands, stretches = self.layers(normalised).chunk(2, dim=1)
        return self.middle + self.half_range * commands, self.most_stretch * stretches

    def foresee(self, pulling: torch.Tensor, pulls: torch.Tensor) -> torch.Tensor:
        """Where the tip rests, m, under the `gravity_features` (B, 0, 2 or 3) and commands as shares of their range,
        (B, K)."""
        return self.tip_middle + self.tip_half_range * self.tip_layers(torch.cat([pulling, pulls], dim=1))

    def forward(self, inputs: torch.Tensor) -> Answer:
        """From inputs (B, 7, 8 or 10)."""
        commands, stretches = self.layers(self.normalise(inputs)).chunk(2, dim=1)
        pulls = commands.clamp(-1, 1)
        commands = self.middle + self.half_range * pulls
        lengths = commands + self.most_stretch * stretches.clamp(0, 1)
        return Answer(commands, lengths, self.foresee(gravity_features(inputs), pulls))


def _perceptron(inputs: int, width: int, outputs: int) -> nn.Sequential:
    return nn.Sequential(
        nn.Linear(inputs, width), nn.ReLU(),
        nn.Linear(width, width), nn.ReLU(),
        nn.Linear(width, width), nn.ReLU(),
        nn.Linear(width, outputs),
    )  # fmt: skip


def _range(values: np.ndarray) -> tuple[torch.Tensor, torch.Tensor]:
    """Middle and half of the range of columns (N, C)."""
    low, high = values.min(axis=0), values.max(axis=0)
    return torch.tensor((low + high) / 2), torch.tensor((high - low) / 2)


def features(inputs: torch.Tensor) -> torch.Tensor:
    """Gravity, position, products of quaternion components, and of a direction of gravity with these: where gravity
    pulls as the tip sees it is linear in them. Shape (B, 13, 15 or 55) from (B, 7, 8 or 10)."""
    gravity = gravity_features(inputs)
    pose = torch.cat([inputs[:, -7:-4], inputs[:, FIRST] * inputs[:, SECOND]], dim=1)
    parts = [gravity, pose]
    if gravity.shape[1] == 3:
        parts.append((gravity[:, :, None] * pose[:, None, :]).flatten(1))
    return torch.cat(parts, dim=1)


def gravity_features(inputs: torch.Tensor) -> torch.Tensor:
    """sin θ_G, cos θ_G of inputs (B, 8), the direction of gravity of inputs (B, 10), nothing of inputs (B, 7). Shape
    (B, 2, 3 or 0)."""
    gravity = inputs[:, :-7]
    if gravity.shape[1] != 1:
        return gravity
    return torch.cat([torch.sin(gravity), torch.cos(gravity)], dim=1)
