"""Potential energy of a chain at rest, with its exact gradient and Hessian, as compiled kernels.

    E(q) = Σ_j U_j(q_j) + Σ_i R_i(q_2i, q_2i+1) + Σ_j P_j(q_j) - Σ_i m_i g·x_i(q) + Σ_t Φ_t(l_t(q))

U: elastic joints and constant torques, R: what round ones have beside, P: joint limits, x_i: centres of mass, l_t:
tendon path lengths. A tendon's energy has the tension Φ' = clip(λ + ρ (l - L), 0, F): a fixed tension (ρ = 0, never
clipped; a motor that is commanded by force), a position actuator (λ = 0, ρ = kp, L its command) and the augmented
Lagrangian of a cable of length L (ρ a penalty) are all of this form.
"""

from typing import NamedTuple

import numpy as np

from trunkline.model.statics.capstan import add_tendon_rows, complete_derivatives, share_tensions
from trunkline.model.statics.factor import Hessian
from trunkline.model.statics.kernel import kernel
from trunkline.model.statics.limits import limit_energy, limit_torque
from trunkline.model.statics.placement import place
from trunkline.model.statics.vectors import cross, dot, plus, turned, vector


class Pull(NamedTuple):
    """How the tendons pull, and constant torques at the joints: none, or dry friction where its band is sought.

    Units N, N/m, m, N, N m, 1, m. Shapes (K,), torque (n, 2), friction (), loose (n, K), not read without friction.
    """

    tension: np.ndarray  # λ
    slope: np.ndarray  # ρ
    length: np.ndarray  # L
    ceiling: np.ndarray  # F
    torque: np.ndarray
    friction: float  # μ of capstan friction
    loose: np.ndarray  # chords where nothing pulls


@kernel
def pull_tensions(state, pull):
    """Fill `state.tensions`; return the tendons' energy Σ Φ, J."""
    energy = 0.0
    for t in range(pull.tension.shape[0]):
        stretch, base, slope = state.lengths[t] - pull.length[t], pull.tension[t], pull.slope[t]
        tension = base + slope * stretch
        if slope == 0:
            energy += base * state.lengths[t]
        elif tension <= 0:
            tension = 0.0
            energy += -0.5 * base * base / slope
        elif tension >= pull.ceiling[t]:
            tension = pull.ceiling[t]
            energy += tension * (stretch - (tension - base) / slope) + 0.5 * (tension * tension - base * base) / slope
        else:
            energy += 0.5 * (tension * tension - base * base) / slope
        state.tensions[t] = tension
    return energy


@kernel
def evaluate(chain, q, gravity, pull, state):
    """Fill `state`, all but the room for the Hessian; return the energy E(q), J: what Newton's method makes small.
    With capstan friction, which has no energy, that is half the squared gradient, (N m)².

    Args:
        q: joint angles, rad. Shape (nq,).
        gravity: in the base frame, m/s². Shape (3,).
        pull: how the tendons pull, a `Pull`.
    """
    place(chain, q, state)
    energy = pull_tensions(state, pull)
    rubbing = pull.friction != 0
    if rubbing:
        share_tensions(chain, q, pull, state)
    rest, stiffness, limit, extra = chain.rest, chain.stiffness, chain.limit, pull.torque
    tensions, jacobian, gradient = state.tensions, state.jacobian, state.gradient
    for j in range(q.shape[0]):
        i, h = j // 2, j % 2
        x = q[j] - rest[i, h]
        a, b, c = stiffness[i, h, 0], stiffness[i, h, 1], stiffness[i, h, 2]
        energy += x * (x * (a / 2 + x * (b / 3 + x * c / 4)) - extra[i, h])
        torque = x * (a + x * (b + x * c)) - extra[i, h]
        state.stiffness[j] = a + x * (2 * b + 3 * x * c)
        if not limit[i, h, 0] <= q[j] <= limit[i, h, 1]:
            stored, push, slope = _limit(chain, i, h, q[j])
            energy += stored
            torque += push
            state.stiffness[j] += slope
        for t in range(tensions.shape[0]):
            torque += tensions[t] * state.share[i, t] * jacobian[t, j]
        gradient[j] = torque
    energy += _add_diagonals(chain, q, state)
    energy += _add_gravity(chain, gravity, state)
    return 0.5 * np.dot(gradient, gradient) if rubbing else energy


@kernel
def _limit(chain, i, h, angle):
    """Energy, J, torque, N m, and slope, N m/rad, of limit h of unit i at an angle beyond it."""
    low, high = chain.limit[i, h, 0], chain.limit[i, h, 1]
    depth = max(low - angle, angle - high)
    push, slope = limit_torque(chain.limit_gain[i, h], chain.limit_impedance[i, h], depth)
    return limit_energy(chain, i, h, depth), push if angle > high else -push, slope


