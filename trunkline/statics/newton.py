"""Newton's method for one equilibrium, and continuation from a state that is known, as compiled kernels."""

from typing import NamedTuple

import numpy as np
from numba import njit

from trunkline.statics.energy import Pull, evaluate, fill_hessian, is_elastic, new_state
from trunkline.statics.factor import factorize, solve

TORQUE_TOLERANCE = 1e-9  # N m; the softest joint of the arm, 0.02 N m/rad, turns by 5e-8 rad under it
LENGTH_TOLERANCE = 1e-9  # m
MAX_ITERATIONS = 60
MAX_STEP = 0.5  # rad, of any joint in one Newton step: about a joint's whole range
BRANCH_STEP = 1.0  # rad: a corrector that moves a joint further than its whole range has left the branch
MIN_SHARE = 1 / 4096  # smallest step of the continuation, as a share of the load


class Work(NamedTuple):
    """Scratch of one thread. Shapes: factor (nq, nq), step, trial (nq,), columns (K, nq), schur (K, K), rates (K,)."""

    state: object
    factor: np.ndarray
    step: np.ndarray
    trial: np.ndarray
    columns: np.ndarray
    schur: np.ndarray
    rates: np.ndarray


@njit(cache=True)
def new_work(units, tendons):
    """Scratch for a chain of `units` units and `tendons` tendons."""
    nq = 2 * units
    return Work(
        new_state(units, tendons),
        np.zeros((nq, nq)),
        np.zeros(nq),
        np.zeros(nq),
        np.zeros((tendons, nq)),
        np.zeros((tendons, tendons)),
        np.zeros(tendons),
    )


@njit(cache=True)
def _factorize_shifted(hessian, factor):
    """Factor the Hessian, shifted until it is positive definite; True if it was so unshifted."""
    if factorize(hessian, factor):
        return True
    n = hessian.shape[0]
    shift = 1e-3
    while shift < 1e9:
        shift *= 4
        for j in range(n):
            hessian[j, j] += 0.75 * shift * 1e-2
        if factorize(hessian, factor):
            break
    return False


@njit(cache=True)
def cable_columns(work, pull, cables):
    """Fill work.columns with H⁻¹ J_tᵀ and work.schur with J H⁻¹ Jᵀ for the taut tendons; zero the others."""
    tendons, nq = work.columns.shape
    state = work.state
    for t in range(tendons):
        taut = cables and is_elastic(state, pull, t)
        for j in range(nq):
            work.columns[t, j] = state.jacobian[t, j] if taut else 0.0
        if taut:
            solve(work.factor, work.columns[t])
    for t in range(tendons):
        for s in range(tendons):
            total = 0.0
            if cables and is_elastic(state, pull, s) and is_elastic(state, pull, t):
                for j in range(nq):
                    total += state.jacobian[s, j] * work.columns[t, j]
            elif s == t:
                total = 1.0
            if s == t and cables:  # three cables of a straight arm depend on each other
                total += 1e-7 / pull.slope[t]
            work.schur[s, t] = total


@njit(cache=True)
def solve_small(matrix, x):
    """Solve matrix x' = x in place by elimination with pivoting; `matrix` is overwritten."""
    n = x.shape[0]
    for k in range(n):
        best = k
        for i in range(k + 1, n):
            if abs(matrix[i, k]) > abs(matrix[best, k]):
                best = i
        for j in range(n):
            matrix[k, j], matrix[best, j] = matrix[best, j], matrix[k, j]
        x[k], x[best] = x[best], x[k]
        for i in range(k + 1, n):
            f = matrix[i, k] / matrix[k, k]
            for j in range(k, n):
                matrix[i, j] -= f * matrix[k, j]
            x[i] -= f * x[k]
    for i in range(n - 1, -1, -1):
        for j in range(i + 1, n):
            x[i] -= matrix[i, j] * x[j]
        x[i] /= matrix[i, i]


@njit(cache=True)
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
        fill_hessian(chain, q, gravity, pull, state)
        stable = _factorize_shifted(state.hessian, work.factor)
        if residual <= TORQUE_TOLERANCE and stretch <= LENGTH_TOLERANCE:
            return residual, stretch, iteration, stable
        for j in range(nq):
            work.step[j] = -state.gradient[j]
        solve(work.factor, work.step)
        if cables:
            energy = _update_multipliers(chain, q, gravity, pull, work)
        energy, moved = _line_search(chain, q, gravity, pull, work, energy)
        residual, stretch = _imbalance(state, pull, cables)
        if not moved:
            break
    return residual, stretch, MAX_ITERATIONS, False


