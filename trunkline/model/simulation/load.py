"""A load at the tip of some simulations of a batch, of a model that need not have a body for it."""

import mujoco
import numpy as np
from mujoco.batch import Batch
from scipy.spatial.transform import Rotation

from trunkline.frames import rotation_from_wxyz, wxyz_from_rotation
from trunkline.model.arm_model import ArmModel

INERTIAL = ("body_mass", "body_ipos", "body_iquat", "body_inertia")


def hang(batch: Batch, model: mujoco.MjModel, loads: np.ndarray, individual: tuple[str, ...] = ()) -> None:
    """Hang a point mass at the site `tip` of each simulation, on top of what the model carries there.

    The body that holds the site becomes the rigid composite of itself and the mass. What MuJoCo derives from masses
    when it compiles follows: stepping reads `dof_invweight0` and `tendon_invweight0`, by which friction and joint
    limits are softened, and `body_subtreemass`, for the point about which it sums inertia.

    Args:
        model: the one of the batch. loads: kg, one a simulation. Shape (B,).
        individual: names in `INERTIAL` that already differ by simulation; the others are first set to the model's.
    """
    for name in INERTIAL:
        if name not in individual:
            batch.expand(name)[:] = getattr(model, name)
    site = ArmModel(model).tip_site
    body, chosen = model.site_bodyid[site], np.flatnonzero(loads)
    masses, centres, turns, inertias = (batch.expand(name)[chosen, body] for name in INERTIAL)
    together = masses + loads[chosen]
    arm = model.site_pos[site] - centres
    axes = rotation_from_wxyz(turns).as_matrix()
    reduced = masses * loads[chosen] / together  # kg; about the common centre, two masses turn as this one at `arm`
    parallel = np.sum(arm**2, axis=1)[:, None, None] * np.eye(3) - arm[:, :, None] * arm[:, None, :]
    tensor = np.einsum("nij,nj,nkj->nik", axes, inertias, axes) + reduced[:, None, None] * parallel
    principal, axes = np.linalg.eigh(tensor)
    axes[:, :, 0] *= np.linalg.det(axes)[:, None]
    composite = (
        together,
        centres + (loads[chosen] / together)[:, None] * arm,
        wxyz_from_rotation(Rotation.from_matrix(axes)),
        principal,
    )
    for name, values in zip(INERTIAL, composite, strict=True):
        batch.expand(name)[chosen, body] = values
    # else MuJoCo takes the centre and the axes of mass for where they were compiled to be
    batch.expand("body_sameframe")[chosen, body] = mujoco.mjtSameFrame.mjSAMEFRAME_NONE
    batch.set_const()

