"""Parameters of tendons, of the motors that draw them in, and of the holes through which they run."""

import mujoco
import numpy as np

from trunkline.identification.parameters.parameter import (
    ArmPart,
    Fields,
    Parameter,
    moving,
    number,
    pulled,
    pulled_and_moving,
)
from trunkline.model.arm_model import BACKLASH, CAPSTAN_FRICTION, FORCE_SCALE, PRELOAD, RATE_LIMIT, WINDING, ArmModel
from trunkline.recordings.trials.experiments import ExperimentKind

TENDONS = ArmPart(
    lambda arm: arm.model.nu > 0,
    "found it for an arm without tendons, expected parameters of joints alone; such an arm's pipeline ends with `dvc "
    "repro identify_damping`",
)
HOLDING = ArmPart(  # lengths
    lambda arm: TENDONS.has(arm) and arm.commands == "length",
    f"{TENDONS.lacking}; or for motors that are commanded by force, which have no gain: expected `force_scale`",
)
PULLING = ArmPart(
    lambda arm: arm.commands == "force" and arm.places(FORCE_SCALE).size > 0,
    "found it for motors that are not commanded by force, expected build_mjcf.actuation.commands: force",
)
DELAYS = ArmPart(
    lambda arm: arm.model.nhistory > 0,
    "found it for motors without, expected build_mjcf.actuation.dead_time of more than 0; of an arm that comes as "
    "MJCF, expected `delay` and `nsample` of its actuators in that file",
)
HOLES = ArmPart(
    lambda arm: arm.guide_holes.size > 0, "found it for cables that do not rub, expected build_mjcf.holes: rubbing"
)
UNEVEN = (
    "found it for evenly spread tendons, or motors that are commanded by force, expected tendons that are described "
    "one by one in build_mjcf.arm, and commanded by length"
)


def _winches(name: str) -> ArmPart:
    lacking = f"found it for winches without, expected build_mjcf.actuation.{name} of more than 0"
    return ArmPart(lambda arm: arm.places(name).size > 0, lacking)


def _plays(kind: ExperimentKind) -> bool:
    """Backlash shows where tendons go to and fro."""
    return kind.needs_motors and (not kind.static or kind.stepwise)


def _slides(kind: ExperimentKind) -> bool:
    """Which way cables slide is known of motions, and of pulls at rest by how they were approached."""
    return kind.needs_motors and not kind.stepwise


def _of_all(
    unit: str, field: str, column: int | None = None, sign: float = 1.0, part: ArmPart = TENDONS,
    identifiable_from=pulled_and_moving,
) -> Parameter:  # fmt: skip
    """A number, or with `sign` its negative, in a field that all cables, or all of their motors, have in common."""
    at = () if column is None else (column,)

    def read(model: mujoco.MjModel) -> float:
        return float(sign * getattr(model, field)[(0, *at)])

    def write(fields: Fields, values: np.ndarray, model: mujoco.MjModel) -> None:
        every = ArmModel(model).cables if field.startswith("tendon") else slice(None)
        fields[field][(slice(None), every, *at)] = sign * values[:, None]

    return Parameter(unit, (field,), read, write, part=part, identifiable_from=identifiable_from)


def _write_kp(fields: Fields, values: np.ndarray, model: mujoco.MjModel) -> None:
    """Of the first motor; the others keep their ratios to it."""
    gains = values[:, None] * (model.actuator_gainprm[:, 0] / model.actuator_gainprm[0, 0])
    fields["actuator_gainprm"][:, :, 0] = gains
    fields["actuator_biasprm"][:, :, 1] = -gains


def _write_force_range(fields: Fields, values: np.ndarray, model: mujoco.MjModel) -> None:
    """Of all motors. What is sent tensions is sent no more than it pulls."""
    fields["actuator_forcerange"][:, :, 0] = -values[:, None]
    if ArmModel(model).commands == "force":
        fields["actuator_ctrlrange"][:, :, 1] = values[:, None]


def _gain_ratio(motor: int) -> Parameter:
    """Gain of a motor over that of the first: cables and winches are not equally stiff."""

    def read(model: mujoco.MjModel) -> float:
        return float(model.actuator_gainprm[motor - 1, 0] / model.actuator_gainprm[0, 0])

    def write(fields: Fields, values: np.ndarray, model: mujoco.MjModel) -> None:
        gain = values * fields["actuator_gainprm"][:, 0, 0]
        fields["actuator_gainprm"][:, motor - 1, 0] = gain
        fields["actuator_biasprm"][:, motor - 1, 1] = -gain

    lacking = f"found it for an arm without motor {motor}, expected a ratio for each motor that it has but the first"
    part = ArmPart(lambda arm: arm.model.nu >= motor and HOLDING.has(arm), lacking)
    return Parameter("", ("actuator_gainprm", "actuator_biasprm"), read, write, part=part, identifiable_from=pulled)


