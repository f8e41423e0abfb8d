"""`python -m studies.intervals`: how often intervals of several makings hold the truth, where the truth is known.

A parameter is the mean of a few trials, each of which has many residuals that hang together, as those of a simulation
against a measurement do. Intervals: the library's jackknife and bootstrap over trials, scipy's bootstrap over trials
(bias-corrected and accelerated, BCa), and the formula for independent residuals, which `mujoco.sysid` uses.
"""

import numpy as np
from scipy.stats import bootstrap as scipy_bootstrap

from trunkline.identification.fit.certainty import bootstrap, certainty
from trunkline.identification.fit.linearisation import Linearisation
from upkeep.results import recorded

TRIALS, FRAMES, REPETITIONS = 6, 50, 400
SCATTER, NOISE = 1.0, 0.3  # of trials, and of frames within one


def intervals(values: np.ndarray) -> dict[str, np.ndarray]:
    """Lowest and highest mean of `values` (T, F), by the way in which the interval is made."""
    mean = values.mean()
    linear = Linearisation(np.array([mean]), [v - mean for v in values], [-np.ones((FRAMES, 1))] * TRIALS)
    half = certainty(linear).half_width[0]
    independent = 1.96 * values.std(ddof=1) / np.sqrt(values.size)
    found = scipy_bootstrap((values.mean(axis=1),), np.mean, method="BCa", n_resamples=2000, rng=1)
    return {
        "jackknife over trials": mean + half * np.array([-1, 1]),
        "bootstrap over trials": bootstrap(linear, seed=1)[:, 0],
        "scipy's BCa over trials": np.array(found.confidence_interval),
        "independent residuals": mean + independent * np.array([-1, 1]),
    }


@recorded("intervals")
def main() -> None:
    rng = np.random.default_rng(1)
    held: dict[str, list] = {}
    for _ in range(REPETITIONS):
        values = rng.normal(0, SCATTER, (TRIALS, 1)) + rng.normal(0, NOISE, (TRIALS, FRAMES))
        for name, (low, high) in intervals(values).items():
            held.setdefault(name, []).append((low <= 0 <= high, high - low))
    print(f"| {TRIALS} trials, {REPETITIONS} repetitions; asked for: 95 % | hold the truth | mean width |")
    print("|---|---:|---:|")
    for name, rows in held.items():
        inside, width = np.mean(rows, axis=0)
        print(f"| {name} | {100 * inside:.0f} % of the time | {width:.2f} |")


if __name__ == "__main__":
    main()
