"""Potential energy of a chain at rest, with its exact gradient and Hessian, as compiled kernels.

    E(q) = Σ_j U_j(q_j) + Σ_j P_j(q_j) - Σ_i m_i g·x_i(q) + Σ_t Φ_t(l_t(q))

U: elastic joints and constant torques, P: joint limits, x_i: centres of mass, l_t: tendon path lengths. A tendon's
energy has the tension Φ' = clip(λ + ρ (l - L), 0, F): a fixed tension (ρ = 0, never clipped), a position actuator
(λ = 0, ρ = kp, L its command) and the augmented Lagrangian of a cable of length L (ρ a penalty) are all of this form.
"""

from typing import NamedTuple

import numpy as np
from numba import njit

# Gauss-Legendre nodes and weights on [0, 1], exact to polynomials of degree 19.
_NODES = 0.5 * (np.polynomial.legendre.leggauss(10)[0] + 1)
_WEIGHTS = 0.5 * np.polynomial.legendre.leggauss(10)[1]


class Pull(NamedTuple):
    """How the tendons pull; every array has shape (K,). Units N, N/m, m, N."""

    tension: np.ndarray  # λ
    slope: np.ndarray  # ρ
    length: np.ndarray  # L
    ceiling: np.ndarray  # F


class State(NamedTuple):
    """Everything that is computed from the joint angles; one per thread, filled in place.

    Shapes: rotation (n, 3, 3), position (n, 3), hinge (n, 2, 3), subtree_mass (n,), subtree_center (n, 3),
    lengths (K,), tensions (K,), jacobian (K, nq), chord_hessian (n, K, 3), gradient (nq,), hessian (nq, nq);
    rotation and hinge are in the base frame, position and subtree_center too; subtree_center is the first moment
    Σ m (x - position) of the unit and all after it.
    """

    rotation: np.ndarray
    position: np.ndarray
    hinge: np.ndarray
    moment: np.ndarray
    lengths: np.ndarray
    tensions: np.ndarray
    jacobian: np.ndarray
    chord_hessian: np.ndarray
    gradient: np.ndarray
    hessian: np.ndarray


@njit(cache=True)
def new_state(units, tendons):
    """An empty `State` for a chain of `units` units and `tendons` tendons."""
    nq = 2 * units
    return State(
        np.zeros((units, 3, 3)),
        np.zeros((units, 3)),
        np.zeros((units, 2, 3)),
        np.zeros((units, 3)),
        np.zeros(tendons),
        np.zeros(tendons),
        np.zeros((tendons, nq)),
        np.zeros((units, tendons, 3)),
        np.zeros(nq),
        np.zeros((nq, nq)),
    )


@njit(cache=True)
def _cross(ax, ay, az, bx, by, bz):
    return ay * bz - az * by, az * bx - ax * bz, ax * by - ay * bx


@njit(cache=True)
def _rotation(axis, angle, out):
    """Rodrigues' formula into `out` (3, 3)."""
    c, s = np.cos(angle), np.sin(angle)
    x, y, z = axis[0], axis[1], axis[2]
    t = 1 - c
    out[0, 0], out[0, 1], out[0, 2] = t * x * x + c, t * x * y - s * z, t * x * z + s * y
    out[1, 0], out[1, 1], out[1, 2] = t * x * y + s * z, t * y * y + c, t * y * z - s * x
    out[2, 0], out[2, 1], out[2, 2] = t * x * z - s * y, t * y * z + s * x, t * z * z + c


@njit(cache=True)
def _matmul(a, b, out):
    for i in range(3):
        for j in range(3):
            out[i, j] = a[i, 0] * b[0, j] + a[i, 1] * b[1, j] + a[i, 2] * b[2, j]


@njit(cache=True)
def _matvec(a, v, out):
    for i in range(3):
        out[i] = a[i, 0] * v[0] + a[i, 1] * v[1] + a[i, 2] * v[2]


