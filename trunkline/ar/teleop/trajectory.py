"""Time-synchronised, jerk-limited trajectories of all ten axes: seven joints and three tendons.

Ruckig finds, for each stretch from rest to rest, the time-optimal profile of piecewise constant jerk of the slowest
axis and makes all others last as long. Source: L. Berscheid, T. Kröger, "Jerk-limited Real-time Trajectory Generation
with Arbitrary Target States", RSS 2021.
"""

from dataclasses import dataclass
from typing import Annotated

import numpy as np
import ruckig
from pydantic import Field

from trunkline.ar.teleop.minimum_jerk import PEAK, minimum_jerk
from trunkline.errors import InputError
from trunkline.kinematics.panda.limits import ACCELERATION, JERK, VELOCITY

JOINTS = len(VELOCITY)


@dataclass(frozen=True)
class MotorLimits:
    """Of the tendons' motors: cable `velocity` (m/s), `acceleration` (m/s²) and `jerk` (m/s³). `share`: of the Panda's
    own limits that plans make use of."""

    velocity: Annotated[float, Field(gt=0, le=10)]
    acceleration: Annotated[float, Field(gt=0, le=100)]
    jerk: Annotated[float, Field(gt=0, le=10_000)]
    share: Annotated[float, Field(gt=0, le=1)]


@dataclass(frozen=True)
class MotionLimits:
    """Largest velocity, acceleration and jerk of each axis, joints first. Shape (7 + K,), in rad and m."""

    velocity: np.ndarray
    acceleration: np.ndarray
    jerk: np.ndarray


def limits_of(motors: MotorLimits, rate_limit: float = 0.0, tendons: int = 3) -> MotionLimits:
    """The Panda's limits and the motors'; `rate_limit`, m/s, is the identified winches', 0 for none."""
    rate = min(motors.velocity, rate_limit) if rate_limit > 0 else motors.velocity
    motor_limits = (rate, motors.acceleration, motors.jerk)
    panda = (VELOCITY, ACCELERATION, JERK)
    return MotionLimits(
        *(np.append(motors.share * p, np.full(tendons, o)) for p, o in zip(panda, motor_limits, strict=True))
    )


def point_to_point(
    start: np.ndarray, end: np.ndarray, limits: MotionLimits, step: float, seconds: float = 0.0
) -> np.ndarray:
    """Positions every `step` s from rest at `start` (n,) to rest at `end` (n,), in `seconds` s or more. Shape (T, n),
    both ends included.

    The last step may be shorter than the others: the end is held for the rest of it.

    Raises:
        InputError: Ruckig finds no such profile.
    """
    if np.array_equal(start, end):
        return start[None].copy()
    parameters = ruckig.InputParameter(len(start))
    parameters.current_position, parameters.target_position = start.tolist(), end.tolist()
    parameters.max_velocity, parameters.max_acceleration = limits.velocity.tolist(), limits.acceleration.tolist()
    parameters.max_jerk = limits.jerk.tolist()
    if seconds > 0:
        parameters.minimum_duration = seconds
    profile = ruckig.Trajectory(len(start))
    result = ruckig.Ruckig(len(start)).calculate(parameters, profile)
    if result < 0:
        raise InputError(
            f"trajectory: Ruckig found {result}, expected a profile from {start.tolist()} to {end.tolist()}"
        )
    times = step * np.arange(int(np.ceil(profile.duration / step)) + 1)
    return np.array([profile.at_time(float(min(t, profile.duration)))[0] for t in times])


def gentle(start: np.ndarray, end: np.ndarray, limits: MotionLimits, step: float, seconds: float = 0.0) -> np.ndarray:
    """As `point_to_point`, with the least jerk for its duration, so that what is carried feels least of it:

        x(τ) = x_0 + (x_1 - x_0) (10 τ³ - 15 τ⁴ + 6 τ⁵),    τ = t / T,

    whose largest velocity, acceleration and jerk are 15/8 Δ/T, 10/√3 Δ/T² and 60 Δ/T³ (as `minimum_jerk`).
    """
    away = np.abs(end - start)
    least = [PEAK * away / limits.velocity, np.sqrt(10 / np.sqrt(3) * away / limits.acceleration),
             np.cbrt(60 * away / limits.jerk)]  # fmt: skip
    duration = max(seconds, float(np.max(least)))
    share = np.minimum(step * np.arange(int(np.ceil(duration / step)) + 1) / max(duration, step), 1.0)[:, None]
    return start + minimum_jerk(share, end - start)
