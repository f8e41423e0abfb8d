"""The inverse kinematics: a small network from gravity angle and tip pose to tendon lengths."""

import numpy as np
import torch
from torch import nn

INPUTS = ["theta_g", "x", "y", "z", "qw", "qx", "qy", "qz"]
# products of quaternion components: a rotation matrix is linear in them, and q and -q give the same ones
FIRST = [4, 4, 4, 4, 5, 5, 5, 6, 6, 7]
SECOND = [4, 5, 6, 7, 5, 6, 7, 6, 7, 7]
FEATURES = 2 + 3 + len(FIRST)


class InverseKinematics(nn.Module):
    """(θ_G, x, y, z, q_w, q_x, q_y, q_z) to (l_1, …, l_K): features, normalisation, three hidden layers, ReLU.

    SI units; the quaternion is of unit length, of either sign. Outputs stay within the lengths of the training set.
    """

    mean: torch.Tensor  # of the features over the training set, as is 1 / scale their standard deviation
    scale: torch.Tensor
    middle: torch.Tensor  # of the lengths' range, m
    half_range: torch.Tensor

    def __init__(self, width: int, inputs: np.ndarray, lengths: np.ndarray):
        """Args: width: of each hidden layer; inputs (N, 8), lengths (N, K): the training set, for normalisation."""
        super().__init__()
        raw = features(torch.tensor(inputs, dtype=torch.float64))
        low, high = lengths.min(axis=0), lengths.max(axis=0)
        for name, values in (
            ("mean", raw.mean(dim=0)),
            ("scale", 1 / raw.std(dim=0).clamp_min(1e-6)),
            ("middle", torch.tensor((low + high) / 2)),
            ("half_range", torch.tensor((high - low) / 2)),
        ):
            self.register_buffer(name, values.to(torch.float32))
        self.layers = nn.Sequential(
            nn.Linear(FEATURES, width), nn.ReLU(),
            nn.Linear(width, width), nn.ReLU(),
            nn.Linear(width, width), nn.ReLU(),
            nn.Linear(width, lengths.shape[1]),
        )  # fmt: skip

    def normalise(self, inputs: torch.Tensor) -> torch.Tensor:
        return (features(inputs) - self.mean) * self.scale

    def unclipped(self, normalised: torch.Tensor) -> torch.Tensor:
        """Lengths in m from normalised features, not yet kept within range: what is trained."""
        return self.middle + self.half_range * self.layers(normalised)

    def forward(self, inputs: torch.Tensor) -> torch.Tensor:
        """Lengths, m, shape (B, K), from inputs (B, 8)."""
        return self.middle + self.half_range * self.layers(self.normalise(inputs)).clamp(-1, 1)


def features(inputs: torch.Tensor) -> torch.Tensor:
    """sin θ_G, cos θ_G, position, products of quaternion components. Shape (B, 15) from (B, 8)."""
    angle = inputs[:, :1]
    products = inputs[:, FIRST] * inputs[:, SECOND]
    return torch.cat([torch.sin(angle), torch.cos(angle), inputs[:, 1:4], products], dim=1)
