"""Equilibria from any first guess: Newton's method at once, without following the loads from nothing.

From a neighbouring equilibrium this is many times faster than following the loads and stays on its branch. From
far away it may end in another equilibrium, if there is one: that is how others are looked for.
"""

import numpy as np

from trunkline.model.statics.chain import Chain
from trunkline.model.statics.continuation import record
from trunkline.model.statics.energy import Pull
from trunkline.model.statics.equilibria import Equilibrium, equilibria, loose_chords, penalty, plain, room
from trunkline.model.statics.kernel import kernel, over_rows
from trunkline.model.statics.newton import find_equilibrium, new_work


def restart(
    chain: Chain, qpos: np.ndarray, tensions: np.ndarray, lengths: np.ndarray, gravity: np.ndarray
) -> Equilibrium:
    """Equilibria with cables of given lengths, as `equilibria.forward`, from the joint angles `qpos`.

    Args:
        qpos: first guess, rad. Shape (B, nq).
        tensions: first guess, N, zero where nothing is known. Shape (B, K).
        lengths: m. Shape (B, K).
        gravity: m/s². Shape (3,) or (B, 3).
    """
    slope = np.full(chain.tendons, penalty(chain))
    return _from(chain, qpos, tensions, lengths, gravity, slope, np.full(chain.tendons, np.inf), True)


def actuated_from(chain: Chain, qpos: np.ndarray, commands: np.ndarray, gravity: np.ndarray) -> Equilibrium:
    """Equilibria under the model's actuators, as `equilibria.actuated`, from the joint angles `qpos`.

    Args:
        qpos: first guess, rad. Shape (B, nq).
        commands: target path lengths, m, or tensions, N. Shape (B, K).
        gravity: m/s². Shape (3,) or (B, 3).
    """
    tensions, lengths = chain.pulls(commands)
    return _from(chain, qpos, tensions, lengths, gravity, plain(chain.gain), plain(chain.max_tension), False)


def _from(
    chain: Chain, qpos: np.ndarray, tensions: np.ndarray, lengths: np.ndarray, gravity: np.ndarray,
    slope: np.ndarray, ceiling: np.ndarray, cables: bool,
) -> Equilibrium:  # fmt: skip
    """Equilibria from `qpos` with pulls in the words of `energy.Pull`."""
    count = len(qpos)
    rows, gravities = room(chain, count), plain(gravity, (count, 3))
    rows.qpos[:], rows.tensions[:] = qpos, tensions
    loose = loose_chords(chain, gravities)
    over_rows(_restart, count, chain, plain(lengths), gravities, slope, ceiling, cables, loose, rows)
    return equilibria(chain, rows)


@kernel
def _restart(first, last, chain, all_lengths, gravities, slope, ceiling, cables, all_loose, rows):
    units, tendons = chain.mass.shape[0], all_lengths.shape[1]
    torque = np.zeros((units, 2))
    for row in range(first, last):
        work = new_work(units, tendons)
        tension, loose = rows.tensions[row].copy(), all_loose[row]
        pull = Pull(tension, slope, all_lengths[row], ceiling, torque, chain.capstan, loose)
        residual, _, total, good = find_equilibrium(chain, rows.qpos[row], gravities[row], pull, cables, work)
        record(rows, row, work.state, residual, total, good)
