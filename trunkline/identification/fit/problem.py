"""What is searched for: parameters with bounds, a model, experiments and a loss; candidates in, losses out."""

import time
from collections.abc import Sequence
from dataclasses import dataclass
from functools import partial
from typing import Annotated

import mujoco
import numpy as np
from pydantic import Field

from trunkline.identification.parameters.parameters import candidate_fields, parameter_named
from trunkline.identification.parameters.per_session import values_in
from trunkline.identification.parameters.tolerances import Perturbation
from trunkline.identification.simulate.experiment import Experiment, weights_for
from trunkline.identification.simulate.loss import LOSSES, LossWeights, loss_of
from trunkline.identification.simulate.population import Simulated
from trunkline.identification.simulate.resting import RestShape, hang_in
from trunkline.identification.simulate.simulated_sessions import Sessions
from trunkline.model.arm_model import ArmModel
from trunkline.recordings.trials.experiments import is_static

DIVERGED_LOSS = 1e3  # finite, and with sensible weights far above the loss of any arm that stays in one piece


@dataclass
class Bounds:
    """Range of a parameter in its own unit, low < high."""

    low: Annotated[float, Field(ge=-1e9, le=1e9)]
    high: Annotated[float, Field(ge=-1e9, le=1e9)]

    def __post_init__(self):
        if self.low >= self.high:
            raise ValueError(f"low: found {self.low}, expected less than high, {self.high}")