@njit(cache=True)
def place(chain, q, state):
    """Rotations, joint positions, hinge axes, tendon lengths and their first and second derivatives at q."""
    n, tendons = chain.mass.shape[0], chain.gain.shape[0]
    first, second, local = np.empty((3, 3)), np.empty((3, 3)), np.empty((3, 3))
    axis_b, x, moved = np.empty(3), np.empty(3), np.empty(3)
    for t in range(tendons):
        state.lengths[t] = chain.fixed_length[t]
    for i in range(n):
        axis_a = chain.axes[i, 0]
        _rotation(axis_a, q[2 * i] - chain.zero[i, 0], first)
        _rotation(chain.axes[i, 1], q[2 * i + 1] - chain.zero[i, 1], second)
        _matmul(first, second, local)
        _matvec(first, chain.axes[i, 1], axis_b)
        if i == 0:
            state.rotation[0] = local
            state.position[0] = chain.offset[0]
            state.hinge[0, 0] = axis_a
            state.hinge[0, 1] = axis_b
        else:
            parent = state.rotation[i - 1]
            _matmul(parent, local, state.rotation[i])
            _matvec(parent, chain.offset[i], moved)
            for k in range(3):
                state.position[i, k] = state.position[i - 1, k] + moved[k]
            _matvec(parent, axis_a, state.hinge[i, 0])
            _matvec(parent, axis_b, state.hinge[i, 1])
        for t in range(tendons):
            if chain.crosses[i, t] == 0:
                continue
            # chord d from the hole before the joint to the hole after it, in the frame before the joint
            _matvec(local, chain.hole_out[i, t], x)
            h = chain.hole_in[i, t]
            dx, dy, dz = x[0] - h[0], x[1] - h[1], x[2] - h[2]
            chord = np.sqrt(dx * dx + dy * dy + dz * dz)
            ax, ay, az = axis_a[0], axis_a[1], axis_a[2]
            bx, by, bz = axis_b[0], axis_b[1], axis_b[2]
            d1x, d1y, d1z = _cross(ax, ay, az, x[0], x[1], x[2])
            d2x, d2y, d2z = _cross(bx, by, bz, x[0], x[1], x[2])
            e11x, e11y, e11z = _cross(ax, ay, az, d1x, d1y, d1z)
            e12x, e12y, e12z = _cross(ax, ay, az, d2x, d2y, d2z)
            e22x, e22y, e22z = _cross(bx, by, bz, d2x, d2y, d2z)
            inverse = 1 / chord
            j1 = (dx * d1x + dy * d1y + dz * d1z) * inverse
            j2 = (dx * d2x + dy * d2y + dz * d2z) * inverse
            h11 = d1x * d1x + d1y * d1y + d1z * d1z + dx * e11x + dy * e11y + dz * e11z - j1 * j1
            h12 = d1x * d2x + d1y * d2y + d1z * d2z + dx * e12x + dy * e12y + dz * e12z - j1 * j2
            h22 = d2x * d2x + d2y * d2y + d2z * d2z + dx * e22x + dy * e22y + dz * e22z - j2 * j2
            state.lengths[t] += chord
            state.jacobian[t, 2 * i] = j1
            state.jacobian[t, 2 * i + 1] = j2
            state.chord_hessian[i, t, 0] = h11 * inverse
            state.chord_hessian[i, t, 1] = h12 * inverse
            state.chord_hessian[i, t, 2] = h22 * inverse


@njit(cache=True)
def _sigmoid(x, midpoint, power):
    """Value and slope of solimp's sigmoid at 0 < x < 1."""
    if power == 1:
        return x, 1.0
    if x <= midpoint:
        a = 1 / midpoint ** (power - 1)
        return a * x**power, power * a * x ** (power - 1)
    b = 1 / (1 - midpoint) ** (power - 1)
    return 1 - b * (1 - x) ** power, power * b * (1 - x) ** (power - 1)


@njit(cache=True)
def limit_torque(gain, impedance, depth):
    """Torque (N m) that a joint limit returns at rest, `depth` rad beyond it, and its slope (N m/rad).

    The constraint force at zero acceleration is d/(1-d) · k d r / dof_invweight0, with the impedance d(r) of
    solimp and the k of solref, k = 1/(d_w² t_c² ζ²); `gain` is k / dof_invweight0 (MuJoCo docs, "Solver parameters").
    """
    d0, dw, width = impedance[0], impedance[1], impedance[2]
    slope = 0.0
    if d0 == dw or width <= 1e-15:
        d = 0.5 * (d0 + dw)
    elif depth >= width:
        d = dw
    else:
        y, dy = _sigmoid(depth / width, impedance[3], impedance[4])
        d = d0 + y * (dw - d0)
        slope = dy * (dw - d0) / width
    free = 1 - d
    torque = gain * d * d / free * depth
    return torque, gain * (d * d / free + depth * slope * d * (2 - d) / (free * free))