@kernel
def _add_diagonals(chain, q, state):
    """Add the torques of round joints' diagonals, of springs and limits, to the gradient, and how they change; return
    their energy, J."""
    energy, diagonal, slack, limit, gradient = 0.0, chain.diagonal, chain.slack, chain.limit, state.gradient
    for i in range(diagonal.shape[0]):
        state.coupling[i] = 0.0
        for d in range(2):
            sign = 1 - 2 * d
            length = q[2 * i] + sign * q[2 * i + 1]
            x = length - slack[i, d]
            rate = diagonal[i, d] * x * x
            energy += 0.25 * rate * x * x
            torque, slope = rate * x, 3 * rate
            if not limit[i, 2 + d, 0] <= length <= limit[i, 2 + d, 1]:
                stored, push, stiffness = _limit(chain, i, 2 + d, length)
                energy += stored
                torque += push
                slope += stiffness
            gradient[2 * i] += torque
            gradient[2 * i + 1] += sign * torque
            state.stiffness[2 * i] += slope
            state.stiffness[2 * i + 1] += slope
            state.coupling[i] += sign * slope
    return energy


@kernel
def _add_gravity(chain, gravity, state):
    """Add gravity's torques -g·(axis x moment) to the gradient; return its energy, J."""
    rotations, positions, hinges, moments = state.rotation, state.position, state.hinge, state.moment
    masses, centers, gradient = chain.mass, chain.center, state.gradient
    g = gravity[0], gravity[1], gravity[2]
    energy, mass = 0.0, 0.0
    moment = 0.0, 0.0, 0.0
    for i in range(masses.shape[0] - 1, -1, -1):
        here = vector(positions, i)
        if i < masses.shape[0] - 1:
            moment = plus(moment, mass, plus(vector(positions, i + 1), -1.0, here))
        rotation = vector(rotations[i], 0), vector(rotations[i], 1), vector(rotations[i], 2)
        center = turned(rotation, vector(centers, i))
        moment = plus(moment, masses[i], center)
        mass += masses[i]
        energy -= masses[i] * dot(g, plus(here, 1.0, center))
        moments[i, 0], moments[i, 1], moments[i, 2] = moment
        turning = cross(moment, g)
        for h in range(2):
            gradient[2 * i + h] -= dot(vector(hinges[i], h), turning)
    return energy


@kernel
def find_hessian(gravity, pull, state):
    """The Hessian at the last `evaluate`, of the same gravity and pull, in the room that `state` has for it.
    With friction, the derivatives of the gradient on and above the blocks; those below are in `state.rub`.
    """
    tensions, jacobian, chord_hessian, stiffness = state.tensions, state.jacobian, state.chord_hessian, state.stiffness
    hinges, moments, left, right, block = state.hinge, state.moment, state.left, state.right, state.block
    # gravity: ∂²E/∂q_h∂q_h' = -(g x a_h)·(a_h' x moment of h'), h the hinge nearer to the base
    g = gravity[0], gravity[1], gravity[2]
    for i in range(block.shape[0]):
        moment = vector(moments, i)
        for h in range(2):
            axis, j = vector(hinges[i], h), 2 * i + h
            left[0, j], left[1, j], left[2, j] = cross(axis, g)
            right[0, j], right[1, j], right[2, j] = cross(axis, moment)
    rank, rubbing = 3, pull.friction != 0
    for t in range(tensions.shape[0]):
        if rubbing:
            add_tendon_rows(t, pull.slope[t] if is_elastic(state, pull, t) else 0.0, pull, state)
            rank += 1
        elif is_elastic(state, pull, t):
            for j in range(jacobian.shape[1]):
                left[rank, j] = pull.slope[t] * jacobian[t, j]
                right[rank, j] = jacobian[t, j]
            rank += 1
    for i in range(block.shape[0]):
        a, b = 2 * i, 2 * i + 1
        aa, ab, bb = stiffness[a], state.coupling[i], stiffness[b]
        for t in range(tensions.shape[0]):
            tension = tensions[t] * state.share[i, t]
            aa += tension * chord_hessian[i, t, 0]
            ab += tension * chord_hessian[i, t, 1]
            bb += tension * chord_hessian[i, t, 2]
        for m in range(rank):
            aa += left[m, a] * right[m, a]
            ab += left[m, a] * right[m, b]
            bb += left[m, b] * right[m, b]
        block[i, 0], block[i, 1], block[i, 2] = aa, ab, bb
    if rubbing:
        complete_derivatives(pull, state)
    return Hessian(left[:rank], right[:rank], block)


@kernel
def is_elastic(state, pull, t):
    """Whether tendon t's tension varies with its length: neither slack nor at its ceiling."""
    return pull.slope[t] > 0 and 0 < state.tensions[t] < pull.ceiling[t]
