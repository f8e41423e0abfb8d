"""Errors in command as errors of the tip pose, to first order: what the network is trained on.

Taut tendons A and slack ones S of an equilibrium, with P = ∂(tip pose)/∂T and C = ∂c/∂T; a pose has D = 6
components, position in m and turn in rad times a lever in m. Commands δ too long change the
tensions of A by C_AA⁻¹ δ_A and the tip by M δ with M_A = P_A C_AA⁻¹. A slack tendon s follows with C_sA C_AA⁻¹ δ_A;
only if its own δ_s is less than that does it pull, by r = a·δ > 0, and move the tip by v r more, with
v = -(P_s - M_A C_As) / (C_ss - C_sA C_AA⁻¹ C_As). So a slack tendon costs nothing when it is given too much length.

A command is c = l - T / kp, so C = ∂l/∂T - 1/kp on its diagonal. With C = ∂l/∂T it is the same for path lengths.
"""

from dataclasses import dataclass

import numpy as np
import torch

TAUT = 1e-6  # N, tension above which a tendon is taut
MAX_PUSH = 30.0  # m/m, most that v is trusted: near the straight arm it grows without bound, the tip's motion does not


@dataclass
class TipLoss:
    """N samples, K tendons.

    Attributes:
        direct: M. Shape (N, D, K), zero for slack tendons.
        excess: a, a row a slack tendon. Shape (N, K, K), zero for taut ones.
        push: v, a column a slack tendon. Shape (N, D, K).
    """

    direct: torch.Tensor
    excess: torch.Tensor
    push: torch.Tensor

    def to(self, device: torch.device) -> "TipLoss":
        return TipLoss(self.direct.to(device), self.excess.to(device), self.push.to(device))

    def __getitem__(self, rows: torch.Tensor | slice) -> "TipLoss":
        """Of these samples alone."""
        return TipLoss(self.direct[rows], self.excess[rows], self.push[rows])

    def __call__(self, delta: torch.Tensor) -> torch.Tensor:
        """Change of pose, m, of the samples for commands that are `delta` (N, K) m too long. Shape (N, D)."""
        longer = delta[:, :, None]
        shortage = torch.relu(self.excess @ longer)
        return (self.direct @ longer + self.push @ shortage)[:, :, 0]


def tip_loss(tensions: np.ndarray, pose_by_tension: np.ndarray, command_by_tension: np.ndarray) -> TipLoss:
    """Set up the loss.

    Args:
        tensions: N. Shape (N, K).
        pose_by_tension: m/N. Shape (N, D, K).
        command_by_tension: m/N. Shape (N, K, K).
    """
    (count, tendons), size = tensions.shape, pose_by_tension.shape[1]
    direct, push = np.zeros((count, size, tendons)), np.zeros((count, size, tendons))
    excess = np.zeros((count, tendons, tendons))
    patterns, pattern_of = np.unique(tensions > TAUT, axis=0, return_inverse=True)
    for index, taut in enumerate(patterns):
        rows = np.flatnonzero(pattern_of.reshape(-1) == index)
        a, s = np.flatnonzero(taut), np.flatnonzero(~taut)
        p, c = pose_by_tension[rows], command_by_tension[rows]
        inverse = np.linalg.inv(c[:, a[:, None], a])
        follow = c[:, s[:, None], a] @ inverse  # (n, S, A)
        direct[rows[:, None], :, a] = (p[:, :, a] @ inverse).transpose(0, 2, 1)
        for k, slack in enumerate(s):
            excess[rows, slack, slack] = -1
            excess[rows[:, None], slack, a] = follow[:, k]
            stiff = c[:, slack, slack] - np.einsum("na,na->n", follow[:, k], c[:, a, slack])
            reach = p[:, :, slack] - np.einsum("nka,na->nk", p[:, :, a] @ inverse, c[:, a, slack])
            v = -reach / np.minimum(stiff, -1e-12)[:, None]
            length = np.linalg.norm(v, axis=1, keepdims=True)
            push[rows, :, slack] = v * np.minimum(1, MAX_PUSH / np.maximum(length, 1e-12))
    return TipLoss(*(torch.tensor(x, dtype=torch.float32) for x in (direct, excess, push)))