@njit(cache=True)
def _imbalance(state, pull, cables):
    """Largest torque out of balance (N m) and, with cables, largest |l - L| of a taut one (m)."""
    stretch = 0.0
    if cables:
        for t in range(pull.tension.shape[0]):
            if is_elastic(state, pull, t):
                stretch = max(stretch, abs(state.lengths[t] - pull.length[t]))
    return np.max(np.abs(state.gradient)), stretch


@njit(cache=True)
def _update_multipliers(chain, q, gravity, pull, work):
    """Turn the augmented Lagrangian's step s = -H⁻¹∇ in work.step into that of the constrained problem.

    W dq + Jᵀ λ' = -∇E and J dq = -c on the taut cables, with c = l - L, W = H - ρ JᵀJ and μ = λ' - λ, is
    μ = (J H⁻¹ Jᵀ)⁻¹ (J s + c) and dq = s - H⁻¹ Jᵀ μ. This dq descends on the augmented Lagrangian with multipliers
    λ' (slope -dqᵀ H dq); only where a cable falls slack can it fail to, and then that function's own step is taken.

    Returns the energy at q with the new multipliers; the state is evaluated there.
    """
    state, tendons, nq = work.state, pull.tension.shape[0], q.shape[0]
    cable_columns(work, pull, True)
    for t in range(tendons):
        work.rates[t] = 0.0
        if is_elastic(state, pull, t):
            work.rates[t] = state.lengths[t] - pull.length[t]
            for j in range(nq):
                work.rates[t] += state.jacobian[t, j] * work.step[j]
    solve_small(work.schur, work.rates)
    for t in range(tendons):
        taut = is_elastic(state, pull, t)
        pull.tension[t] = max(0.0, pull.tension[t] + work.rates[t]) if taut else 0.0
        for j in range(nq):
            work.step[j] -= work.columns[t, j] * work.rates[t]
    energy = evaluate(chain, q, gravity, pull, state)
    if not np.dot(state.gradient, work.step) < 0:
        for j in range(nq):
            work.step[j] = -state.gradient[j]
        solve(work.factor, work.step)
    return energy


@njit(cache=True)
def _line_search(chain, q, gravity, pull, work, energy):
    """Backtrack along work.step from q, overwriting it; return the energy there and whether a step was found."""
    state, nq = work.state, q.shape[0]
    slope = np.dot(state.gradient, work.step)
    largest = np.max(np.abs(work.step))
    share = min(1.0, MAX_STEP / largest) if largest > 0 else 1.0
    rounding = 1e-13 * max(1.0, abs(energy))
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


@njit(cache=True)
def follow(chain, q, start_gravity, gravity, start, pull, cables, work):
    """Move the loads from (start_gravity, start) to (gravity, pull) in straight lines, the equilibrium with them.

    The step is halved whenever Newton fails or leaves the branch, and doubled when it does not. `q` goes from the
    equilibrium at the first loads to that at the last, `pull.tension` of cables to their tensions.

    Returns (residual, iterations, converged, snapped): snapped where the branch ended (a fold) and the arm jumped.
    """
    tendons = pull.tension.shape[0]
    now = Pull(start.tension.copy(), pull.slope, start.length.copy(), pull.ceiling)
    begin, known = now.tension.copy(), q.copy()
    loads = start_gravity.copy()
    done, share, total, snapped, residual = 0.0, 1.0, 0, False, 0.0
    while done < 1:
        share = min(share, 1 - done)
        target = 1.0 if share >= 1 - done else done + share
        for k in range(3):
            loads[k] = start_gravity[k] + target * (gravity[k] - start_gravity[k])
        for t in range(tendons):
            begin[t] = now.tension[t]
            if not cables:
                now.tension[t] = start.tension[t] + target * (pull.tension[t] - start.tension[t])
            now.length[t] = start.length[t] + target * (pull.length[t] - start.length[t])
        residual, stretch, iterations, converged = find_equilibrium(chain, q, loads, now, cables, work)
        total += iterations
        moved = np.max(np.abs(q - known))
        if not converged or moved > BRANCH_STEP:
            if share > MIN_SHARE:
                q[:] = known
                now.tension[:] = begin
                share *= 0.5 if converged else 0.25
                continue
            if not converged:
                return residual, total, False, snapped
            snapped = True
        known[:] = q
        done = target
        share *= 2
    if cables:
        pull.tension[:] = now.tension
    return residual, total, True, snapped
