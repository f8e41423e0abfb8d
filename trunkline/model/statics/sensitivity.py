"""How an equilibrium answers to its tendons: derivatives of tip and path lengths, by the implicit function theorem.

At rest ∇E(q) + Jᵀ T = 0, so dq/dT = -H⁻¹ Jᵀ; the tip moves by J_tip dq and the path lengths by J dq. With capstan
friction (`trunkline/model/statics/capstan.py`) tensions are those at the motors, which press on the joints by less than
Jᵀ T, and H has its derivatives too: they are then those of tendons that go on sliding as they slid.
"""

from dataclasses import dataclass

import numpy as np

from trunkline.model.statics.capstan import factorize_for, solve_for
from trunkline.model.statics.chain import Chain
from trunkline.model.statics.energy import Pull, evaluate, find_hessian
from trunkline.model.statics.equilibria import loose_chords, plain
from trunkline.model.statics.kernel import kernel, over_rows
from trunkline.model.statics.newton import new_work
from trunkline.model.statics.vectors import cross, plus, turned, vector


@dataclass
class Sensitivity:
    """Attributes:
    tip_by_tension: m/N. Shape (B, 3, K).
    turn_by_tension: rotation vector of the tip in the base frame, rad/N. Shape (B, 3, K).
    length_by_tension: m/N, symmetric without capstan friction. Shape (B, K, K).
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
    tip, turn = np.zeros((count, 3, tendons)), np.zeros((count, 3, tendons))
    length = np.zeros((count, tendons, tendons))
    gravities = plain(gravity, (count, 3))
    loose = loose_chords(chain, gravities)
    over_rows(_sensitivities, count, chain, plain(qpos), plain(tensions), gravities, loose, tip, turn, length)
    return Sensitivity(tip, turn, length)


@kernel
def _sensitivities(first, last, chain, qpos, tensions, gravity, loose, tip, turn, length):
    for row in range(first, last):
        _sensitivity(chain, qpos[row], tensions[row], gravity[row], loose[row], tip[row], turn[row], length[row])


@kernel
def _sensitivity(chain, q, tensions, gravity, loose, tip, turn, length):
    """Fill tip (3, K), turn (3, K) and length (K, K) for one equilibrium."""
    units, tendons = chain.mass.shape[0], tensions.shape[0]
    work = new_work(units, tendons)
    state, step = work.state, work.step
    free = np.zeros(tendons)
    pull = Pull(tensions, free, free, free, np.zeros((units, 2)), chain.capstan, loose)
    evaluate(chain, q, gravity, pull, state)
    hessian = find_hessian(gravity, pull, state)
    factorize_for(hessian, pull, work)
    last = state.rotation[-1]
    arm = turned((vector(last, 0), vector(last, 1), vector(last, 2)), (chain.tip[0], chain.tip[1], chain.tip[2]))
    end = plus(vector(state.position, units - 1), 1.0, arm)
    for t in range(tendons):
        for j in range(2 * units):
            step[j] = -state.share[j // 2, t] * state.jacobian[t, j]
        solve_for(hessian, pull, work, step)
        for j in range(2 * units):
            axis = vector(state.hinge[j // 2], j % 2)
            moved = cross(axis, plus(end, -1.0, vector(state.position, j // 2)))
            for k in range(3):
                tip[k, t] += step[j] * moved[k]
                turn[k, t] += step[j] * axis[k]
            for s in range(tendons):
                length[s, t] += step[j] * state.jacobian[s, j]
