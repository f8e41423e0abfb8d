"""What a compiled model may hold for the static chain to stand for it; everything else is refused by name."""

import mujoco
import numpy as np

from trunkline.errors import InputError
from trunkline.model.arm_model import ArmModel

_POSITION_DYNAMICS = (
    mujoco.mjtDyn.mjDYN_NONE,
    mujoco.mjtDyn.mjDYN_FILTER,
    mujoco.mjtDyn.mjDYN_FILTEREXACT,
)  # all of these have activation = control at rest
_FORCES_OFF = (
    mujoco.mjtDisableBit.mjDSBL_CONSTRAINT,
    mujoco.mjtDisableBit.mjDSBL_LIMIT,
    mujoco.mjtDisableBit.mjDSBL_SPRING,
    mujoco.mjtDisableBit.mjDSBL_GRAVITY,
    mujoco.mjtDisableBit.mjDSBL_ACTUATION,
)
RIGHT_ANGLE = 1.0  # deg by which a unit's two hinges may be off; more is another joint than is drawn


def require_supported(model: mujoco.MjModel) -> None:
    """Raise InputError, one line with the element's name, if `model` has a static force that the chain lacks."""
    _require_plain_options(model)
    _require_no_fluid(model)
    _require_unbranched_hinges(model)
    _require_no_contacts(model)
    _require_site_tendons(model)
    _require_pulling_actuators(model)


def _require_plain_options(model: mujoco.MjModel) -> None:
    for count, what in ((model.neq, "equality constraints"), (model.nflex, "flexes"), (model.nplugin, "plugins")):
        if count:
            raise InputError(f"model: found {count} {what}, expected none")
    for bit in _FORCES_OFF:
        if model.opt.disableflags & bit:
            name = bit.name.removeprefix("mjDSBL_").lower()
            raise InputError(f"model: option flag: found {name} disabled, expected enabled")
    if model.opt.enableflags & mujoco.mjtEnableBit.mjENBL_DIAGEXACT:
        raise InputError("model: option flag: found diagexact enabled, expected disabled")
    if np.any(model.body_gravcomp):
        name = model.body(int(np.flatnonzero(model.body_gravcomp)[0])).name
        raise InputError(f"model: body {name!r}: found gravity compensation, expected none")


def _require_no_fluid(model: mujoco.MjModel) -> None:
    """In wind every shape at rest bears a force; a medium that rests has none, nor one without density and
    viscosity."""
    if np.any(model.opt.wind) and (model.opt.density or model.opt.viscosity):
        wind = " ".join(f"{value:g}" for value in model.opt.wind)
        raise InputError(f"model: option wind: found {wind}, expected 0 0 0: shapes at rest are solved without wind")


def _require_unbranched_hinges(model: mujoco.MjModel) -> None:
    if model.njnt == 0:
        raise InputError("model: found no joints, expected two hinges a unit")
    for joint in range(model.njnt):
        name = model.joint(joint).name
        if model.jnt_type[joint] != mujoco.mjtJoint.mjJNT_HINGE:
            kind = mujoco.mjtJoint(model.jnt_type[joint]).name[6:].lower()
            raise InputError(f"model: joint {name!r}: found type {kind}, expected hinge")
        if model.jnt_actfrclimited[joint]:
            raise InputError(f"model: joint {name!r}: found an actuator force range, expected none")
    units = ArmModel(model).unit_bodies
    for index, body in enumerate(units):
        name, joints, first = model.body(body).name, model.body_jntnum[body], model.body_jntadr[body]
        if joints != 2:
            raise InputError(f"model: body {name!r}: found {joints} hinges, expected 2")
        if not np.allclose(model.jnt_pos[first], model.jnt_pos[first + 1], atol=1e-12):
            actual = f"{model.jnt_pos[first]} and {model.jnt_pos[first + 1]}"
            raise InputError(f"model: body {name!r}: found hinges at {actual}, expected one point")
        _require_right_angle(model, name, model.jnt_axis[first : first + 2])
        parent = model.body_weldid[model.body_parentid[body]]
        expected = units[index - 1] if index else 0
        if parent != expected:
            actual, wanted = model.body(parent).name, model.body(expected).name
            raise InputError(f"model: body {name!r}: found parent {actual!r}, expected {wanted!r}: no branches")


def _require_right_angle(model: mujoco.MjModel, body: str, axes: np.ndarray) -> None:
    apart = np.degrees(np.arccos(np.clip(abs(axes[0] @ axes[1]), 0, 1)))
    if 90 - apart > RIGHT_ANGLE:
        expected = "expected axes at right angles to each other"
        raise InputError(f"model: body {body!r}: found hinges about axes {apart:.3g}° apart, {expected}")


