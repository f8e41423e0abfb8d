"""How an equilibrium answers to its tendons: derivatives of tip and path lengths, by the implicit function theorem.

At rest ∇E(q) + Jᵀ T = 0, so dq/dT = -H⁻¹ Jᵀ; the tip moves by J_tip dq and the path lengths by J dq.
"""

from dataclasses import dataclass

import numba
import numpy as np
from numba import njit, prange

from trunkline.statics.chain import Chain
from trunkline.statics.energy import Pull, evaluate, fill_hessian
from trunkline.statics.factor import factorize, solve
from trunkline.statics.newton import new_work
from trunkline.threads import thread_count


@dataclass
class Sensitivity:
    """Attributes:
    tip_by_tension: m/N. Shape (B, 3, K).
    turn_by_tension: rotation vector of the tip in the base frame, rad/N. Shape (B, 3, K).
    length_by_tension: m/N, symmetric. Shape (B, K, K).
    """

    tip_by_tension: np.ndarray
    turn_by_tension: np.ndarray
    length_by_tension: np.ndarray


def sensitivity(chain: Chain, qpos: np.ndarray, tensions: np.ndarray, gravity: np.ndarray) -> Sensitivity:
    """Sensitivities of stable equilibria.

    Args:
        qpos: joint angles, rad. Shape (B, nq).
        tensions: N. Shape (B, K).
        gravity: m/s². Shape (3,) or (B, 3).
    """
    count, tendons = tensions.shape
    gravity = np.ascontiguousarray(np.broadcast_to(np.asarray(gravity, float), (count, 3)))
    tip, turn = np.zeros((count, 3, tendons)), np.zeros((count, 3, tendons))
    length = np.zeros((count, tendons, tendons))
    numba.set_num_threads(min(thread_count(), numba.config.NUMBA_NUM_THREADS))
    _sensitivities(chain, np.ascontiguousarray(qpos), np.ascontiguousarray(tensions), gravity, tip, turn, length)
    return Sensitivity(tip, turn, length)


@njit(cache=True, parallel=True)
def _sensitivities(chain, qpos, tensions, gravity, tip, turn, length):
    for row in prange(len(qpos)):
        _sensitivity(chain, qpos[row], tensions[row], gravity[row], tip[row], turn[row], length[row])


@njit(cache=True)
def _sensitivity(chain, q, tensions, gravity, tip, turn, length):
    """Fill tip (3, K), turn (3, K) and length (K, K) for one equilibrium."""
    units, tendons = chain.mass.shape[0], tensions.shape[0]
    work = new_work(units, tendons)
    state = work.state
    free = np.zeros(tendons)
    pull = Pull(tensions, free, free, free)
    evaluate(chain, q, gravity, pull, state)
    fill_hessian(chain, q, gravity, pull, state)
    factorize(state.hessian, work.factor)
    rotation, end = state.rotation[-1], np.empty(3)
    for k in range(3):
        moved = rotation[k, 0] * chain.tip[0] + rotation[k, 1] * chain.tip[1] + rotation[k, 2] * chain.tip[2]
        end[k] = state.position[-1, k] + moved
    for t in range(tendons):
        step = work.columns[t]
        for j in range(2 * units):
            step[j] = -state.jacobian[t, j]
        solve(work.factor, step)
        for j in range(2 * units):
            axis, joint = state.hinge[j // 2, j % 2], state.position[j // 2]
            x, y, z = end[0] - joint[0], end[1] - joint[1], end[2] - joint[2]
            tip[0, t] += step[j] * (axis[1] * z - axis[2] * y)
            tip[1, t] += step[j] * (axis[2] * x - axis[0] * z)
            tip[2, t] += step[j] * (axis[0] * y - axis[1] * x)
            for k in range(3):
                turn[k, t] += step[j] * axis[k]
            for s in range(tendons):
                length[s, t] += step[j] * state.jacobian[s, j]
