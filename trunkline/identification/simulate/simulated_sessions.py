"""Trials of several sessions: each simulated with the arm as it was in its own."""

from collections.abc import Callable

import mujoco
import numpy as np

from trunkline.identification.parameters.parameter import Fields
from trunkline.identification.parameters.per_session import model_in
from trunkline.identification.simulate.experiment import Experiment
from trunkline.identification.simulate.population import Population, Simulated


class Sessions:
    """A `Population` for each session of the experiments; arguments as there."""

    def __init__(
        self, model: mujoco.MjModel, experiments: list[Experiment], markers: tuple[str, ...], step_factor: float = 1.0
    ):
        self._parts = []
        for session in dict.fromkeys(e.session for e in experiments):
            places = [i for i, e in enumerate(experiments) if e.session == session]
            arm = model_in(session, model)
            population = Population(arm, [experiments[i] for i in places], markers, step_factor)
            self._parts.append((session, arm, places, population))

    def simulate(
        self,
        fields: Callable[[str, mujoco.MjModel], Fields],
        rests: list[np.ndarray] | None = None,
        rough: bool = False,
    ) -> Simulated:
        """As `Population.simulate`. Args: fields: of the candidates, for a session and its model."""
        results = {}
        for session, model, places, population in self._parts:
            near = None if rests is None else [rests[i] for i in places]
            results[session] = population.simulate(fields(session, model), near, rough)
        if len(results) == 1:
            return next(iter(results.values()))
        trials = {
            place: (result.positions[i], result.rests[i])
            for (_, _, places, _), result in zip(self._parts, results.values(), strict=True)
            for i, place in enumerate(places)
        }
        order = [trials[place] for place in sorted(trials)]
        diverged = np.logical_or.reduce([result.diverged for result in results.values()])
        steps = sum(result.steps for result in results.values())
        return Simulated([places for places, _ in order], diverged, steps, [rest for _, rest in order])