def _require_no_contacts(model: mujoco.MjModel) -> None:
    if model.npair:
        raise InputError(f"model: found {model.npair} contact pairs, expected none")
    if model.opt.disableflags & mujoco.mjtDisableBit.mjDSBL_CONTACT:
        return
    for geom in range(model.ngeom):
        meets = (model.geom_contype[geom] & model.geom_conaffinity) | (
            model.geom_conaffinity[geom] & model.geom_contype
        )
        meets[model.body_weldid[model.geom_bodyid] == model.body_weldid[model.geom_bodyid[geom]]] = 0
        if np.any(meets):
            first, second = (_geom_name(model, index) for index in (geom, int(np.flatnonzero(meets)[0])))
            expected = "expected no contacts (contype and conaffinity 0)"
            raise InputError(f"model: {first}: may touch {second}, {expected}")


def _geom_name(model: mujoco.MjModel, geom: int) -> str:
    """Few geoms have names of their own."""
    name = model.geom(geom).name
    return f"geom {name!r}" if name else f"a geom of body {model.body(model.geom_bodyid[geom]).name!r}"


def _require_site_tendons(model: mujoco.MjModel) -> None:
    arm = ArmModel(model)
    parts = [group.tendon for group in (*arm.branches, *arm.sliders, *arm.diagonals)] + [arm.guide_holes.ravel()]
    for tendon in np.setdiff1d(np.arange(model.ntendon), np.concatenate(parts)):
        name = model.tendon(tendon).name
        path = slice(model.tendon_adr[tendon], model.tendon_adr[tendon] + model.tendon_num[tendon])
        for kind in model.wrap_type[path]:
            if kind != mujoco.mjtWrap.mjWRAP_SITE:
                kind = mujoco.mjtWrap(kind).name[7:].lower()
                raise InputError(f"model: tendon {name!r}: found a {kind} on its path, expected sites only")
        if model.tendon_stiffness[tendon] or np.any(model.tendon_stiffnesspoly[tendon]):
            raise InputError(f"model: tendon {name!r}: found stiffness, expected 0")
        if model.tendon_limited[tendon]:
            raise InputError(f"model: tendon {name!r}: found a length limit, expected none")


def _require_pulling_actuators(model: mujoco.MjModel) -> None:
    forced = ArmModel(model).commands == "force"
    for actuator in range(model.nu):
        name = model.actuator(actuator).name
        if model.actuator_gaintype[actuator] == mujoco.mjtGain.mjGAIN_MUSCLE:
            raise InputError(f"model: actuator {name!r}: found a muscle, expected a position actuator, or a motor")
        if model.actuator_trntype[actuator] != mujoco.mjtTrn.mjTRN_TENDON:
            raise InputError(f"model: actuator {name!r}: found no tendon, expected one that pulls a tendon")
        if model.actuator_gaintype[actuator] != mujoco.mjtGain.mjGAIN_FIXED:
            raise InputError(f"model: actuator {name!r}: found a gain that varies, expected a fixed one")
        if not forced and model.actuator_biastype[actuator] != mujoco.mjtBias.mjBIAS_AFFINE:
            raise InputError(f"model: actuator {name!r}: found no affine bias, expected a position actuator")
        if mujoco.mjtDyn(model.actuator_dyntype[actuator]) not in _POSITION_DYNAMICS:
            raise InputError(f"model: actuator {name!r}: found other dynamics, expected none or a filter")
        gain, gear = model.actuator_gainprm[actuator, 0], model.actuator_gear[actuator, 0]
        offset, slope = model.actuator_biasprm[actuator, :2]
        if forced and (gain != -1 or gear != 1):
            expected = "expected a motor that is sent its tension: gain -1, gear 1"
            raise InputError(f"model: actuator {name!r}: found gain {gain:g}, gear {gear:g}, {expected}")
        if not forced and (gain <= 0 or offset != 0 or not np.isclose(slope, -gain) or gear != 1):
            raise InputError(
                f"model: actuator {name!r}: found gain {gain:g}, bias {offset:g} {slope:g}, gear {gear:g}, "
                "expected a position actuator: kp, bias 0 -kp, gear 1"
            )
        low, high = model.actuator_forcerange[actuator]
        if not model.actuator_forcelimited[actuator]:
            raise InputError(f"model: actuator {name!r}: found forcelimited off, expected forcerange -F 0: it pulls")
        if high > 0 or low >= 0:
            raise InputError(f"model: actuator {name!r}: found force range {low:g} {high:g}, expected -F 0: it pulls")
    pulled = model.actuator_trnid[:, 0] if model.nu else np.zeros(0, int)
    for tendon in ArmModel(model).cables:
        count = int(np.sum(pulled == tendon))
        if count != 1:
            raise InputError(f"model: tendon {model.tendon(tendon).name!r}: found {count} actuators, expected 1")
