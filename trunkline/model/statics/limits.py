"""Joint limits as MuJoCo makes them: read from the model, and the torque and energy of each at rest, as kernels.

A unit has up to four: of its two hinges and, if it is round, of its diagonals, the sum of both angles and their
difference, which are limits of fixed tendons. MuJoCo makes both kinds alike, each from fields of its own.
"""

from typing import NamedTuple

import mujoco
import numpy as np

from trunkline.model.statics.kernel import kernel

MIN_IMPEDANCE, MAX_IMPEDANCE = mujoco.mjMINIMP, mujoco.mjMAXIMP
NARROW = 1e-15  # rad, width below which MuJoCo takes the impedance as constant
# Gauss-Legendre nodes and weights on [0, 1], exact to polynomials of degree 19.
_NODES = 0.5 * (np.polynomial.legendre.leggauss(10)[0] + 1)
_WEIGHTS = 0.5 * np.polynomial.legendre.leggauss(10)[1]


class Limits(NamedTuple):
    """Limits of angles, or of the lengths of tendons that are sums of angles.

    Attributes:
        span: lower and upper angle at which the limit's distance falls below its margin, rad, infinite if there is no
            limit. Shape (..., 2).
        gain: k / invweight0, N m/rad, see `limit_torque`. Shape (...).
        impedance: solimp as MuJoCo clamps it. Shape (..., 5).
    """

    span: np.ndarray
    gain: np.ndarray
    impedance: np.ndarray


def hinge_limits(model: mujoco.MjModel, joints: np.ndarray) -> Limits:
    """Those of hinges, in the shape of their numbers `joints`."""
    return _limits(
        model, model.jnt_limited[joints], model.jnt_range[joints], model.jnt_margin[joints], model.jnt_solref[joints],
        model.jnt_solimp[joints], model.dof_invweight0[model.jnt_dofadr[joints]],
    )  # fmt: skip


def tendon_limits(model: mujoco.MjModel, tendons: np.ndarray) -> Limits:
    """Those of tendons, in the shape of their numbers; none where that is less than 0."""
    there, free = tendons >= 0, np.broadcast_to([-np.inf, np.inf], (*tendons.shape, 2))
    limits = Limits(free.copy(), np.zeros(tendons.shape), np.zeros((*tendons.shape, mujoco.mjNIMP)))
    numbers = tendons[there]
    of_those = _limits(
        model, model.tendon_limited[numbers], model.tendon_range[numbers], model.tendon_margin[numbers],
        model.tendon_solref_lim[numbers], model.tendon_solimp_lim[numbers], model.tendon_invweight0[numbers],
    )  # fmt: skip
    for values, wanted in zip(limits, of_those, strict=True):
        values[there] = wanted
    return limits


def _limits(model: mujoco.MjModel, limited, span, margin, solref, solimp, inverse_weight) -> Limits:
    """k is from solref (MuJoCo docs, "Solver parameters: Reference")."""
    impedance = solimp.copy()
    impedance[..., [0, 1, 3]] = np.clip(solimp[..., [0, 1, 3]], MIN_IMPEDANCE, MAX_IMPEDANCE)
    impedance[..., 2] = np.maximum(0, solimp[..., 2])
    impedance[..., 4] = np.maximum(1, solimp[..., 4])
    time_constant, damping_ratio, d_width = solref[..., 0], solref[..., 1], impedance[..., 1]
    if not model.opt.disableflags & mujoco.mjtDisableBit.mjDSBL_REFSAFE:
        time_constant = np.where(time_constant > 0, np.maximum(time_constant, 2 * model.opt.timestep), time_constant)
    with np.errstate(divide="ignore"):
        standard = 1 / np.maximum(mujoco.mjMINVAL, (d_width * time_constant * damping_ratio) ** 2)
    k = np.where(solref[..., 0] > 0, standard, -solref[..., 0] / d_width**2)
    free = np.where(limited[..., None].astype(bool), span + margin[..., None] * [1, -1], [-np.inf, np.inf])
    return Limits(free, k / inverse_weight, impedance)


@kernel
def _sigmoid(x, midpoint, power):
    """Value and slope of solimp's sigmoid at 0 < x < 1."""
    if power == 1:
        return x, 1.0
    if x <= midpoint:
        a = 1 / midpoint ** (power - 1)
        return a * x**power, power * a * x ** (power - 1)
    b = 1 / (1 - midpoint) ** (power - 1)
    return 1 - b * (1 - x) ** power, power * b * (1 - x) ** (power - 1)


@kernel
def limit_torque(gain, impedance, depth):
    """Torque (N m) that a joint limit returns at rest, `depth` rad beyond it, and its slope (N m/rad).

    The constraint force at zero acceleration is d/(1-d) · k d r / invweight0, with the impedance d(r) of solimp and the
    k of solref, k = 1/(d_w² t_c² ζ²); `gain` is k / invweight0, that of the dof or the tendon (MuJoCo docs, "Solver
    parameters").
    """
    d0, dw, width = impedance[0], impedance[1], impedance[2]
    slope = 0.0
    if d0 == dw or width <= NARROW:
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


@kernel
def limit_energy(chain, i, h, depth):
    """Integral of `limit_torque` from 0 to `depth`, J, limit h of unit i; by quadrature where the impedance varies."""
    gain, impedance, width = chain.limit_gain[i, h], chain.limit_impedance[i, h], chain.limit_impedance[i, h, 2]
    if impedance[0] == impedance[1] or width <= NARROW:
        return 0.5 * limit_torque(gain, impedance, depth)[0] * depth
    if depth >= width:
        stiffness = limit_torque(gain, impedance, depth)[0] / depth
        return chain.limit_energy[i, h] + 0.5 * stiffness * (depth * depth - width * width)
    if depth <= impedance[3] * width:
        return _energy_between(gain, impedance, 0.0, depth)
    return chain.limit_energy[i, h] - _energy_between(gain, impedance, depth, width)


@kernel
def _energy_between(gain, impedance, start, end):
    energy = 0.0
    for k in range(_NODES.shape[0]):
        energy += _WEIGHTS[k] * limit_torque(gain, impedance, start + (end - start) * _NODES[k])[0]
    return energy * (end - start)


def limit_energies(gains: np.ndarray, impedances: np.ndarray) -> np.ndarray:
    """Energy (J) at the depth from which on the impedance is constant. Shapes (n, 4), (n, 4, 5) and (n, 4)."""
    energies = np.zeros(gains.shape)
    for limit in np.ndindex(gains.shape):
        gain, impedance = gains[limit], impedances[limit]
        width, knee = impedance[2], impedance[3] * impedance[2]
        energies[limit] = _energy_between(gain, impedance, 0.0, knee) + _energy_between(gain, impedance, knee, width)
    return energies
