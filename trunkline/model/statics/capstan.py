"""Capstan friction at rest: tensions that fall along the arm, as compiled kernels.

Where a unit bends by θ, a tendon that slides over its holes towards the motor loses tension by exp(-μ θ) to its far
side (Euler, Eytelwein). Between the holes next to joint i, half of its bend counts:

    T_i = T exp(-μ (Σ_{m<i} θ_m s_m + θ_i s_i / 2)),    s = clip(b / l, -1, 1),    b_m = Σ_{k≥m} (L_k - c_k)

with T the tension at the motor, c_k the chord across joint k, L_k what it was when nothing pulled, and so b_m the way
by which the tendon has slid at hole m; l is the chain's `slip`, within which friction builds up. That is how an arm
rests whose tendons were drawn in since it hung without pull; with -μ, one whose tendons have all just slid the other
way. Such forces have no energy: what Newton's method needs is the gradient's matrix of derivatives, which is not
symmetric, but has the same rank above its blocks as below them.
"""

from typing import NamedTuple

import numpy as np

from trunkline.model.statics.factor import factorize, solve
from trunkline.model.statics.kernel import kernel
from trunkline.model.statics.vectors import copy


class CapstanTerms(NamedTuple):
    """What friction adds to the room for one equilibrium, filled in place.

    Attributes:
        bend: θ, rad, and its slopes by the unit's two hinges. Shape (n, 3).
        side: s, and θ ds/db in rad/m; 0 where the tendon does not cross the joint. Shape (n, K, 2).
        left, right: the entry (j, k) below the blocks is left_j · right_k. Shape (3 + K, nq).
    """

    bend: np.ndarray
    side: np.ndarray
    left: np.ndarray
    right: np.ndarray


@kernel
def new_capstan_terms(units, tendons):
    """Empty room for the friction of `tendons` tendons on `units` units."""
    rank, nq = 3 + tendons, 2 * units
    return CapstanTerms(np.zeros((units, 3)), np.zeros((units, tendons, 2)), np.zeros((rank, nq)), np.zeros((rank, nq)))


@kernel
def share_tensions(chain, q, pull, state):
    """Fill `state.share`, the tension on each chord over that at the motor."""
    bend, side, share = state.rub.bend, state.rub.side, state.share
    units, tendons = share.shape
    for i in range(units):
        x, y = q[2 * i] - chain.zero[i, 0], q[2 * i + 1] - chain.zero[i, 1]
        angle = np.sqrt(x * x + y * y)
        bend[i, 0] = angle
        bend[i, 1], bend[i, 2] = (x / angle, y / angle) if angle > 0 else (0.0, 0.0)
    for t in range(tendons):
        slid = 0.0
        for i in range(units - 1, -1, -1):
            slid += (pull.loose[i, t] - state.chord[i, t]) / chain.slip
            side[i, t, 0] = min(max(slid, -1.0), 1.0) * chain.crosses[i, t]
            side[i, t, 1] = bend[i, 0] / chain.slip * chain.crosses[i, t] if abs(slid) < 1 else 0.0
        exponent = 0.0
        for i in range(units):
            half = 0.5 * pull.friction * bend[i, 0] * side[i, t, 0]
            exponent -= half
            share[i, t] = np.exp(exponent)
            exponent -= half


@kernel
def add_tendon_rows(t, slope, pull, state):
    """Fill rows 3 + t above and below the blocks with how tendon t's torques follow from all joints; `slope` (N/m) is
    how its tension does from its length."""
    rub, jacobian = state.rub, state.jacobian
    rise = pull.friction * state.tensions[t]
    begun = 0.0  # Σ θ ds/db of the units so far
    for i in range(rub.bend.shape[0]):
        half = 0.5 * rub.side[i, t, 1]
        for h in range(2):
            j = 2 * i + h
            rub.left[3 + t, j] = state.share[i, t] * jacobian[t, j]
            rub.right[3 + t, j] = jacobian[t, j] * (slope + rise * (begun + 2 * half))
            rub.right[3 + t, j] -= rise * rub.side[i, t, 0] * rub.bend[i, 1 + h]
            state.left[3 + t, j] = rub.left[3 + t, j] * (slope + rise * (begun + half))
            state.right[3 + t, j] = jacobian[t, j]
        begun += 2 * half


