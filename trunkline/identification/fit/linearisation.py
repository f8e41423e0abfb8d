"""The residuals around a candidate, to first order."""

from dataclasses import dataclass

import numpy as np

from trunkline.identification.fit.problem import Problem
from trunkline.identification.parameters.parameters import parameter_named

DIFFERENCE = 1e-3  # step of a one-sided difference: in ln(value), in a factor, or in a signed value
# the same in ln(value) where cables rub: the arm sticks, slips and snaps, and so moves by jumps as a value changes;
# with a smaller one, starts end at other losses, with this at the same
RUBBING_DIFFERENCE = 0.03


@dataclass
class Linearisation:
    """Residuals (R,) and their derivatives (R, P) per trial, around a vector, and the weights (P,) of a prior."""

    vector: np.ndarray
    residuals: list[np.ndarray]
    jacobians: list[np.ndarray]
    prior: np.ndarray | None = None

    def normals(self) -> np.ndarray:
        """JᵀJ of every trial. Shape (T, P, P)."""
        return np.stack([j.T @ j for j in self.jacobians])

    def moves(self, weights: np.ndarray) -> np.ndarray:
        """By how much the minimum moves when trials weigh `weights` (B, T) in place of 1, to first order. (B, P)."""
        normals = self.normals()
        scores = np.stack([j.T @ r for j, r in zip(self.jacobians, self.residuals, strict=True)])
        scores = scores - scores.mean(axis=0)  # they sum to nothing, but for a search that stopped early
        prior = np.zeros_like(normals[0]) if self.prior is None else np.diag(self.prior**2)
        scale = 1 / np.sqrt(np.maximum(np.diag(normals.sum(axis=0) + prior), 1e-300))
        scaling = np.outer(scale, scale)
        weighted = (np.einsum("bt,tpq->bpq", weights, normals) + prior) * scaling
        return -np.einsum("bpq,bq->bp", np.linalg.pinv(weighted, hermitian=True) * scaling, weights @ scores)

    def answers(self, changes: list[np.ndarray]) -> np.ndarray:
        """By how much the minimum moves when every trial's residuals change by columns (R, C), to first order: the
        sensitivity -(Σ JᵀJ + prior)⁻¹ Σ JᵀJ_c of consider parameters (Bierman 1977, VIII). Shape (C, P)."""
        normal = self.normals().sum(axis=0) + (0 if self.prior is None else np.diag(self.prior**2))
        scale = 1 / np.sqrt(np.maximum(np.diag(normal), 1e-300))
        scores = np.sum([columns.T @ j for j, columns in zip(self.jacobians, changes, strict=True)], axis=0)
        return -scores @ (np.linalg.pinv(normal * np.outer(scale, scale), hermitian=True) * np.outer(scale, scale))


def linearise(problem: Problem, vector: np.ndarray, residuals: list[np.ndarray] | None = None) -> Linearisation:
    """Derivatives of all residuals by differences towards the inside of the bounds, all columns in one batch.

    Args:
        residuals: those at `vector`, where they are known. Per trial (R,).
    """
    high = problem.bounds()[1]
    sizes = np.full(len(vector), DIFFERENCE)
    if problem.rubs:
        sizes[[i for i, name in enumerate(problem.parameters) if not parameter_named(name).signed]] = RUBBING_DIFFERENCE
    steps = np.where(vector + sizes > high, -sizes, sizes)
    candidates = vector + np.diag(steps)
    if residuals is None:
        residuals = [block[0] for block in problem.residuals(vector[None])]
    blocks = problem.residuals(candidates, near=vector)  # by 64-bit floats: 32 leave too little of a difference
    columns = [((moved - base) / steps[:, None]).T for moved, base in zip(blocks, residuals, strict=True)]
    weights = problem.prior(np.full((1, len(vector)), 2.0))[0]  # of f - 1 = 1
    return Linearisation(vector, residuals, columns, weights if weights.any() else None)
