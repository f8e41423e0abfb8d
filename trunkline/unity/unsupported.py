"""What MuJoCo's Unity importer has no component for, taken from a model in place; what it was is returned, for the
manifest. `calibrated.xml` of the package keeps it all."""

import mujoco

from trunkline.model.arm_model import BACKLASH, CAPSTAN_FRICTION, RATE_LIMIT, SLIP_LENGTH, ArmModel


def without_unsupported(spec: mujoco.MjSpec) -> dict[str, float]:
    """All of it, as the manifest's block `model` names it: `dead_time`, s, `capstan_friction`, `rate_limit`, m/s, and
    `backlash`, m; 0 for none."""
    dead_time, friction = without_dead_time(spec), without_rubbing(spec)
    return {"dead_time": dead_time, "capstan_friction": friction} | without_winches(spec)


def without_dead_time(spec: mujoco.MjSpec) -> float:
    """Take the motors' dead time from a model in place, as no component of the importer has it; s, as it was."""
    dead_time = max((float(actuator.delay) for actuator in spec.actuators), default=0.0)
    for actuator in spec.actuators:
        actuator.delay, actuator.nsample, actuator.interp = 0, 0, 0
    return dead_time


def without_rubbing(spec: mujoco.MjSpec) -> float:
    """Take the tendons by which cables rub from a model in place, as their friction has to follow the tension at every
    step; the coefficient μ, as it was."""
    arm = ArmModel(spec.compile())
    for tendon in [spec.tendons[number] for number in arm.guide_holes.flat]:
        spec.delete(tendon)
    for number in [number for number in spec.numerics if number.name in (CAPSTAN_FRICTION, SLIP_LENGTH)]:
        spec.delete(number)
    return arm.capstan_friction


def without_winches(spec: mujoco.MjSpec) -> dict[str, float]:
    """Take rate limit and backlash of the motors' winches from a model in place, as commands have to be shaped with
    them before they are sent; what they were by name, 0 for none."""
    arm, names = ArmModel(spec.compile()), (RATE_LIMIT, BACKLASH)
    for number in [number for number in spec.numerics if number.name in names]:
        spec.delete(number)
    return {name: arm.number(name) for name in names}
