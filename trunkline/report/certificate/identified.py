"""What the trials left open of the parameters, as one distribution: intervals and correlations of all stages."""

from dataclasses import dataclass

import numpy as np
from scipy.special import stdtrit

from trunkline.identification.parameters.parameters import parameter_named


@dataclass
class Identified:
    """P parameters z on the axes on which they are searched, logarithms of those that are never 0 or less.

    names, stages: of each. estimate: (P,). deviation: standard uncertainty. Shape (P,). degrees: of freedom. Shape
    (P,). correlation: within a stage; stages count as independent, as intervals are given what earlier ones found.
    Shape (P, P). low, high: ends of the range that was searched. Each (P,).
    """

    names: list[str]
    stages: list[str]
    estimate: np.ndarray
    deviation: np.ndarray
    degrees: np.ndarray
    correlation: np.ndarray
    low: np.ndarray
    high: np.ndarray

    def values(self, z: np.ndarray) -> dict[str, np.ndarray]:
        """By name, from z of shape (D, P), no further out than the range."""
        clipped = np.clip(z, self.low, self.high)
        return {name: parameter_named(name).value(clipped[:, i]) for i, name in enumerate(self.names)}

    def draw(self, count: int, rng: np.random.Generator) -> np.ndarray:
        """Of the multivariate t distribution (JCGM 101, 6.4.9; JCGM 102, 5.3.2), shape (count, P). Its scale matrix is
        the covariance by the standard uncertainties, one χ² for all parameters of a stage."""
        values, vectors = np.linalg.eigh(self.correlation)
        root = vectors * np.sqrt(np.maximum(values, 0))
        normal = rng.standard_normal((count, len(self.names))) @ root.T
        for stage, degrees in dict(zip(self.stages, self.degrees, strict=True)).items():
            members = [i for i, other in enumerate(self.stages) if other == stage]
            normal[:, members] *= np.sqrt(degrees / rng.chisquare(degrees, (count, 1)))
        return self.estimate + normal * self.deviation


def identified(tables: dict[str, dict]) -> Identified:
    """What the stages' `parameters.json` say, in their order: of what several identify, the last one's.

    Args:
        tables: by stage, as `parameter_table` gives it, with `fitted_to`.
    """
    last = {name: stage for stage, table in tables.items() for name in table["parameters"]}
    rows = [(name, stage, tables[stage]) for name, stage in last.items()]
    names, stages = [row[0] for row in rows], [row[1] for row in rows]
    degrees = np.array([max(len(table["fitted_to"]) - 1, 1) for _, _, table in rows], float)
    z, half, low, high = [], [], [], []
    for name, _, table in rows:
        row, axis = table["parameters"][name], parameter_named(name).coordinate
        interval, searched = axis(row["interval_95_given_model"]), axis(row["range"])
        z.append(float(axis(row["value"])))
        half.append(float(np.max(np.abs(interval - z[-1]))))  # the longer side, as the range may cut the other
        low.append(float(searched[0]))
        high.append(float(searched[1]))
    correlation = np.eye(len(names))
    for i, (a, stage, table) in enumerate(rows):
        for j, (b, other, _) in enumerate(rows):
            if i != j and stage == other:
                correlation[i, j] = table["correlation"][a][b]
    deviation = np.array(half) / stdtrit(degrees, 0.975)
    return Identified(names, stages, np.array(z), deviation, degrees, correlation, np.array(low), np.array(high))
