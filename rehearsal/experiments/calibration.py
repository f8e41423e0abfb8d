"""Whether stated probabilities are true: reliability, and the Brier score beside that of always saying the base rate.

    B = mean (p - y)²,    B_base = mean (ȳ - y)² = ȳ (1 - ȳ),

p the stated probability, y 1 for a success, else 0 (G. W. Brier, "Verification of forecasts expressed in terms of
probability", Monthly Weather Review 78 (1950) 1-3). A preview that says more than the base rate has the smaller B.
"""

from dataclasses import dataclass
from pathlib import Path

import numpy as np

from rehearsal.experiments.result import Result
from trunkline.ar.hybrid.rates import wilson

BINS = 5


@dataclass(frozen=True)
class Bin:
    """Runs whose stated probabilities are alike: their mean, how many they are, and the share of successes."""

    stated: float
    runs: int
    share: float
    interval: tuple[float, float]


def stated(results: list[Result]) -> tuple[np.ndarray, np.ndarray]:
    """Probabilities and outcomes of the runs that have one. Shape (n,) each."""
    probable = [result for result in results if np.isfinite(result.probability)]
    outcomes = [float(result.success) for result in probable]
    return np.array([result.probability for result in probable]), np.array(outcomes)


def brier(probability: np.ndarray, outcome: np.ndarray) -> float:
    """Of n probabilities and outcomes, 0 or 1."""
    return float(np.mean((probability - outcome) ** 2))


def base_brier(outcome: np.ndarray) -> float:
    """Of always saying the share of successes."""
    return float(np.mean(outcome) * (1 - np.mean(outcome)))


def reliability(probability: np.ndarray, outcome: np.ndarray, bins: int = BINS) -> list[Bin]:
    """Runs in `bins` equal ranges of the probability; ranges without runs are left out."""
    number = np.minimum((probability * bins).astype(int), bins - 1)
    rows = []
    for index in range(bins):
        mine = number == index
        if mine.any():
            successes, runs = int(outcome[mine].sum()), int(mine.sum())
            rows.append(Bin(float(probability[mine].mean()), runs, successes / runs, wilson(successes, runs)))
    return rows


def draw_reliability(results: list[Result], file: Path) -> None:
    """Share of successes over the stated probability, with Wilson intervals."""
    from matplotlib.figure import Figure

    probability, outcome = stated(results)
    if not len(outcome):
        return
    figure = Figure(figsize=(4.2, 4.0), layout="constrained")
    plot = figure.subplots()
    plot.plot([0, 1], [0, 1], color="0.7", lw=1)
    for row in reliability(probability, outcome):
        low, high = row.interval
        plot.errorbar(row.stated, row.share, [[row.share - low], [high - row.share]], fmt="o", capsize=4,
                      color="tab:blue")  # fmt: skip
        plot.annotate(f"{row.runs}", (row.stated, row.share), textcoords="offset points", xytext=(6, 6))
    title = (
        f"Brier score {brier(probability, outcome):.3f}, base rate {base_brier(outcome):.3f}" if len(outcome) else ""
    )
    plot.set(xlim=(-0.03, 1.03), ylim=(-0.03, 1.03), xlabel="probability that the preview stated",
             ylabel="share of successes", title=title)  # fmt: skip
    file.parent.mkdir(parents=True, exist_ok=True)
    figure.savefig(file, dpi=110)
