"""A model's answers without training: a table of its equilibria stands in for the network.

A network costs a training for every model. What a plan needs of it is a first guess, which the statics then correct; so
a model that was never trained for is asked by a table of equilibria under the gravity at hand, and the row whose tip is
the nearest answers.
"""

from itertools import combinations, product

import numpy as np

from trunkline.ar.teleop.tendons import Network
from trunkline.frames import STANDARD_GRAVITY
from trunkline.kinematics.ik.inputs import DIRECTION
from trunkline.model.statics.chain import Chain
from trunkline.model.statics.equilibria import Equilibrium, equilibrium

LEVELS = 16  # tensions of each of two taut tendons, from none to the largest


def lookup(chain: Chain) -> Network:
    """Answers for targets that share gravity and tip, as `teleop.tendons` asks them: one row for all."""
    chain, solved = chain.smooth, dict[tuple[float, ...], Equilibrium]()

    def ask(targets: np.ndarray) -> dict[str, np.ndarray]:
        gravity, tip = targets[0, :3], targets[0, 3:6]
        key = tuple(np.round(gravity, 3).tolist())
        if key not in solved:
            solved[key] = equilibrium(chain, tensions_of(chain), STANDARD_GRAVITY * np.array(key))
        rows = solved[key]
        off = np.where(rows.converged, np.linalg.norm(rows.position - tip, axis=1), np.inf)
        best = int(np.argmin(off))
        answer = {"commands": rows.commands, "lengths": rows.lengths, "tip": rows.position}
        return {name: np.repeat(values[best : best + 1], len(targets), axis=0) for name, values in answer.items()}

    return Network(ask, len(DIRECTION))


def tensions_of(chain: Chain) -> np.ndarray:
    """No more than two tendons taut, N, (N, K), denser where they are small: there the arm is softest."""
    shares = np.linspace(0.0, 1.0, LEVELS) ** 2
    rows = set()
    for taut in combinations(range(chain.tendons), min(2, chain.tendons)):
        for pulled in product(shares, repeat=len(taut)):
            row = np.zeros(chain.tendons)
            row[list(taut)] = pulled
            rows.add(tuple(row.tolist()))
    return np.array(sorted(rows)) * chain.max_tension
