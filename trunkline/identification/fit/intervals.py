"""How sure the identified parameters are."""

from dataclasses import dataclass

import numpy as np
from scipy.special import ndtr, stdtrit

from trunkline.identification.fit.linearisation import Linearisation
from trunkline.identification.fit.surrogate import Surrogate

RESAMPLINGS = 20_000  # of which some twenty lie beyond each end of an interval of six trials
ALONE = 1e-9  # share of a parameter's information; if all other trials have less, one determines it alone


@dataclass
class Certainty:
    """95 % intervals around an estimate z, and how well its directions are determined.

    Attributes:
        standard_error: of each parameter; infinite where nothing, or one trial alone, depends on it. Shape (P,).
        half_width: of its 95 % interval. Shape (P,).
        correlation: of the estimates. Shape (P, P).
        condition: of the Jacobian with columns of unit length; 1 is ideal.
        weakest: unit vector, in scaled columns, of the direction that the data determine least. Shape (P,).
    """

    standard_error: np.ndarray
    half_width: np.ndarray
    correlation: np.ndarray
    condition: float
    weakest: np.ndarray


def certainty(linear: Linearisation, prior_deviation: float = 0.0, around: Surrogate | None = None) -> Certainty:
    """Jackknife over trials: how far the estimate moves when one is left out (CV3; MacKinnon, Nielsen, Webb 2023).

    Residuals of one trial hang together (the model is wrong in the same way from frame to frame), so a formula for
    independent ones, as in `mujoco.sysid`, promises far too much: where a handful of trials tells a mean, its
    intervals seldom hold the truth, these as often as they should (docs/results/intervals.md). The sandwich over
    trials (Liang, Zeger 1986) answers a trial's weight as if the others' curvature were all of it; a trial that weighs
    much has drawn the estimate to itself, and with a handful of trials that makes it too sure. Trials are taken as
    independent, with T - 1 degrees of freedom. What one trial alone determines has no interval.

    Args:
        linear: of the residuals, at the estimate.
        prior_deviation: standard deviation of the truth around the prior's mean, towards which the estimate is pulled
            where the trials say little; it widens the interval there.
        around: the surrogate around the estimate, by which it answers weights of the trials; `linear` if not given.
    """
    normals = linear.normals()
    trials, normal = len(normals), normals.sum(axis=0)
    left_out = (around or linear).moves(1 - np.eye(trials))
    left_out = left_out - left_out.mean(axis=0)
    covariance = left_out.T @ left_out * (trials - 1) / trials
    if linear.prior is not None:
        normal = normal + np.diag(linear.prior**2)
    if linear.prior is not None:
        scaling = _scaling(normal)
        pulled = np.linalg.pinv(normal * scaling, hermitian=True) * scaling @ np.diag(linear.prior**2)
        covariance = covariance + prior_deviation**2 * pulled @ pulled.T
    error = np.sqrt(np.diag(covariance))
    error = np.where(_set_by_one_trial(normal, normals), np.inf, error)
    safe = np.where(error > 0, error, 1.0)
    information = normal if around is None else around.normals().sum(axis=0)  # by differences that no jump decides
    singular, directions = np.linalg.eigh(information * _scaling(information))
    return Certainty(
        standard_error=error,
        half_width=error * float(stdtrit(max(trials - 1, 1), 0.975)),
        correlation=covariance / np.outer(safe, safe),
        condition=float(np.sqrt(singular[-1] / max(singular[0], 1e-300))),
        weakest=directions[:, 0],
    )


def _scaling(normal: np.ndarray) -> np.ndarray:
    """By what JᵀJ (P, P) is multiplied, element by element, for columns of unit length. Shape (P, P)."""
    scale = 1 / np.sqrt(np.maximum(np.diag(normal), 1e-300))
    return np.outer(scale, scale)


def _set_by_one_trial(normal: np.ndarray, normals: np.ndarray) -> np.ndarray:
    """Which parameters have no information in `normal` (P, P) without one of the trials' `normals` (T, P, P). (P,)."""
    least = np.min([np.diag(normal - normal_of_one) for normal_of_one in normals], axis=0)
    return least <= ALONE * np.diag(normal)


def bootstrap(linear: Linearisation, seed: int, around: Surrogate | None = None) -> np.ndarray:
    """95 % intervals of the estimate by giving trials random weights, again and again (Rubin 1981).

    It cross-checks `certainty`: it takes no symmetry for granted, and no formula for what a trial's weight does.
    scipy's `bootstrap` (BCa) draws whole trials; with a handful of them it holds the truth too seldom
    (docs/results/intervals.md). What the fits to so many weights cost with `Surrogate.moves`, and would by scipy:
    docs/measurements/speed.md.
    Draws scatter too little, by √((T - 1)/(T + 1)), and their percentiles know of no degrees of freedom. So these are
    taken further out, as Hesterberg (2015, expanded percentiles) does, where a mean of T numbers would get Student's
    interval: Φ(-√((T + 1)/(T - 1)) t). Below five trials that is further out than any draw, and too narrow.

    Args: as for `certainty`.

    Returns:
        Lowest and highest z, infinite where nothing, or one trial alone, depends on a parameter. Shape (2, P).
    """
    normals = linear.normals()
    trials = len(normals)
    weights = np.random.default_rng(seed).standard_exponential((RESAMPLINGS, trials))
    degrees = max(trials - 1, 1)
    tail = ndtr(-np.sqrt((trials + 1) / degrees) * stdtrit(degrees, 0.975))
    interval = linear.vector + np.quantile((around or linear).moves(weights), [tail, 1 - tail], axis=0)
    return np.where(_set_by_one_trial(normals.sum(axis=0), normals), [[-np.inf], [np.inf]], interval)


def weakest_in_words(names: list[str], weakest: np.ndarray) -> str:
    """The weakest direction as a sentence on the parameters that take part in it."""
    order = np.argsort(-np.abs(weakest))
    if len(names) == 1 or np.abs(weakest[order[1]]) < 0.3:
        return f"{names[order[0]]} is determined least"
    first, second = names[order[0]], names[order[1]]
    same = weakest[order[0]] * weakest[order[1]] > 0
    return f"{first} and {second} {'rise together' if same else 'trade off'}"
