"""Potential energy of a chain at rest, with its exact gradient and Hessian, as compiled kernels.

    E(q) = Σ_j U_j(q_j) + Σ_j P_j(q_j) - Σ_i m_i g·x_i(q) + Σ_t Φ_t(l_t(q))

U: elastic joints and constant torques, P: joint limits, x_i: centres of mass, l_t: tendon path lengths. A tendon's
energy has the tension Φ' = clip(λ + ρ (l - L), 0, F): a fixed tension (ρ = 0, never clipped), a position actuator
(λ = 0, ρ = kp, L its command) and the augmented Lagrangian of a cable of length L (ρ a penalty) are all of this form.
"""

from typing import NamedTuple

import numpy as np

from trunkline.statics.factor import Hessian
from trunkline.statics.kernel import kernel
from trunkline.statics.limits import limit_energy, limit_torque
from trunkline.statics.placement import place
from trunkline.statics.vectors import cross, turned


class Pull(NamedTuple):
    """How the tendons pull, and constant torques at the joints: none, or dry friction where its band is sought.

    Units N, N/m, m, N, N m. Shapes (K,), torque (n, 2).
    """

    tension: np.ndarray  # λ
    slope: np.ndarray  # ρ
    length: np.ndarray  # L
    ceiling: np.ndarray  # F
    torque: np.ndarray


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
    """Fill `state` but for its Hessian; return the energy E(q), J.

    Args:
        q: joint angles, rad. Shape (nq,).
        gravity: in the base frame, m/s². Shape (3,).
        pull: how the tendons pull, a `Pull`.
    """
    n = chain.mass.shape[0]
    place(chain, q, state)
    energy = pull_tensions(state, pull)
    for i in range(n):
        for h in range(2):
            j = 2 * i + h
            x = q[j] - chain.rest[i, h]
            a, b, c = chain.stiffness[i, h, 0], chain.stiffness[i, h, 1], chain.stiffness[i, h, 2]
            energy += x * (x * (a / 2 + x * (b / 3 + x * c / 4)) - pull.torque[i, h])
            torque = x * (a + x * (b + x * c)) - pull.torque[i, h]
            if q[j] < chain.limit[i, h, 0]:
                depth = chain.limit[i, h, 0] - q[j]
                energy += limit_energy(chain.limit_gain[i, h], chain.limit_impedance[i, h], depth)
                torque -= limit_torque(chain.limit_gain[i, h], chain.limit_impedance[i, h], depth)[0]
            elif q[j] > chain.limit[i, h, 1]:
                depth = q[j] - chain.limit[i, h, 1]
                energy += limit_energy(chain.limit_gain[i, h], chain.limit_impedance[i, h], depth)
                torque += limit_torque(chain.limit_gain[i, h], chain.limit_impedance[i, h], depth)[0]
            for t in range(state.tensions.shape[0]):
                torque += state.tensions[t] * state.jacobian[t, j]
            state.gradient[j] = torque
    return energy + _add_gravity(chain, gravity, state)


@kernel
def _add_gravity(chain, gravity, state):
    """Add gravity's torques -g·(axis x moment) to the gradient; return its energy, J."""
    n = chain.mass.shape[0]
    energy, mass = 0.0, 0.0
    moment, center = np.zeros(3), np.empty(3)
    gx, gy, gz = gravity[0], gravity[1], gravity[2]
    for i in range(n - 1, -1, -1):
        if i < n - 1:
            for k in range(3):
                moment[k] += mass * (state.position[i + 1, k] - state.position[i, k])
        turned(state.rotation[i], chain.center[i], center)
        mass += chain.mass[i]
        for k in range(3):
            moment[k] += chain.mass[i] * center[k]
            energy -= chain.mass[i] * gravity[k] * (state.position[i, k] + center[k])
        state.moment[i] = moment
        tx, ty, tz = cross(moment[0], moment[1], moment[2], gx, gy, gz)
        for h in range(2):
            axis = state.hinge[i, h]
            state.gradient[2 * i + h] -= axis[0] * tx + axis[1] * ty + axis[2] * tz
    return energy


@kernel
def find_hessian(chain, q, gravity, pull, state):
    """The Hessian for the q, gravity and pull of the last `evaluate`, in the room that `state` has for it."""
    units, tendons = chain.mass.shape[0], state.tensions.shape[0]
    left, right, block = state.left, state.right, state.block
    # gravity: ∂²E/∂q_h∂q_h' = -(g x a_h)·(a_h' x moment of h'), h the hinge nearer to the base
    gx, gy, gz = gravity[0], gravity[1], gravity[2]
    for j in range(2 * units):
        axis, moment = state.hinge[j // 2, j % 2], state.moment[j // 2]
        left[0, j], left[1, j], left[2, j] = cross(axis[0], axis[1], axis[2], gx, gy, gz)
        right[0, j], right[1, j], right[2, j] = cross(axis[0], axis[1], axis[2], moment[0], moment[1], moment[2])
    rank = 3
    for t in range(tendons):
        if is_elastic(state, pull, t):
            for j in range(2 * units):
                left[rank, j] = pull.slope[t] * state.jacobian[t, j]
                right[rank, j] = state.jacobian[t, j]
            rank += 1
    for i in range(units):
        a, b = 2 * i, 2 * i + 1
        aa, ab, bb = _joint_stiffness(chain, q, i, 0), 0.0, _joint_stiffness(chain, q, i, 1)
        for t in range(tendons):
            aa += state.tensions[t] * state.chord_hessian[i, t, 0]
            ab += state.tensions[t] * state.chord_hessian[i, t, 1]
            bb += state.tensions[t] * state.chord_hessian[i, t, 2]
        for m in range(rank):
            aa += left[m, a] * right[m, a]
            ab += left[m, a] * right[m, b]
            bb += left[m, b] * right[m, b]
        block[i, 0], block[i, 1], block[i, 2] = aa, ab, bb
    return Hessian(left[:rank], right[:rank], block)


@kernel
def _joint_stiffness(chain, q, i, h):
    """Second derivative of the elastic energy and the limit of hinge h of unit i, N m/rad."""
    angle = q[2 * i + h]
    x = angle - chain.rest[i, h]
    stiffness = chain.stiffness[i, h, 0] + x * (2 * chain.stiffness[i, h, 1] + 3 * x * chain.stiffness[i, h, 2])
    depth = max(chain.limit[i, h, 0] - angle, angle - chain.limit[i, h, 1])
    if depth > 0:
        stiffness += limit_torque(chain.limit_gain[i, h], chain.limit_impedance[i, h], depth)[1]
    return stiffness


@kernel
def is_elastic(state, pull, t):
    """Whether tendon t's tension varies with its length: neither slack nor at its ceiling."""
    return pull.slope[t] > 0 and 0 < state.tensions[t] < pull.ceiling[t]