@njit(cache=True)
def _limit_piece(gain, impedance, start, end):
    energy = 0.0
    for k in range(_NODES.shape[0]):
        energy += _WEIGHTS[k] * limit_torque(gain, impedance, start + (end - start) * _NODES[k])[0]
    return energy * (end - start)


@njit(cache=True)
def limit_energy(gain, impedance, depth):
    """Integral of `limit_torque` from 0 to `depth`, J; by quadrature where the impedance varies."""
    width = impedance[2]
    knee = impedance[3] * width
    if impedance[0] == impedance[1] or width <= 1e-15:
        return 0.5 * limit_torque(gain, impedance, depth)[0] * depth
    if depth <= knee:
        return _limit_piece(gain, impedance, 0.0, depth)
    energy = _limit_piece(gain, impedance, 0.0, knee) + _limit_piece(gain, impedance, knee, min(depth, width))
    if depth > width:
        stiffness = limit_torque(gain, impedance, depth)[0] / depth
        energy += 0.5 * stiffness * (depth * depth - width * width)
    return energy


@njit(cache=True)
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


@njit(cache=True)
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
            energy += x * (x * (a / 2 + x * (b / 3 + x * c / 4)) - chain.torque[i, h])
            torque = x * (a + x * (b + x * c)) - chain.torque[i, h]
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


@njit(cache=True)
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
        _matvec(state.rotation[i], chain.center[i], center)
        mass += chain.mass[i]
        for k in range(3):
            moment[k] += chain.mass[i] * center[k]
            energy -= chain.mass[i] * gravity[k] * (state.position[i, k] + center[k])
        state.moment[i] = moment
        tx, ty, tz = _cross(moment[0], moment[1], moment[2], gx, gy, gz)
        for h in range(2):
            axis = state.hinge[i, h]
            state.gradient[2 * i + h] -= axis[0] * tx + axis[1] * ty + axis[2] * tz
    return energy


@njit(cache=True)
def fill_hessian(chain, q, gravity, pull, state):
    """Fill the upper triangle of `state.hessian` for the q, gravity and pull of the last `evaluate`."""
    n, tendons = chain.mass.shape[0], state.tensions.shape[0]
    nq = 2 * n
    hessian = state.hessian
    gx, gy, gz = gravity[0], gravity[1], gravity[2]
    # gravity: ∂²E/∂q_h∂q_h' = -(g x a_h)·(a_h' x moment of h'), h the hinge nearer to the base
    levers = np.empty((3, nq))
    for j in range(nq):
        axis, moment = state.hinge[j // 2, j % 2], state.moment[j // 2]
        levers[0, j], levers[1, j], levers[2, j] = _cross(
            axis[0], axis[1], axis[2], moment[0], moment[1], moment[2]
        )
    for j in range(nq):
        axis = state.hinge[j // 2, j % 2]
        ux, uy, uz = _cross(gx, gy, gz, axis[0], axis[1], axis[2])
        for k in range(j, nq):
            hessian[j, k] = -(ux * levers[0, k] + uy * levers[1, k] + uz * levers[2, k])
    for i in range(n):
        for h in range(2):
            j = 2 * i + h
            x = q[j] - chain.rest[i, h]
            a, b, c = chain.stiffness[i, h, 0], chain.stiffness[i, h, 1], chain.stiffness[i, h, 2]
            hessian[j, j] += a + x * (2 * b + 3 * x * c)
            depth = max(chain.limit[i, h, 0] - q[j], q[j] - chain.limit[i, h, 1])
            if depth > 0:
                hessian[j, j] += limit_torque(chain.limit_gain[i, h], chain.limit_impedance[i, h], depth)[1]
        for t in range(tendons):
            tension = state.tensions[t]
            hessian[2 * i, 2 * i] += tension * state.chord_hessian[i, t, 0]
            hessian[2 * i, 2 * i + 1] += tension * state.chord_hessian[i, t, 1]
            hessian[2 * i + 1, 2 * i + 1] += tension * state.chord_hessian[i, t, 2]
    for t in range(tendons):
        if is_elastic(state, pull, t):
            for j in range(nq):
                f = pull.slope[t] * state.jacobian[t, j]
                for k in range(j, nq):
                    hessian[j, k] += f * state.jacobian[t, k]


@njit(cache=True)
def is_elastic(state, pull, t):
    """Whether tendon t's tension varies with its length: neither slack nor at its ceiling."""
    return pull.slope[t] > 0 and 0 < state.tensions[t] < pull.ceiling[t]
