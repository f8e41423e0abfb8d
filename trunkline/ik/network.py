"""The inverse kinematics: a small network from gravity angle and tip pose to tendon lengths, and its training."""

from collections.abc import Callable
from dataclasses import dataclass

import numpy as np
import torch
from pydantic import NonNegativeInt, PositiveFloat, PositiveInt
from torch import nn

from trunkline.ik.tip_loss import TipLoss

INPUTS = ["theta_g", "x", "y", "z", "qw", "qx", "qy", "qz"]
# products of quaternion components: a rotation matrix is linear in them, and q and -q give the same ones
FIRST = [4, 4, 4, 4, 5, 5, 5, 6, 6, 7]
SECOND = [4, 5, 6, 7, 5, 6, 7, 6, 7, 7]
FEATURES = 2 + 3 + len(FIRST)
ROUNDING = 0.5e-3  # m, tip errors well under this count by their square, larger ones by their size
TIE = 0.02  # weight of plain length errors, which alone tie down how long a slack tendon is


class InverseKinematics(nn.Module):
    """(θ_G, x, y, z, q_w, q_x, q_y, q_z) to (l_1, …, l_K): features, normalisation, three hidden layers, ReLU.

    SI units; the quaternion is of unit length, of either sign. Outputs stay within the lengths of the training set.
    """

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


@dataclass
class Training:
    """Attributes: width: of the hidden layers; epochs; batch: samples; learning_rate: at the start, falling along a
    cosine to a thousandth; seed: of weights and shuffling."""

    width: PositiveInt
    epochs: PositiveInt
    batch: PositiveInt
    learning_rate: PositiveFloat
    seed: NonNegativeInt


def train(
    inputs: np.ndarray,
    lengths: np.ndarray,
    loss: TipLoss,
    is_train: np.ndarray,
    training: Training,
    report: Callable[[int, float, float], None],
) -> InverseKinematics:
    """Train on the samples where `is_train`, with Adam, on the tip error to first order.

    One thread: sums in another order would give other last digits, and then other networks.

    Args:
        inputs: Shape (N, 8).
        lengths: m. Shape (N, K).
        report: called with epoch, mean tip error in m of the training and of the other samples.
    """
    torch.set_num_threads(1)
    torch.manual_seed(training.seed)
    network = InverseKinematics(training.width, inputs[is_train], lengths[is_train])
    x = network.normalise(torch.tensor(inputs, dtype=torch.float32))
    y = torch.tensor(lengths, dtype=torch.float32)
    rows = torch.tensor(np.flatnonzero(is_train))
    others = torch.tensor(np.flatnonzero(~is_train))
    shuffle = torch.Generator().manual_seed(training.seed)
    optimizer = torch.optim.Adam(network.parameters(), lr=training.learning_rate, fused=True)
    batches = len(rows) // training.batch
    schedule = torch.optim.lr_scheduler.CosineAnnealingLR(
        optimizer, training.epochs * batches, training.learning_rate / 1000
    )
    for epoch in range(1, training.epochs + 1):
        total = 0.0
        order = rows[torch.randperm(len(rows), generator=shuffle)]
        for batch in order[: batches * training.batch].split(training.batch):
            delta = network.unclipped(x[batch]) - y[batch]
            moved = loss(batch, delta)
            size = (moved.square().sum(dim=1) + ROUNDING**2).sqrt()
            objective = size.mean() + TIE * delta.abs().mean()
            optimizer.zero_grad()
            objective.backward()
            optimizer.step()
            schedule.step()
            total += float(moved.detach()[:, :3].norm(dim=1).mean())
        with torch.no_grad():
            moved = [loss(b, network.unclipped(x[b]) - y[b])[:, :3] for b in others.split(8192)]
        report(epoch, total / batches, float(torch.cat(moved).norm(dim=1).mean()))
    return network.eval()