@kernel
def complete_derivatives(pull, state):
    """Add what friction does within each unit's block, and fill the rows of gravity below the blocks."""
    rub, block, jacobian = state.rub, state.block, state.jacobian
    for m in range(3):
        copy(state.right[m], rub.left[m])
        copy(state.left[m], rub.right[m])
    for i in range(block.shape[0]):
        block[i, 3] = block[i, 1]
        for t in range(jacobian.shape[0]):
            fall = 0.5 * pull.friction * state.tensions[t] * state.share[i, t] * rub.side[i, t, 0]
            at_a, at_b = fall * jacobian[t, 2 * i], fall * jacobian[t, 2 * i + 1]
            block[i, 0] -= at_a * rub.bend[i, 1]
            block[i, 1] -= at_a * rub.bend[i, 2]
            block[i, 2] -= at_b * rub.bend[i, 2]
            block[i, 3] -= at_b * rub.bend[i, 1]


@kernel
def eliminate(hessian, below, factor):
    """Factor the derivatives into L U, U with ones on its diagonal; False where a leading minor is not positive.

    The steps are those of `factor.factorize`: U_jk = row_j · right_k above the blocks, L_jk = left_j · column_k, with
    the left of `below`, under them.
    """
    right, row, column, total, pivot = hessian.right, factor.row, factor.column, factor.total, factor.block
    lower, rank = below.left, hessian.right.shape[0]
    for m in range(rank):
        for k in range(rank):
            total[m, k] = 0.0
    for i in range(hessian.block.shape[0]):
        a, b = 2 * i, 2 * i + 1
        aa, ab, bb, ba = hessian.block[i, 0], hessian.block[i, 1], hessian.block[i, 2], hessian.block[i, 3]
        for m in range(rank):
            to_a, to_b, from_a, from_b = 0.0, 0.0, 0.0, 0.0
            for k in range(rank):
                to_a += total[m, k] * right[k, a]
                to_b += total[m, k] * right[k, b]
                from_a += lower[k, a] * total[k, m]
                from_b += lower[k, b] * total[k, m]
            aa -= lower[m, a] * to_a
            ab -= lower[m, a] * to_b
            ba -= lower[m, b] * to_a
            bb -= lower[m, b] * to_b
            column[m, a], column[m, b] = below.right[m, a] - to_a, below.right[m, b] - to_b
            row[m, a], row[m, b] = hessian.left[m, a] - from_a, hessian.left[m, b] - from_b
        determinant = aa * bb - ab * ba
        if not (aa > 0 and determinant > 0):
            return False
        pivot[i, 0], pivot[i, 1], pivot[i, 2], pivot[i, 3] = aa, ab, bb, ba
        for m in range(rank):
            at_a, at_b = row[m, a], row[m, b]
            row[m, a] = (bb * at_a - ab * at_b) / determinant
            row[m, b] = (aa * at_b - ba * at_a) / determinant
        for m in range(rank):
            for k in range(rank):
                total[m, k] += column[m, a] * row[k, a] + column[m, b] * row[k, b]
    return True


@kernel
def solve_eliminated(hessian, below, factor, x):
    """Solve for x in place, shape (nq,), with the factors of `eliminate`."""
    right, lower, row, column, pivot = hessian.right, below.left, factor.row, factor.column, factor.block
    rank, units = right.shape[0], hessian.block.shape[0]
    sums = np.zeros(rank)
    for i in range(units):
        a, b = 2 * i, 2 * i + 1
        at_a, at_b = x[a], x[b]
        for m in range(rank):
            at_a -= lower[m, a] * sums[m]
            at_b -= lower[m, b] * sums[m]
        aa, ab, bb, ba = pivot[i, 0], pivot[i, 1], pivot[i, 2], pivot[i, 3]
        determinant = aa * bb - ab * ba
        x[a] = (bb * at_a - ab * at_b) / determinant
        x[b] = (aa * at_b - ba * at_a) / determinant
        for m in range(rank):
            sums[m] += column[m, a] * x[a] + column[m, b] * x[b]
    for m in range(rank):
        sums[m] = 0.0
    for i in range(units - 1, -1, -1):
        a, b = 2 * i, 2 * i + 1
        for m in range(rank):
            x[a] -= row[m, a] * sums[m]
            x[b] -= row[m, b] * sums[m]
        for m in range(rank):
            sums[m] += right[m, a] * x[a] + right[m, b] * x[b]


@kernel
def factorize_for(hessian, pull, work):
    """Factor the derivatives, those below the blocks too if `pull` rubs; False where the arm is not stable."""
    if pull.friction != 0:
        return eliminate(hessian, work.state.rub, work.factor)
    return factorize(hessian, work.factor)


@kernel
def solve_for(hessian, pull, work, x):
    """Solve for x in place, shape (nq,), with what `factorize_for` left in `work`."""
    if pull.friction != 0:
        solve_eliminated(hessian, work.state.rub, work.factor, x)
    else:
        solve(hessian, work.factor, x)
