"""`python -m benchmarks.surrogate`: fits of a surrogate to weighed trials, all at once and one by one with scipy."""

import time

import numpy as np
from scipy.optimize import minimize

from trunkline.identification.fit.surrogate import Surrogate, bends_of, features_at, slopes_at
from upkeep.results import recorded

TRIALS, PARAMETERS, RESIDUALS, FITS, ONE_BY_ONE = 11, 4, 200, 20_000, 100


@recorded("surrogate")
def main() -> None:
    rng = np.random.default_rng(1)
    features = features_at(np.zeros((1, PARAMETERS))).shape[1]
    size = np.concatenate([[0.3], np.ones(PARAMETERS), np.full(features - 1 - PARAMETERS, 0.2)])
    coefficients = rng.normal(size=(TRIALS, features, RESIDUALS)) * size[:, None]
    surrogate = Surrogate(coefficients @ coefficients.transpose(0, 2, 1))
    weights = rng.standard_exponential((FITS, TRIALS))

    begun = time.process_time()
    together = surrogate.moves(weights) - surrogate.moves(np.zeros((1, TRIALS)) + 1)
    own = (time.process_time() - begun) / FITS

    def fit(weight: np.ndarray) -> np.ndarray:
        gram = np.einsum("t,tfg->fg", weight, surrogate.grams)

        def loss(place):
            phi = features_at(place[None])[0]
            return 0.5 * phi @ gram @ phi

        def gradient(place):
            return slopes_at(place[None])[0].T @ gram @ features_at(place[None])[0]

        def curvature(place):
            slopes = slopes_at(place[None])[0]
            return slopes.T @ gram @ slopes + bends_of((gram @ features_at(place[None])[0])[None], PARAMETERS)[0]

        return minimize(loss, np.zeros(PARAMETERS), jac=gradient, hess=curvature, method="trust-exact", tol=1e-9).x

    start = fit(np.ones(TRIALS))
    begun = time.process_time()
    singly = np.array([fit(weight) for weight in weights[:ONE_BY_ONE]]) - start
    scipy = (time.process_time() - begun) / ONE_BY_ONE
    furthest = np.abs(together[:ONE_BY_ONE] - singly).max()
    print(f"all at once: {1e6 * own:.0f} µs a fit")
    print(f"scipy's trust-exact, one by one: {1e6 * scipy:.0f} µs a fit, {scipy / own:.0f} times as long")
    print(f"largest difference between the two: {furthest:.1e}")


if __name__ == "__main__":
    main()
