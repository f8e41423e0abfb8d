"""Pictures of the arm."""

import matplotlib.pyplot as plt
import mujoco
import numpy as np
from matplotlib.figure import Figure

from trunkline.elements import arm_hinges, cables
from trunkline.figures.style import IDENTIFIED, INITIAL, TENDON, UNIT, UNIT_EDGE


def arm_figure(model: mujoco.MjModel) -> Figure:
    """Side view of the straight arm with its tendons, and what each unit weighs and how stiffly it is held."""
    data = mujoco.MjData(model)
    mujoco.mj_forward(model, data)
    figure, (side, units) = plt.subplots(1, 2, figsize=(9, 4.5), width_ratios=[1, 2])
    for geom in range(model.ngeom):
        radius, half = model.geom_size[geom][:2]
        half = half or radius  # a ball
        x, z = data.geom_xpos[geom][[0, 2]]
        corners = np.array([[-radius, -half], [radius, -half], [radius, half], [-radius, half]])
        side.fill(*(corners + [x, z]).T * 1000, facecolor=UNIT, edgecolor=UNIT_EDGE, linewidth=0.6)
    for tendon in cables(model):
        path = slice(model.tendon_adr[tendon], model.tendon_adr[tendon] + model.tendon_num[tendon])
        sites = data.site_xpos[model.wrap_objid[path]]
        side.plot(sites[:, 0] * 1000, sites[:, 2] * 1000, color=TENDON, linewidth=0.8)
    side.set(aspect="equal", xlabel="x (mm)", ylabel="z (mm)", title="Side view")
    side.grid(False)
    jointed = np.unique(model.jnt_bodyid[: arm_hinges(model)])
    numbers = np.arange(1, len(jointed) + 1)
    first_hinge = model.body_jntadr[jointed]
    units.semilogy(numbers, model.body_mass[jointed] * 1000, "o-", color=IDENTIFIED, label="mass (g)")
    units.semilogy(
        numbers, model.jnt_stiffness[first_hinge], "s-", color=INITIAL, label="stiffness of its joint (N m/rad)"
    )
    moving = model.body_mass[jointed[0]:].sum()
    units.set(xlabel="unit, from the base", title=f"{len(numbers)} units, {moving:.2f} kg")
    units.legend()
    return figure
