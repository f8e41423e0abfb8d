"""What the trials left open of an arm's parameters, as one distribution: intervals and correlations of all stages.

On the axis z on which it was searched, the logarithm of a parameter that is never 0 or less and a multiple of a signed
one, the parameters of a stage have a multivariate t distribution (JCGM 101, 6.4.9; JCGM 102, 5.3.2)

    z = ẑ + u √(ν / χ²_ν) R^½ n,    n normal,

with the ν = T - 1 degrees of freedom of the T trials that the stage was fitted to, one χ² for all of its parameters.
Stages are independent, as intervals are given what earlier ones found. A table states ẑ ± U with U = t_ν(0.975) u, so
u = U / t_ν(0.975): what JCGM 101, 6.4.9.7, assigns to an estimate whose expanded uncertainty is stated.

An interval is symmetric on that axis until the range that was searched cuts it (`parameter_table`), so U is the longer
of its sides. The distribution is cut alike: what is drawn beyond the range counts as at its end. So the 95 % interval
of what is drawn is the stated one.
"""

from dataclasses import dataclass

import numpy as np
from scipy.special import stdtrit

from trunkline.errors import InputError
from trunkline.identification.parameters.parameters import parameter_name, parameter_named
from trunkline.identification.stages import last_stages

INTERVAL = "interval_95_given_model"
Seed = np.random.Generator | int


@dataclass(frozen=True)
class Posterior:
    """P parameters z on the axes on which they are searched.

    names, stages: of each. estimate: (P,). deviation: standard uncertainty. Shape (P,). degrees: of freedom. Shape
    (P,). correlation: of the estimates, 0 between stages. Shape (P, P). low, high: ends of the range that was searched,
    in the parameters' units. Each (P,).
    """

    names: list[str]
    stages: list[str]
    estimate: np.ndarray
    deviation: np.ndarray
    degrees: np.ndarray
    correlation: np.ndarray
    low: np.ndarray
    high: np.ndarray

    @classmethod
    def from_tables(cls, tables: dict[str, dict]) -> "Posterior":
        """What the stages' `parameters.json` have, in their order: of what several identify, the last one's.

        Args:
            tables: by stage, as `parameter_table` gives them, with `fitted_to`.

        Raises:
            InputError: naming what a table lacks, a parameter that is unknown, or one whose interval is none.
        """
        last = last_stages(tables, "parameters")
        names, stages = list(last), list(last.values())
        rows, correlation = np.zeros((len(names), 5)), np.eye(len(names))
        for i, (name, stage) in enumerate(last.items()):
            try:
                rows[i] = _row(tables[stage], name)
                for j, other in enumerate(stages):
                    if i != j and stage == other:
                        correlation[i, j] = tables[stage]["correlation"][name][names[j]]
            except KeyError as error:
                way_out = "expected it: make artifacts and packages of an earlier release anew"
                raise InputError(f"{stage}/parameters.json: {name}: found no {error}, {way_out}") from error
            except (TypeError, ValueError) as error:
                complaint = f"found {error}, expected what a stage of identification writes"
                raise InputError(f"{stage}/parameters.json: {name}: {complaint}") from error
        estimate, half, degrees, low, high = rows.T
        return cls(names, stages, estimate, half / stdtrit(degrees, 0.975), degrees, correlation, low, high)

    @property
    def covariance(self) -> np.ndarray:
        """Scale matrix of the t distributions. Shape (P, P)."""
        return self.correlation * np.outer(self.deviation, self.deviation)

    @property
    def half_width(self) -> np.ndarray:
        """Of the 95 % intervals before the range cuts them, on the axes. Shape (P,)."""
        return stdtrit(self.degrees, 0.975) * self.deviation

    def value(self, name: str) -> float:
        """What was identified, in the parameter's unit."""
        return float(parameter_named(name).value(self.estimate[self.names.index(name)]))

    @np.errstate(over="ignore")  # far draws of a few degrees of freedom, which the range cuts
    def values(self, z: np.ndarray) -> dict[str, np.ndarray]:
        """By name, in the parameters' units, from z of shape (D, P), no further out than the range."""
        return {
            name: np.clip(parameter_named(name).value(z[:, i]), self.low[i], self.high[i])
            for i, name in enumerate(self.names)
        }

    def sample(self, count: int, rng: Seed) -> dict[str, np.ndarray]:
        """Values of `count` arms that may be the identified one, by parameter. Each (count,)."""
        rng = np.random.default_rng(rng)
        values, vectors = np.linalg.eigh(self.correlation)
        root = vectors * np.sqrt(np.maximum(values, 0))
        z = rng.standard_normal((count, len(self.names))) @ root.T
        for stage, degrees in dict(zip(self.stages, self.degrees, strict=True)).items():
            members = [i for i, other in enumerate(self.stages) if other == stage]
            z[:, members] *= np.sqrt(degrees / rng.chisquare(degrees, (count, 1)))
        return self.values(self.estimate + z * self.deviation)

    def interval(self, name: str, level: float = 0.95) -> tuple[float, float]:
        """Ends of what holds a share `level` of the draws, as much on both sides, in the parameter's unit."""
        i = self.names.index(name)
        half = stdtrit(self.degrees[i], 0.5 + level / 2) * self.deviation[i]
        ends = parameter_named(name).value(self.estimate[i] + half * np.array([-1, 1]))
        low, high = np.clip(ends, self.low[i], self.high[i]).tolist()
        return low, high


def _row(table: dict, name: str) -> tuple[float, ...]:
    """Estimate, half width of the 95 % interval, degrees of freedom, and both ends of the range."""
    try:
        parameter_name(name)
    except ValueError as error:
        raise InputError(f"parameters: {error}") from error
    row, parameter = table["parameters"][name], parameter_named(name)
    low, high = row[INTERVAL]
    if low is None or high is None or not low <= high or (low <= 0 and not parameter.signed):
        raise InputError(f"parameters.{name}.{INTERVAL}: found {row[INTERVAL]}, expected two numbers that rise")
    z, (least, most) = float(parameter.coordinate(row["value"])), row["range"]
    half = float(np.max(np.abs(parameter.coordinate([low, high]) - z)))
    return z, half, max(len(table["fitted_to"]) - 1, 1), least, most
