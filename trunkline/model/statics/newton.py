"""Newton's method for one equilibrium, as compiled kernels."""

from typing import NamedTuple

import numpy as np

from trunkline.model.statics.cables import update_multipliers
from trunkline.model.statics.capstan import factorize_for, solve_for
from trunkline.model.statics.energy import evaluate, find_hessian, is_elastic
from trunkline.model.statics.factor import Factor, new_factor
from trunkline.model.statics.kernel import kernel
from trunkline.model.statics.placement import ChainState, new_state
from trunkline.model.statics.vectors import largest

TORQUE_TOLERANCE = 1e-9  # N m; the softest joint of the arm, 0.02 N m/rad, turns by 5e-8 rad under it
LENGTH_TOLERANCE = 1e-9  # m
MAX_ITERATIONS = 60
MAX_STEP = 0.5  # rad, of any joint in one Newton step: about a joint's whole range
SHIFT = 3e-5  # N m/rad, first addition to the diagonal of a Hessian that is not positive definite
LARGEST_SHIFT = 1e7  # N m/rad


class Work(NamedTuple):
    """Scratch of one thread. Shapes: step, trial (nq,), columns (K, nq), schur (K, K), rates (K,)."""

    state: ChainState
    factor: Factor
    step: np.ndarray
    trial: np.ndarray
    columns: np.ndarray
    schur: np.ndarray
    rates: np.ndarray


@kernel
def new_work(units, tendons):
    """Scratch for a chain of `units` units and `tendons` tendons."""
    nq = 2 * units
    return Work(
        new_state(units, tendons),
        new_factor(units, 3 + tendons),
        np.zeros(nq),
        np.zeros(nq),
        np.zeros((tendons, nq)),
        np.zeros((tendons, tendons)),
        np.zeros(tendons),
    )


@kernel
def _factorize_shifted(hessian, pull, work):
    """Factor the Hessian, its diagonal raised until it is positive definite; True if it was so as given."""
    if factorize_for(hessian, pull, work):
        return True
    shift = SHIFT
    while shift < LARGEST_SHIFT:
        for i in range(hessian.block.shape[0]):
            hessian.block[i, 0] += shift
            hessian.block[i, 2] += shift
        if factorize_for(hessian, pull, work):
            break
        shift *= 4
    return False


@kernel
def find_equilibrium(chain, q, gravity, pull, cables, work):
    """Newton with line search from `q`, which it overwrites. Returns (residual, stretch, iterations, converged).

    With `cables`, `pull.length` are lengths that no tendon can exceed and `pull.tension` their multipliers, which
    it updates. `converged` is true only of a stable equilibrium: the Hessian is positive definite (with cables, the
    Hessian and the penalty: the directions that the cables leave free).

    Residual: largest joint torque out of balance, N m. Stretch: largest error in length of a taut cable, m.
    """
    state, nq = work.state, q.shape[0]
    energy = evaluate(chain, q, gravity, pull, state)
    residual, stretch = _imbalance(state, pull, cables)
    for iteration in range(MAX_ITERATIONS):
        hessian = find_hessian(gravity, pull, state)
        stable = _factorize_shifted(hessian, pull, work)
        if residual <= TORQUE_TOLERANCE and stretch <= LENGTH_TOLERANCE:
            return residual, stretch, iteration, stable
        for j in range(nq):
            work.step[j] = -state.gradient[j]
        solve_for(hessian, pull, work, work.step)
        if cables:
            energy = update_multipliers(chain, q, gravity, pull, hessian, work)
        energy, moved = _line_search(chain, q, gravity, pull, work, energy)
        residual, stretch = _imbalance(state, pull, cables)
        if not moved:
            break
    return residual, stretch, MAX_ITERATIONS, False


@kernel
def _imbalance(state, pull, cables):
    """Largest torque out of balance (N m) and, with cables, largest |l - L| of a taut one (m)."""
    stretch = 0.0
    if cables:
        for t in range(pull.tension.shape[0]):
            if is_elastic(state, pull, t):
                stretch = max(stretch, abs(state.lengths[t] - pull.length[t]))
    return largest(state.gradient), stretch


@kernel
def _line_search(chain, q, gravity, pull, work, energy):
    """Backtrack along work.step from q, overwriting it; return the energy there and whether a step was found."""
    state, nq = work.state, q.shape[0]
    gradient = state.gradient
    slope = np.dot(gradient, work.step)
    if pull.friction != 0:
        slope = -np.dot(gradient, gradient)  # of ½|∇E|² along the step
    longest = largest(work.step)
    share = min(1.0, MAX_STEP / longest) if longest > 0 else 1.0
    rounding = 0.0 if pull.friction != 0 else 1e-13 * max(1.0, abs(energy))
    for _ in range(40):
        for j in range(nq):
            work.trial[j] = q[j] + share * work.step[j]
        new = evaluate(chain, work.trial, gravity, pull, state)
        if new <= energy + 1e-4 * share * slope + rounding:
            for j in range(nq):
                q[j] = work.trial[j]
            return new, True
        share *= 0.5
    return evaluate(chain, q, gravity, pull, state), False
