"""The inverse kinematics: a small network from gravity angle and tip pose to the commands of the motors."""

from typing import NamedTuple

import numpy as np
import torch
from torch import nn

INPUTS = ["theta_g", "x", "y", "z", "qw", "qx", "qy", "qz"]
OUTPUTS = ("commands", "lengths", "tip")
# products of quaternion components: a rotation matrix is linear in them, and q and -q give the same ones
FIRST = [4, 4, 4, 4, 5, 5, 5, 6, 6, 7]
SECOND = [4, 5, 6, 7, 5, 6, 7, 6, 7, 7]
FEATURES = 2 + 3 + len(FIRST)


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
    """(θ_G, x, y, z, q_w, q_x, q_y, q_z) to an `Answer`: features, normalisation, three hidden layers, ReLU.

    SI units; the quaternion is of unit length, of either sign. Commands stay within those of the training set. The tip
    is foreseen by layers of half the width from θ_G and the commands alone: they do not know the pose that was asked.
    """

    mean: torch.Tensor  # of the features over the training set, as is 1 / scale their standard deviation
    scale: torch.Tensor
    middle: torch.Tensor  # of the commands' range, m
    half_range: torch.Tensor
    most_stretch: torch.Tensor  # of lengths over commands, m
    tip_middle: torch.Tensor  # of the tips' range, m
    tip_half_range: torch.Tensor

    def __init__(self, width: int, inputs: np.ndarray, commands: np.ndarray, lengths: np.ndarray):
        """Args: width: of each hidden layer; inputs (N, 8), commands, lengths (N, K): the training set."""
        super().__init__()
        raw = features(torch.tensor(inputs, dtype=torch.float64))
        buffers = {"mean": raw.mean(dim=0), "scale": 1 / raw.std(dim=0).clamp_min(1e-6)}
        buffers["middle"], buffers["half_range"] = _range(commands)
        buffers["tip_middle"], buffers["tip_half_range"] = _range(inputs[:, 1:4])
        buffers["most_stretch"] = torch.tensor((lengths - commands).max(axis=0))
        for name, values in buffers.items():
            self.register_buffer(name, values.to(torch.float32))
        tendons = commands.shape[1]
        self.layers = nn.Sequential(
            nn.Linear(FEATURES, width), nn.ReLU(),
            nn.Linear(width, width), nn.ReLU(),
            nn.Linear(width, width), nn.ReLU(),
            nn.Linear(width, 2 * tendons),
        )  # fmt: skip
        self.tip_layers = nn.Sequential(
            nn.Linear(2 + tendons, width // 2), nn.ReLU(),
            nn.Linear(width // 2, width // 2), nn.ReLU(),
            nn.Linear(width // 2, width // 2), nn.ReLU(),
            nn.Linear(width // 2, 3),
        )  # fmt: skip

    def normalise(self, inputs: torch.Tensor) -> torch.Tensor:
        return (features(inputs) - self.mean) * self.scale

    def unclipped(self, normalised: torch.Tensor) -> tuple[torch.Tensor, torch.Tensor]:
        """Commands and stretches (lengths over commands), m, not yet kept within range: what is trained."""
        commands, stretches = self.layers(normalised).chunk(2, dim=1)
        return self.middle + self.half_range * commands, self.most_stretch * stretches

    def foresee(self, angle: torch.Tensor, pulls: torch.Tensor) -> torch.Tensor:
        """Where the tip rests, m, at gravity angles (B, 1), rad, under commands as shares of their range, (B, K)."""
        seen = torch.cat([torch.sin(angle), torch.cos(angle), pulls], dim=1)
        return self.tip_middle + self.tip_half_range * self.tip_layers(seen)

    def forward(self, inputs: torch.Tensor) -> Answer:
        """From inputs (B, 8)."""
        commands, stretches = self.layers(self.normalise(inputs)).chunk(2, dim=1)
        pulls = commands.clamp(-1, 1)
        commands = self.middle + self.half_range * pulls
        lengths = commands + self.most_stretch * stretches.clamp(0, 1)
        return Answer(commands, lengths, self.foresee(inputs[:, :1], pulls))


def _range(values: np.ndarray) -> tuple[torch.Tensor, torch.Tensor]:
    """Middle and half of the range of columns (N, C)."""
    low, high = values.min(axis=0), values.max(axis=0)
    return torch.tensor((low + high) / 2), torch.tensor((high - low) / 2)


def features(inputs: torch.Tensor) -> torch.Tensor:
    """sin θ_G, cos θ_G, position, products of quaternion components. Shape (B, 15) from (B, 8)."""
    angle = inputs[:, :1]
    products = inputs[:, FIRST] * inputs[:, SECOND]
    return torch.cat([torch.sin(angle), torch.cos(angle), inputs[:, 1:4], products], dim=1)