@dataclass
class Problem:
    """Minimise the mean loss over `experiments` of a model whose parameters are free within bounds.

    A candidate is a vector z: first the scalars of `parameters` (natural logarithms, but for signed ones), then, if
    `per_joint` names them, the factors of every unit, within `per_joint_range` of 1 and pulled towards it by `prior`.
    `step_factor` is how much coarser than the model's own time step to simulate. With `rest`, every candidate hangs
    in that shape.
    `trial_weights` (T,), ones if not given, are those of trials in the loss. Counts evaluations (one candidate on all
    trials), divergences and steps.
    """

    model: mujoco.MjModel
    experiments: list[Experiment]
    markers: tuple[str, ...]
    parameters: dict[str, Bounds]
    loss: str
    weights: LossWeights
    step_factor: float = 1.0
    per_joint: tuple[str, ...] = ()
    per_joint_range: float = 0.0
    prior_weight: float = 0.0
    rest: RestShape | None = None
    trial_weights: np.ndarray = None  # type: ignore[assignment]
    evaluations: int = 0
    diverged: int = 0
    steps: int = 0
    seconds: float = 0.0

    def __post_init__(self):
        if self.trial_weights is None:
            self.trial_weights = np.ones(len(self.experiments))
        self._sessions = Sessions(self.model, self.experiments, self.markers, self.step_factor)
        self._last: tuple[np.ndarray, list[np.ndarray]] | None = None  # candidate that was alone, and where it rests
        self.units = int(ArmModel(self.model).unit_of_hinge.max()) + 1

    @property
    def rubs(self) -> bool:
        """Whether cables that rub on their holes move the arm in any trial."""
        rubbing = ArmModel(self.model).capstan_friction > 0
        return rubbing and any(not is_static(e.kind) and not e.slack(self.model) for e in self.experiments)

    def fields(
        self,
        vectors: np.ndarray,
        session: str = "",
        model: mujoco.MjModel | None = None,
        changes: Sequence[Perturbation] = (),
    ) -> dict[str, np.ndarray]:
        """Model fields of candidates (C, P), of a session and the model as it was in that, or of the whole; `changes`,
        if there are any, one a candidate."""
        model = self.model if model is None else model
        scalars = len(self.parameters)
        values = {name: parameter_named(name).value(vectors[:, i]) for i, name in enumerate(self.parameters)}
        blocks = vectors[:, scalars:].reshape(len(vectors), len(self.per_joint), self.units)
        fields = candidate_fields(
            model, values_in(session, values), {name: blocks[:, i] for i, name in enumerate(self.per_joint)}
        )
        for name in sorted({name for change in changes for name in change.fields} - fields.keys()):
            if self.model.ntendon or not name.startswith("tendon_"):
                fields[name] = np.repeat(np.array(getattr(model, name))[None], len(vectors), axis=0)
        for candidate, change in enumerate(changes):
            change.write(fields, candidate, model)
        if self.rest is not None:
            hang_in(fields, model, self.rest)
        return fields

    def residuals(self, vectors: np.ndarray, near: np.ndarray | None = None, rough: bool = False) -> list[np.ndarray]:
        """Residuals per trial, weighted so that the sum of ½ r² over all of them is the loss. Each (C, R).

        Args:
            near: a candidate (P,) that is close to all of them, in whose shapes at rest theirs are looked for.
            rough: as `batch_of` has it. Never where residuals are subtracted, as for derivatives: 32-bit floats leave
                too little of such differences.
        """
        simulated = self.simulate(vectors, near, rough)
        blocks = self.compare(simulated.positions)
        for block in blocks:
            # a diverged candidate: every residual the same, and in sum the penalty
            block[simulated.diverged] = np.sqrt(2 * DIVERGED_LOSS / len(self.experiments) / block.shape[1])
        return blocks

    def simulate(
        self,
        vectors: np.ndarray,
        near: np.ndarray | None = None,
        rough: bool = False,
        changes: Sequence[Perturbation] = (),
    ) -> Simulated:
        """Candidates (C, P) in every trial. Args as `residuals`; changes: of the model, one a candidate."""
        rests = None if near is None or not any(is_static(e.kind) for e in self.experiments) else self._rests_at(near)
        begun = time.perf_counter()
        fields = partial(self.fields, vectors, changes=changes)
        simulated = self._sessions.simulate(fields, rests, rough)
        if len(vectors) == 1 and not changes:
            self._last = vectors[0].copy(), simulated.rests
        self.seconds += time.perf_counter() - begun
        self.evaluations += len(vectors)
        self.diverged += int(simulated.diverged.sum())
        self.steps += simulated.steps
        return simulated

    def compare(self, positions: list[np.ndarray]) -> list[np.ndarray]:
        """Residuals per trial, as `residuals`, of candidates that have the markers at `positions`, each (C, T, S, 3) m;
        not finite where those are not."""
        shares, blocks = np.sqrt(self.trial_weights / len(self.experiments)), []
        for places, experiment, share in zip(positions, self.experiments, shares, strict=True):
            with np.errstate(invalid="ignore", over="ignore"):
                block = LOSSES[self.loss](
                    places, experiment.positions, experiment.measured, weights_for(experiment, self.weights)
                )
            blocks.append(share * block)
        return blocks

    def _rests_at(self, vector: np.ndarray) -> list[np.ndarray]:
        """Angles at which a candidate rests, as `population.Simulated` has them."""
        if self._last is None or not np.array_equal(self._last[0], vector):
            simulated = self._sessions.simulate(partial(self.fields, vector[None]))
            self._last = vector.copy(), simulated.rests
        return self._last[1]

    def losses(self, vectors: np.ndarray, rough: bool = False) -> np.ndarray:
        """Loss of each candidate (C, P) → (C,), that of the prior included; `rough` where they are only ranked."""
        return sum(loss_of(block) for block in self.residuals(vectors, rough=rough)) + loss_of(self.prior(vectors))

    def prior(self, vectors: np.ndarray) -> np.ndarray:
        """Residuals w (f - 1) of factors, w the `prior_weight`; 0 for scalars. (C, P) → (C, P)."""
        residuals = self.prior_weight * (vectors - 1)
        residuals[:, : len(self.parameters)] = 0
        return residuals

    def bounds(self) -> tuple[np.ndarray, np.ndarray]:
        """Lowest and highest vector z."""
        low = [parameter_named(name).coordinate(b.low) for name, b in self.parameters.items()]
        high = [parameter_named(name).coordinate(b.high) for name, b in self.parameters.items()]
        joints = len(self.per_joint) * self.units
        return (
            np.array(low + [1 - self.per_joint_range] * joints),
            np.array(high + [1 + self.per_joint_range] * joints),
        )

    def start(self) -> np.ndarray:
        """The vector z of the model itself, within bounds; a parameter that it lacks (0) starts mid-range."""
        low, high = self.bounds()
        vector = np.append(0.5 * (low + high)[: len(self.parameters)], np.ones(len(self.per_joint) * self.units))
        for index, name in enumerate(self.parameters):
            value = parameter_named(name).read(self.model)
            if value > 0 or parameter_named(name).signed:
                vector[index] = parameter_named(name).coordinate(value)
        return np.clip(vector, low, high)

    def effort(self) -> dict[str, float]:
        """What a progress bar shows: evaluations so far, and the simulator's speed."""
        return {"evaluations": self.evaluations, "steps/s": self.steps / max(self.seconds, 1e-9)}
