"""Two ways to the minimum, as they are set."""

from dataclasses import dataclass
from typing import Annotated, Literal

from pydantic import Field


@dataclass
class LeastSquares:
    """Descents from the best of a few starts, by scipy's trust region (Branch, Coleman, Li 1999).

    starts: of a Latin hypercube, besides the given one; 0 to go on from that alone. descents: from how many of the best
    that are apart; at least three, which have to agree, unless `starts` is 0. iterations: of each, at most. tolerance:
    relative decrease of the loss at the end.
    """

    starts: Annotated[int, Field(ge=0, le=10000)]
    descents: Annotated[int, Field(ge=1, le=1000)]
    iterations: Annotated[int, Field(ge=1, le=10000)]
    tolerance: Annotated[float, Field(gt=0, le=1)]
    method: Literal["least_squares"] = "least_squares"

    def steps(self) -> int:
        """Iterations of all descents together, about; a search says when there are more or fewer."""
        return self.descents * self.iterations


@dataclass
class DifferentialEvolution:
    """best1bin, a whole generation per batch (Storn, Price 1997; scipy, deferred updating).

    population, population_per_parameter: candidates a generation, P parameters: the first plus P times the second.
    generations: at most. tolerance: standard deviation of the losses over their mean at the end.
    """

    population: Annotated[int, Field(ge=5, le=10000)]
    population_per_parameter: Annotated[int, Field(ge=0, le=1000)]
    generations: Annotated[int, Field(ge=1, le=100000)]
    tolerance: Annotated[float, Field(gt=0, le=1)]
    method: Literal["differential_evolution"] = "differential_evolution"

    def steps(self) -> int:
        """Generations, at most; a search says when there are fewer, and what comes after them."""
        return self.generations


Optimizer = Annotated[LeastSquares | DifferentialEvolution, Field(discriminator="method")]
