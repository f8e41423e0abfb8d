"""The residuals around a minimum to second order, so that trials can be fitted again without simulating.

Of many parameters it is the first order alone: the second asks for too many candidates, and hours of small fits.

First order does not do: a wrong model leaves residuals, and their own curvature then counts beside JᵀJ. Nor do small
differences: simulated curls move by small jumps as a parameter changes, where joint limits close. Where cables rub, the
jumps are larger: there it is a least-squares fit to more candidates than it has coefficients, a central composite
design (Box, Wilson 1951), and what of the second order may be jumps alone is taken out (James, Stein 1961).
"""

from dataclasses import dataclass
from itertools import product

import numpy as np

from trunkline.identification.fit.problem import Problem
from trunkline.identification.parameters.parameters import parameter_named

WHOLE_CUBE, HALF_CUBE = 4, 7  # parameters, up to which a design has all corners of their cube, or half of them
FEW = 12  # parameters, up to which the second order is taken along
REACH = 0.2  # of the differences, in ln(value): about as far as intervals reach, far beyond the jumps
SIGNED_REACH = 0.02  # the same of signed values
ITERATIONS = 40
DAMPING, DAMPING_CHANGE = 1e-3, 5.0  # of steps, with columns of unit length
LEAST_DAMPING, MOST_DAMPING = 1e-9, 1e6
LONGEST = 3.0  # of a move, along each axis: nothing is known out there, nor of what no trial depends on
ALONE = 1e-9  # share of a parameter's information: with less, trials do not tell it
LEAST_COLUMN = 1e-12  # of the largest: what is shorter is taken for rounding
LEAST_CHANGE = 1e-12  # of the squared residuals, by a parameter that they depend on; less is rounding
SETTLED = 1e-12  # relative decrease of the loss


@dataclass
class Surrogate:
    """Losses of T trials as ½ φᵀ G_t φ, with φ = (1, d_1 … d_P, d_i d_j for i ≤ j) at d from the estimate, without
    the products where it is not of second order.

    grams: G, the residuals' coefficients times themselves: no loss is ever negative. Shape (T, F, F).
    weights: of the trials in the fit that it is around; ones if not given. Not in the grams. Shape (T,).
    """

    grams: np.ndarray
    weights: np.ndarray = None  # type: ignore[assignment]
    second: bool = True

    def __post_init__(self):
        if self.weights is None:
            self.weights = np.ones(len(self.grams))

    @property
    def count(self) -> int:
        """P, from F = (P + 1)(P + 2) / 2, or P + 1."""
        if not self.second:
            return self.grams.shape[1] - 1
        return round(np.sqrt(2 * self.grams.shape[1] + 0.25) - 1.5)

    def normals(self) -> np.ndarray:
        """JᵀJ of every trial, as `Linearisation.normals`. Shape (T, P, P)."""
        return self.weights[:, None, None] * self.grams[:, 1 : self.count + 1, 1 : self.count + 1]

    def moves(self, weights: np.ndarray) -> np.ndarray:
        """By how much the minimum moves when trials weigh `weights` (B, T) times what they do. Shape (B, P)."""
        return self.minima(weights * self.weights) - self.minima(self.weights[None])

    def losses(self, places: np.ndarray) -> np.ndarray:
        """Of every trial, unweighted, at places d (B, P). Shape (B, T)."""
        return np.stack([_losses(gram[None], places, self.second) for gram in self.grams], axis=1)

    def moved(self, place: np.ndarray, weights: np.ndarray) -> "Surrogate":
        """The same losses as seen from `place` (P,), of a fit in which trials weigh `weights` (T,)."""
        places = _stencil(np.ones(self.count), self.second)
        # φ(place + d) = φ(d) @ shift
        shift = np.linalg.inv(features_at(places, self.second)) @ features_at(place + places, self.second)
        return Surrogate(shift @ self.grams @ shift.T, weights, self.second)

    def determines(self, weights: np.ndarray) -> np.ndarray:
        """Which parameters trials that weigh `weights` (T,) say anything about. Shape (P,)."""
        lengths = [np.diag(np.einsum("t,tfg->fg", w, self.grams))[1 : self.count + 1] for w in (weights, self.weights)]
        return lengths[0] > ALONE * lengths[1]

    def minima(self, weights: np.ndarray) -> np.ndarray:
        """Where the loss is least. Damped Newton steps from d = 0, for all weights (B, T) at once. Shape (B, P).

        A bootstrap asks for thousands of these small fits: scipy's trust-exact takes them one by one, to the same
        answers. How many times as long: docs/measurements/speed.md.
        """
        grams = np.einsum("bt,tfg->bfg", weights, self.grams)
        squares = np.diag(self.grams.sum(axis=0))[1 : self.count + 1]
        scale = np.sqrt(np.maximum(squares, max(LEAST_COLUMN**2 * squares.max(), 1e-300)))
        place, damping = np.zeros((len(weights), self.count)), np.full(len(weights), DAMPING)
        loss, settled = _losses(grams, place, self.second), np.zeros(len(weights), dtype=bool)
        for _ in range(ITERATIONS):
            slopes = slopes_at(place, self.second)
            images = (grams @ features_at(place, self.second)[..., None])[..., 0]
            gradient = np.einsum("bf,bfp->bp", images, slopes) / scale
            curvature = slopes.transpose(0, 2, 1) @ grams @ slopes
            if self.second:
                curvature += bends_of(images, self.count)
            damped = curvature / np.outer(scale, scale) + damping[:, None, None] * np.eye(self.count)
            tried = place - np.linalg.solve(damped, gradient[..., None])[..., 0] / scale
            tried = np.clip(tried, -LONGEST, LONGEST)
            losses = _losses(grams, tried, self.second)
            better = losses < loss
            settled |= (better & (loss - losses <= SETTLED * loss)) | (damping > MOST_DAMPING)
            place, loss = np.where(better[:, None], tried, place), np.where(better, losses, loss)
            damping = np.where(better, np.maximum(damping / DAMPING_CHANGE, LEAST_DAMPING), damping * DAMPING_CHANGE)
            if settled.all():
                break
        return place


