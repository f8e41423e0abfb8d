"""Where joint angles put the units, and what they do to the tendons' paths, as compiled kernels."""

from typing import NamedTuple

import numpy as np

from trunkline.model.statics.capstan import CapstanTerms, new_capstan_terms
from trunkline.model.statics.chain import Chain
from trunkline.model.statics.kernel import kernel
from trunkline.model.statics.vectors import copy, cross, dot, plus, product, turn_about, turned, vector


class ChainState(NamedTuple):
    """Everything that is computed from the joint angles; one per thread, filled in place.

    Shapes: rotation (n, 3, 3), position (n, 3), hinge (n, 2, 3), moment (n, 3), lengths (K,), tensions (K,),
    jacobian (K, nq), chord and share (n, K), chord_hessian (n, K, 3), gradient, stiffness (nq,), coupling (n,), left
    and right (3 + K, nq), block (n, 4).
    rotation, position and hinge are in the base frame; moment is the first moment Σ m (x - position) of the unit and
    all after it; stiffness is that of each hinge by itself, springs and limit, and coupling that between the two of a
    round joint, N m/rad; chord is the length of each tendon across each joint, m, and share its tension there over
    that at the motor, 1 without friction; left, right and block are room for the `factor.Hessian`.
    """

    rotation: np.ndarray
    position: np.ndarray
    hinge: np.ndarray
    moment: np.ndarray
    lengths: np.ndarray
    tensions: np.ndarray
    jacobian: np.ndarray
    chord: np.ndarray
    share: np.ndarray
    chord_hessian: np.ndarray
    gradient: np.ndarray
    stiffness: np.ndarray
    coupling: np.ndarray
    left: np.ndarray
    right: np.ndarray
    block: np.ndarray
    rub: CapstanTerms


@kernel
def new_state(units, tendons):
    """An empty `State` for a chain of `units` units and `tendons` tendons."""
    nq = 2 * units
    return ChainState(
        np.zeros((units, 3, 3)),
        np.zeros((units, 3)),
        np.zeros((units, 2, 3)),
        np.zeros((units, 3)),
        np.zeros(tendons),
        np.zeros(tendons),
        np.zeros((tendons, nq)),
        np.zeros((units, tendons)),
        np.ones((units, tendons)),
        np.zeros((units, tendons, 3)),
        np.zeros(nq),
        np.zeros(nq),
        np.zeros(units),
        np.zeros((3 + tendons, nq)),
        np.zeros((3 + tendons, nq)),
        np.zeros((units, 4)),
        new_capstan_terms(units, tendons),
    )


@kernel
def place(chain, q, state):
    """Rotations, joint positions, hinge axes, tendon lengths and their first and second derivatives at q."""
    axes, zero, offset = chain.axes, chain.zero, chain.offset
    rotations, positions, hinges = state.rotation, state.position, state.hinge
    copy(chain.fixed_length, state.lengths)
    rotation = (1.0, 0.0, 0.0), (0.0, 1.0, 0.0), (0.0, 0.0, 1.0)
    position = (0.0, 0.0, 0.0)
    for i in range(axes.shape[0]):
        first_axis = vector(axes[i], 0)
        first = turn_about(first_axis, q[2 * i] - zero[i, 0])
        second = turn_about(vector(axes[i], 1), q[2 * i + 1] - zero[i, 1])
        second_axis = turned(first, vector(axes[i], 1))
        local = product(first, second)
        position = plus(position, 1.0, turned(rotation, vector(offset, i)))
        first_hinge, second_hinge = turned(rotation, first_axis), turned(rotation, second_axis)
        rotation = product(rotation, local)
        for k in range(3):
            positions[i, k] = position[k]
            hinges[i, 0, k], hinges[i, 1, k] = first_hinge[k], second_hinge[k]
            for m in range(3):
                rotations[i, k, m] = rotation[k][m]
        _place_chords(chain, i, local, first_axis, second_axis, state)


@kernel
def place_chords(first, last, chain, qpos, chords):
    """Fill the tendons' chords (B, n, K), m, at joint angles (B, nq), rows `first` to `last`."""
    units, tendons = chain.crosses.shape
    state = new_state(units, tendons)
    for row in range(first, last):
        place(chain, qpos[row], state)
        for i in range(units):
            copy(state.chord[i], chords[row, i])


def joint_positions(chain: Chain, qpos: np.ndarray) -> np.ndarray:
    """Joints, then the tip, at joint angles `qpos` (B, nq), in the base frame, m. Shape (B, n + 1, 3)."""
    places = np.empty((len(qpos), chain.units + 1, 3))
    _place_joints(0, len(qpos), chain, np.ascontiguousarray(qpos), places)
    return places


@kernel
def _place_joints(first, last, chain, qpos, places):
    """Fill `places` (B, n + 1, 3), rows `first` to `last`."""
    units, tendons = chain.crosses.shape
    state = new_state(units, tendons)
    for row in range(first, last):
        place(chain, qpos[row], state)
        for k in range(3):
            places[row, units, k] = state.position[units - 1, k]
            for i in range(units):
                places[row, i, k] = state.position[i, k]
            for m in range(3):
                places[row, units, k] += state.rotation[units - 1, k, m] * chain.tip[m]


@kernel
def _place_chords(chain, i, local, first_axis, second_axis, state):
    """The tendons' chords d from the hole before joint i to the hole after it, all in the frame before the joint."""
    crosses, hole_in, hole_out = chain.crosses, chain.hole_in[i], chain.hole_out[i]
    lengths, jacobian, chord_hessian = state.lengths, state.jacobian, state.chord_hessian
    for t in range(crosses.shape[1]):
        if crosses[i, t] == 0:
            continue
        x, h = turned(local, vector(hole_out, t)), vector(hole_in, t)
        d = plus(x, -1.0, h)
        length = np.sqrt(dot(d, d))
        d1, d2 = cross(first_axis, x), cross(second_axis, x)
        j1, j2 = dot(d, d1) / length, dot(d, d2) / length
        lengths[t] += length
        state.chord[i, t] = length
        jacobian[t, 2 * i], jacobian[t, 2 * i + 1] = j1, j2
        chord_hessian[i, t, 0] = (dot(d1, d1) + dot(d, cross(first_axis, d1)) - j1 * j1) / length
        chord_hessian[i, t, 1] = (dot(d1, d2) + dot(d, cross(first_axis, d2)) - j1 * j2) / length
        chord_hessian[i, t, 2] = (dot(d2, d2) + dot(d, cross(second_axis, d2)) - j2 * j2) / length
