"""A soft arm gets shorter under its tendons: at rest each unit by the tension that passes it, over its EA.

    ε_i = Σ_t s_it T_t / EA_i

s_it: the share of unit i along which tendon t runs to where it is anchored. MJCF has no such thing: for given tensions
the arm is a model with shorter units. Its weight, which is in the straight arm's length already, is left out.
"""

import mujoco
import numpy as np

from trunkline.model.arm_model import ArmModel

ALONG = 2  # units lie along z of their bodies
MOST = 0.5  # of a unit's length, to which no elastomer is pressed; a search may ask for more
PLACES = {"body_pos": "body_parentid", "body_ipos": None, "jnt_pos": "jnt_bodyid", "site_pos": "site_bodyid"}


def shares(model: mujoco.MjModel) -> np.ndarray:
    """s, by how much of each unit's length each cable shortens it. Shape (n, K)."""
    arm = ArmModel(model)
    bodies = arm.unit_bodies
    ends = np.append(model.body_pos[bodies[1:], ALONG], model.site_pos[arm.tip_site, ALONG])
    passed = np.zeros((len(bodies), len(arm.cables)))
    for number, cable in enumerate(arm.cables):
        first, last = arm.cable_sites(cable)[[0, -1]]
        above, below = (_unit(model, model.site_bodyid[site]) for site in (first, last))
        passed[above + 1 : below + 1, number] = 1.0
        passed[below, number] = model.site_pos[last, ALONG] / ends[below]
        if above >= 0:
            passed[above, number] = 1 - model.site_pos[first, ALONG] / ends[above]
    return passed


def shorten(model: mujoco.MjModel, straight: mujoco.MjModel, tensions: np.ndarray) -> None:
    """Give `model`, in place, the places along its units that `straight`, the same arm, has where its motors are sent
    `tensions`, N (K,)."""
    arm = ArmModel(straight)
    pulled = np.clip(tensions, 0, -straight.actuator_forcerange[arm.actuators, 0])
    strain = np.clip(shares(straight) @ pulled / arm.axial_stiffness, 0, MOST)
    factors = np.append(1 - strain, 1.0)  # the last is that of all that no unit holds
    units = np.array([_unit(straight, body) for body in range(straight.nbody)])
    for name, owners in PLACES.items():
        owner = np.arange(straight.nbody) if owners is None else getattr(straight, owners)
        places = getattr(straight, name).copy()
        places[:, ALONG] *= factors[units[owner]]
        getattr(model, name)[:] = places


def shortened(model: mujoco.MjModel, tensions: np.ndarray) -> mujoco.MjModel:
    """The arm under `tensions`, N (K,): a copy, or `model` itself if its units keep their lengths."""
    if not len(ArmModel(model).axial_stiffness):
        return model
    short = model.__copy__()
    shorten(short, model, tensions)
    return short


def _unit(model: mujoco.MjModel, body: int) -> int:
    """Number, from 0, of the unit to which a body is welded, -1 for none."""
    at = np.flatnonzero(ArmModel(model).unit_bodies == model.body_weldid[body])
    return int(at[0]) if len(at) else -1
