"""Where the markers of a straight arm are, for what compares recordings with it."""

import mujoco
import numpy as np

from trunkline.model.arm_model import CENTER


def marker_places(model: mujoco.MjModel) -> dict[str, np.ndarray]:
    """Where markers are on the straight arm, m in the base frame, each of shape (3,), by name; none without a base."""
    data = mujoco.MjData(model)
    mujoco.mj_kinematics(model, data)
    names = [model.site(number).name for number in range(model.nsite)]
    sites = {name.removesuffix(CENTER): number for number, name in enumerate(names) if name.endswith(CENTER)}
    base = sites.pop("base", None)
    if base is None:
        return {}
    turn = data.site_xmat[base].reshape(3, 3)
    return {name: (data.site_xpos[site] - data.site_xpos[base]) @ turn for name, site in sites.items()}
