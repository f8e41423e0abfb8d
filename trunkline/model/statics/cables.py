"""Cables of given lengths in Newton's method: their multipliers, which are their tensions, as compiled kernels."""

import numpy as np

from trunkline.model.statics.capstan import solve_for
from trunkline.model.statics.energy import evaluate, is_elastic
from trunkline.model.statics.kernel import kernel


@kernel
def _cable_columns(pull, hessian, work):
    """Fill work.columns with H⁻¹ J_tᵀ (with friction, H⁻¹ on the torques of 1 N at the motor) and work.schur with
    J H⁻¹ Jᵀ for the taut tendons; zero the others."""
    tendons, nq = work.columns.shape
    state = work.state
    for t in range(tendons):
        taut = is_elastic(state, pull, t)
        for j in range(nq):
            work.columns[t, j] = state.share[j // 2, t] * state.jacobian[t, j] if taut else 0.0
        if taut:
            solve_for(hessian, pull, work, work.columns[t])
    for t in range(tendons):
        for s in range(tendons):
            total = 0.0
            if is_elastic(state, pull, s) and is_elastic(state, pull, t):
                for j in range(nq):
                    total += state.jacobian[s, j] * work.columns[t, j]
            elif s == t:
                total = 1.0
            if s == t:  # three cables of a straight arm depend on each other
                total += 1e-7 / pull.slope[t]
            work.schur[s, t] = total


@kernel
def solve_small(matrix, x):
    """Solve matrix x' = x in place by elimination with pivoting; `matrix` is overwritten.

    For its speed at 3 unknowns (docs/measurements/kinematics.md); and np.linalg.solve would end a whole
    batch with an error where one matrix is singular.
    """
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


@kernel
def update_multipliers(chain, q, gravity, pull, hessian, work):
    """Turn the augmented Lagrangian's step s = -H⁻¹∇ in work.step into that of the constrained problem.

    W dq + Jᵀ λ' = -∇E and J dq = -c on the taut cables, with c = l - L, W = H - ρ JᵀJ and μ = λ' - λ, is
    μ = (J H⁻¹ Jᵀ)⁻¹ (J s + c) and dq = s - H⁻¹ Jᵀ μ. This dq descends on the augmented Lagrangian with multipliers
    λ' (slope -dqᵀ H dq); only where a cable falls slack can it fail to, and then that function's own step is taken.

    Returns the energy at q with the new multipliers; the state is evaluated there.
    """
    state, tendons, nq = work.state, pull.tension.shape[0], q.shape[0]
    _cable_columns(pull, hessian, work)
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
        solve_for(hessian, pull, work, work.step)
    return energy