def surrogate(
    problem: Problem, vector: np.ndarray, residuals: list[np.ndarray] | None = None, second: bool = True
) -> Surrogate:
    """Of the scalars `vector` (P,) of `problem`, from (P + 1)(P + 2) / 2 candidates, 2 P² + 1 where cables rub, or
    P + 1 where P is large or the first order does.

    Args:
        residuals: those at `vector`, where they are known. Per trial (R,).
        second: whether the second order is asked for.
    """
    second &= len(vector) <= FEW
    reach = reaches(problem)
    places = _composite(reach) if second and problem.rubs else _stencil(reach, second)
    if residuals is None:
        residuals = [block[0] for block in problem.residuals(vector[None])]
    others = problem.residuals(vector + places[1:], near=vector)
    blocks = [np.concatenate([base[None], block]) for base, block in zip(residuals, others, strict=True)]
    grams = _fitted(features_at(places, second), np.stack([block @ block.T for block in blocks]), len(vector))
    return Surrogate(grams / problem.trial_weights[:, None, None], problem.trial_weights, second)


def _fitted(features: np.ndarray, products: np.ndarray, count: int) -> np.ndarray:
    """Grams (T, F, F) of the coefficients that explain best, at places with `features` (N, F), residuals of which
    `products` (T, N, N) are the inner products. What is left over are jumps; coefficients of second order are shrunk by
    as much as jumps lengthen them (James, Stein 1961, the positive part). `count`: parameters, P."""
    solve = np.linalg.pinv(features)
    grams = solve @ products @ solve.T
    spare = features.shape[0] - features.shape[1]
    if spare:
        left = np.trace(products, axis1=1, axis2=2) - np.sum((features.T @ products) * solve, axis=(1, 2))
        jumps = left.sum() / spare * np.square(solve).sum(axis=1)
        shares = np.clip(1 - jumps / np.maximum(np.diag(grams.sum(axis=0)), 1e-300), 0, 1)
        shares[: count + 1] = 1
        slopes = slopes_at(np.ones((1, count)))[0]
        shares[slopes[:, _without_effect(products, count)].any(axis=1)] = 0  # of all features that contain one of them
        grams = grams * np.outer(shares, shares)
    return grams


