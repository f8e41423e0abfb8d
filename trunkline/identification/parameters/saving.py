"""What was identified back into the MJCF that it came from: every field that a parameter writes has its place there."""

import mujoco
import numpy as np

from trunkline.identification.parameters.parameters import EVERY_NAME, PARAMETERS, PER_JOINT, parameter_named

# shape at rest, where diagonals are slack in it, and markers: measured rather than searched for
STRUCTURE = ("qpos_spring", "tendon_lengthspring", "site_pos")

# prefix of an MjModel field → what it belongs to in MJCF, and the field's row for the element of that number
ELEMENTS = {
    "jnt": ("joint", lambda model, index: index),
    "dof": ("joint", lambda model, index: model.jnt_dofadr[index]),
    "qpos": ("joint", lambda model, index: model.jnt_qposadr[index]),
    "body": ("body", lambda model, index: index),
    "geom": ("geom", lambda model, index: index),
    "site": ("site", lambda model, index: index),
    "tendon": ("tendon", lambda model, index: index),
    "actuator": ("actuator", lambda model, index: index),
    "numeric": ("numeric", lambda model, index: model.numeric_adr[index] + np.arange(model.numeric_size[index])),
}

# MjModel fields that MJCF holds under another name, or as some of an attribute's numbers
PLACES = {
    "jnt_stiffness": ("stiffness", 0),
    "jnt_stiffnesspoly": ("stiffness", slice(1, None)),
    "jnt_solref": ("solref_limit", slice(None)),
    "jnt_solimp": ("solimp_limit", slice(None)),
    "dof_damping": ("damping", 0),
    "dof_dampingpoly": ("damping", slice(1, None)),
    "dof_solref": ("solref_friction", slice(None)),
    "dof_solimp": ("solimp_friction", slice(None)),
    "qpos_spring": ("springref", slice(None)),
    "tendon_stiffness": ("stiffness", 0),
    "tendon_stiffnesspoly": ("stiffness", slice(1, None)),
    "tendon_damping": ("damping", 0),
    "tendon_lengthspring": ("springlength", slice(None)),
    "tendon_solref_fri": ("solref_friction", slice(None)),
    "tendon_solimp_fri": ("solimp_friction", slice(None)),
}


def save_model(spec: mujoco.MjSpec, model: mujoco.MjModel) -> str:
    """MJCF of `spec` with what may have been identified in `model`, which was compiled from it.

    Only what differs is written, so that the rest stays as it was typed.

    Raises:
        ValueError: naming the field of a parameter that has no place in MJCF.
    """
    before = spec.compile()
    if not np.array_equal(before.body_mass, model.body_mass):
        _state_masses(spec, model)
    fields = {field for name in (*PARAMETERS, *EVERY_NAME) for field in parameter_named(name).fields}
    fields |= {field for names, _ in PER_JOINT.values() for field in names}
    for field in sorted(fields | set(STRUCTURE)):
        prefix, _, name = field.partition("_")
        if prefix not in ELEMENTS:
            raise ValueError(f"{field}: found no place for it in MJCF, expected a field of {', '.join(ELEMENTS)}")
        kind, row_of = ELEMENTS[prefix]
        attribute, part = PLACES.get(field, (name, slice(None)))
        old, new = getattr(before, field), getattr(model, field)
        for element in getattr(spec, "bodies" if kind == "body" else f"{kind}s"):
            row = row_of(model, element.id)
            if not np.array_equal(old[row], new[row]):
                _write(element, attribute, part, new[row])
    return spec.to_xml()


def _state_masses(spec: mujoco.MjSpec, model: mujoco.MjModel) -> None:
    """Let bodies have the masses of `model`, whatever follows from geoms or from a total mass in the file."""
    spec.compiler.settotalmass, spec.compiler.inertiafromgeom = -1, mujoco.mjtInertiaFromGeom.mjINERTIAFROMGEOM_AUTO
    for body in spec.bodies:
        if model.body_mass[body.id]:
            body.explicitinertial, body.fullinertia = True, np.full(6, np.nan)
            body.mass, body.inertia = model.body_mass[body.id], model.body_inertia[body.id]
            body.ipos, body.iquat = model.body_ipos[body.id], model.body_iquat[body.id]


def _write(element, attribute: str, part: int | slice, value: np.ndarray) -> None:
    array = getattr(element, attribute)
    if isinstance(array, np.ndarray):
        array[part] = value
    else:
        setattr(element, attribute, value)