def preload(cable: int) -> Parameter:
    """How far a cable is drawn in beyond the straight arm's length where its command is 0; below 0 it is slack."""
    part = ArmPart(lambda arm: len(arm.preload) >= cable, UNEVEN)
    return number(PRELOAD, "m", part, pulled, cable - 1, signed=True, scale=0.01)


def _sites(model: mujoco.MjModel, cable: int) -> np.ndarray:
    """Numbers of the sites through which cable `cable`, from 1, runs, that of the mount first."""
    arm = ArmModel(model)
    return arm.cable_sites(arm.cables[cable - 1])


def angle(cable: int) -> Parameter:
    """At which angle about the arm's axis a cable runs, from +x towards +y, between -π and π."""

    def read(model: mujoco.MjModel) -> float:
        return float(np.arctan2(*model.site_pos[_sites(model, cable)[0], 1::-1]))

    def write(fields: Fields, values: np.ndarray, model: mujoco.MjModel) -> None:
        sites = _sites(model, cable)
        turns = values - read(model)
        x, y = fields["site_pos"][:, sites, 0], fields["site_pos"][:, sites, 1]
        cosine, sine = np.cos(turns)[:, None], np.sin(turns)[:, None]
        fields["site_pos"][:, sites, :2] = np.stack([cosine * x - sine * y, sine * x + cosine * y], axis=-1)

    lacking = f"found it for an arm without tendon {cable}, expected one for each tendon that it has"
    part = ArmPart(lambda arm: arm.model.nu >= cable, lacking)
    return Parameter("rad", ("site_pos",), read, write, True, part, pulled)


def _read_distance(model: mujoco.MjModel) -> float:
    return float(np.hypot(*model.site_pos[_sites(model, 1)[0], :2]))


def _write_distance(fields: Fields, values: np.ndarray, model: mujoco.MjModel) -> None:
    """Of the first cable from the axis at the mount; all holes keep their ratios to it."""
    sites = np.concatenate([_sites(model, number + 1) for number in range(model.nu)])
    fields["site_pos"][:, sites, :2] *= (values / _read_distance(model))[:, None, None]


def _read_taper(model: mujoco.MjModel) -> float:
    sites = _sites(model, 1)
    return float(np.hypot(*model.site_pos[sites[-1], :2])) / _read_distance(model)


def _write_taper(fields: Fields, values: np.ndarray, model: mujoco.MjModel) -> None:
    """Of every cable: what the last of its holes is further out, or less, its others are from hole to hole."""
    change = values - _read_taper(model)
    for cable in range(1, model.nu + 1):
        sites = _sites(model, cable)
        away = np.hypot(*model.site_pos[sites, :2].T)
        added = np.outer(change, np.linspace(0, 1, len(sites))) * away[0]
        fields["site_pos"][:, sites, :2] *= (1 + added / away)[..., None]


TENDON_PARAMETERS: dict[str, Parameter] = {
    "tendon_friction": _of_all("N", "tendon_frictionloss", identifiable_from=moving),
    # the smallest speed at which a regularised friction yields falls with it: a slow one lets a hook creep straight
    "friction_time": _of_all("s", "tendon_solref_fri", 0, identifiable_from=moving),
    # μ of cables on the holes that they pass, in the capstan equation
    "capstan_friction": number(CAPSTAN_FRICTION, "", HOLES, _slides),
    "kp": Parameter(
        "N/m", ("actuator_gainprm", "actuator_biasprm"), lambda m: float(m.actuator_gainprm[0, 0]), _write_kp,
        part=HOLDING, identifiable_from=pulled,
    ),
    # of motors with their cables, which are not all equally stiff
    "kp_ratio_2": _gain_ratio(2),
    "kp_ratio_3": _gain_ratio(3),
    "kv": _of_all("N s/m", "actuator_biasprm", 2, -1.0, part=HOLDING),
    "force_range": Parameter(
        "N", ("actuator_forcerange", "actuator_ctrlrange"), lambda m: float(-m.actuator_forcerange[0, 0]),
        _write_force_range, part=TENDONS, identifiable_from=pulled,
    ),
    "time_constant": _of_all("s", "actuator_dynprm", 0),
    "dead_time": _of_all("s", "actuator_delay", part=DELAYS),
    "rate_limit": number(RATE_LIMIT, "m/s", _winches(RATE_LIMIT)),
    "backlash": number(BACKLASH, "m", _winches(BACKLASH), _plays),
    # metres of cable that a commanded metre draws in: the drum's radius over what session.yaml takes it for
    "winding": number(WINDING, "", ArmPart(lambda arm: arm.places(WINDING).size > 0, UNEVEN), pulled),
    # N of tension for each that is commanded: a drum's radius in session.yaml over the true one, or an effort's N
    "force_scale": number(FORCE_SCALE, "", PULLING, pulled),
    "tendon_distance": Parameter(
        "m", ("site_pos",), _read_distance, _write_distance, part=TENDONS, identifiable_from=pulled
    ),
    # distance from the axis of the first cable's last hole over that of its first
    "tendon_taper": Parameter("", ("site_pos",), _read_taper, _write_taper, part=TENDONS, identifiable_from=pulled),
}  # fmt: skip