def _without_effect(products: np.ndarray, count: int) -> np.ndarray:
    """Which of P = `count` parameters leave the residuals as they are at both ends of their axis, of inner products
    (T, N, N) at the places of `_composite`. Shape (P,)."""
    total = products.sum(axis=0)
    axes = np.arange(1, 2 * count + 1)
    changes = total[axes, axes] - 2 * total[0, axes] + total[0, 0]
    return (changes <= LEAST_CHANGE * total[0, 0]).reshape(2, count).all(axis=0)


def reaches(problem: Problem) -> np.ndarray:
    """How far from its centre a surrogate of `problem` is made, along each axis. Shape (P,)."""
    return np.array([SIGNED_REACH if parameter_named(name).signed else REACH for name in problem.parameters])


def _stencil(reach: np.ndarray, second: bool) -> np.ndarray:
    """As many places as there are features, of which the features are independent, for reaches (P,). Shape (F, P)."""
    steps = np.diag(reach)
    if not second:
        return np.concatenate([np.zeros((1, len(reach))), steps])
    rows, columns = np.tril_indices(len(reach), -1)
    return np.concatenate([np.zeros((1, len(reach))), steps, -steps, steps[rows] + steps[columns]])


def _composite(reach: np.ndarray) -> np.ndarray:
    """A central composite design for reaches (P,): the centre, both ends of every axis, and corners √2 as far. Up to
    four parameters all corners of the cube; up to seven the half of them whose last sign is the product of the others
    (of resolution V and more: no two products are alike); of more, which would be too many, all four corners of every
    two. Shape (N, P)."""
    count, steps = len(reach), np.diag(reach)
    if count > HALF_CUBE:
        first, second = steps[np.tril_indices(count, -1)[0]], steps[np.tril_indices(count, -1)[1]]
        corners = np.concatenate([first + second, first - second, second - first, -first - second])
    else:
        free = count if count <= WHOLE_CUBE else count - 1
        signs = np.array(list(product((1.0, -1.0), repeat=free)))
        if free < count:
            signs = np.column_stack([signs, signs.prod(axis=1)])
        corners = signs * reach * np.sqrt(2 / count)
    return np.concatenate([np.zeros((1, count)), steps, -steps, corners])


def _losses(grams: np.ndarray, places: np.ndarray, second: bool) -> np.ndarray:
    values = features_at(places, second)
    return 0.5 * np.einsum("bf,bf->b", values, (grams @ values[..., None])[..., 0])


def features_at(places: np.ndarray, second: bool = True) -> np.ndarray:
    """φ at places d (B, P). Shape (B, F)."""
    if not second:
        return np.concatenate([np.ones((len(places), 1)), places], axis=1)
    rows, columns = np.triu_indices(places.shape[1])
    return np.concatenate([np.ones((len(places), 1)), places, places[:, rows] * places[:, columns]], axis=1)


def slopes_at(places: np.ndarray, second: bool = True) -> np.ndarray:
    """Derivatives of φ at places d (B, P). Shape (B, F, P)."""
    count = places.shape[1]
    if not second:
        return np.tile(np.eye(count + 1)[:, 1:], (len(places), 1, 1))
    rows, columns = np.triu_indices(count)
    slopes = np.zeros((len(places), 1 + count + len(rows), count))
    slopes[:, range(1, count + 1), range(count)] = 1
    products = count + 1 + np.arange(len(rows))
    slopes[:, products, rows] += places[:, columns]
    slopes[:, products, columns] += places[:, rows]
    return slopes


def bends_of(images: np.ndarray, count: int) -> np.ndarray:
    """Σ y_f ∂²φ_f of `images` y (B, F). Shape (B, P, P)."""
    rows, columns = np.triu_indices(count)
    bends = np.zeros((len(images), count, count))
    bends[:, rows, columns] = images[:, count + 1 :]
    return bends + bends.transpose(0, 2, 1)
