"""The network's answer made exact: where the arm really comes to rest under its commands, and a few steps nearer to the
target.

The equilibrium under the commands is found first (`statics.equilibria.actuated`), then up to three Gauss-Newton steps
of `ik.polish` bring the tip nearer, its orientation left free. What is said of the tip afterwards is again the
equilibrium under the commands themselves, as they are sent.
"""

import numpy as np

from trunkline.frames import STANDARD_GRAVITY
from trunkline.ik.polish import polish
from trunkline.statics.chain import Chain
from trunkline.statics.equilibria import Equilibrium, actuated
from trunkline.teleop.vectors import IDENTITY, Vector

LEVER = 1e-6  # m that a turn of the tip by 1 rad counts: nothing


def corrected(chain: Chain, commands: np.ndarray, tip: Vector, gravity: Vector) -> tuple[np.ndarray, np.ndarray] | None:
    """Commands (K,), m, under which the tip rests no further from `tip` (m) than under those given, and where it
    rests (3,), m; None where the arm finds no rest. `gravity` is a unit vector; all in the soft arm's base frame.

    Tendons slide without friction: real ones stay within what it holds on either side.
    """
    chain, pull = chain.smooth, STANDARD_GRAVITY * np.array(gravity)
    found = actuated(chain, commands[None], pull)
    if not found.converged[0]:
        return None
    better = polish(chain, np.array([[*gravity, *tip, *IDENTITY]]), found.lengths, lever=LEVER)
    if better.converged[0]:
        again = actuated(chain, better.commands, pull)
        if again.converged[0] and _missed(again, tip) < _missed(found, tip):
            return better.commands[0], again.position[0]
    return commands, found.position[0]


def _missed(found: Equilibrium, tip: Vector) -> float:
    return float(np.linalg.norm(found.position[0] - tip))
