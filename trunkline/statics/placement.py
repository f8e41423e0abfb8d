"""Where joint angles put the units, and what they do to the tendons' paths, as compiled kernels."""

from typing import NamedTuple

import numpy as np

from trunkline.statics.kernel import kernel
from trunkline.statics.vectors import cross, product, turn_about, turned


class State(NamedTuple):
    """Everything that is computed from the joint angles; one per thread, filled in place.

    Shapes: rotation (n, 3, 3), position (n, 3), hinge (n, 2, 3), moment (n, 3), lengths (K,), tensions (K,),
    jacobian (K, nq), chord_hessian (n, K, 3), gradient (nq,), left and right (3 + K, nq), block (n, 3).
    rotation, position and hinge are in the base frame; moment is the first moment Σ m (x - position) of the unit and
    all after it; left, right and block are room for the `factor.Hessian`.
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
    left: np.ndarray
    right: np.ndarray
    block: np.ndarray


@kernel
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
        np.zeros((3 + tendons, nq)),
        np.zeros((3 + tendons, nq)),
        np.zeros((units, 3)),
    )


@kernel
def place(chain, q, state):
    """Rotations, joint positions, hinge axes, tendon lengths and their first and second derivatives at q."""
    n, tendons = chain.mass.shape[0], chain.gain.shape[0]
    first, second, local = np.empty((3, 3)), np.empty((3, 3)), np.empty((3, 3))
    axis_b, x, moved = np.empty(3), np.empty(3), np.empty(3)
    for t in range(tendons):
        state.lengths[t] = chain.fixed_length[t]
    for i in range(n):
        axis_a = chain.axes[i, 0]
        turn_about(axis_a, q[2 * i] - chain.zero[i, 0], first)
        turn_about(chain.axes[i, 1], q[2 * i + 1] - chain.zero[i, 1], second)
        product(first, second, local)
        turned(first, chain.axes[i, 1], axis_b)
        if i == 0:
            state.rotation[0] = local
            state.position[0] = chain.offset[0]
            state.hinge[0, 0] = axis_a
            state.hinge[0, 1] = axis_b
        else:
            parent = state.rotation[i - 1]
            product(parent, local, state.rotation[i])
            turned(parent, chain.offset[i], moved)
            for k in range(3):
                state.position[i, k] = state.position[i - 1, k] + moved[k]
            turned(parent, axis_a, state.hinge[i, 0])
            turned(parent, axis_b, state.hinge[i, 1])
        for t in range(tendons):
            if chain.crosses[i, t] == 0:
                continue
            # chord d from the hole before the joint to the hole after it, in the frame before the joint
            turned(local, chain.hole_out[i, t], x)
            h = chain.hole_in[i, t]
            dx, dy, dz = x[0] - h[0], x[1] - h[1], x[2] - h[2]
            chord = np.sqrt(dx * dx + dy * dy + dz * dz)
            ax, ay, az = axis_a[0], axis_a[1], axis_a[2]
            bx, by, bz = axis_b[0], axis_b[1], axis_b[2]
            d1x, d1y, d1z = cross(ax, ay, az, x[0], x[1], x[2])
            d2x, d2y, d2z = cross(bx, by, bz, x[0], x[1], x[2])
            e11x, e11y, e11z = cross(ax, ay, az, d1x, d1y, d1z)
            e12x, e12y, e12z = cross(ax, ay, az, d2x, d2y, d2z)
            e22x, e22y, e22z = cross(bx, by, bz, d2x, d2y, d2z)
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
