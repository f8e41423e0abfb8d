"""Pictures of the arm."""

import matplotlib.pyplot as plt
import mujoco
import numpy as np
from matplotlib.axes import Axes
from matplotlib.figure import Figure
from matplotlib.ticker import MaxNLocator

from trunkline.model.arm_model import TIP_LOAD, ArmModel
from trunkline.report.figures.style import IDENTIFIED, INITIAL, TENDON, UNIT, UNIT_EDGE, VALIDATE

SLIMMEST = 0.2  # half of the side view's width over its height: ticks need room


def arm_figure(model: mujoco.MjModel) -> Figure:
    """Side view of the straight arm with its tendons and tracked points, and what each unit weighs and how stiffly it
    is held."""
    data = mujoco.MjData(model)
    mujoco.mj_forward(model, data)
    figure = plt.figure(figsize=(9, 5))
    panels = figure.subplot_mosaic([["side", "mass"], ["side", "stiffness"]], width_ratios=[1, 2])
    side, mass, stiffness = (panels[name] for name in ("side", "mass", "stiffness"))
    _side_view(side, model, data)
    jointed = ArmModel(model).unit_bodies
    numbers = np.arange(1, len(jointed) + 1)
    mass.plot(numbers, model.body_mass[jointed] * 1000, "o-", color=IDENTIFIED)
    stiffness.plot(numbers, model.jnt_stiffness[model.body_jntadr[jointed]], "s-", color=INITIAL)
    whole = model.body_mass[jointed].sum()
    mass.set(ylabel="mass of the\nunit (g)", title=f"{len(numbers)} units, {_in_words(whole)}")
    stiffness.set(xlabel="unit, from the base", ylabel="stiffness of its\njoint (N m/rad)")
    for panel in (mass, stiffness):
        values = panel.lines[0].get_ydata()
        if np.max(values) > 10 * np.min(values) > 0:
            panel.set_yscale("log")
        else:
            panel.set_ylim(0, 1.15 * np.max(values) or 1)
        panel.xaxis.set_major_locator(MaxNLocator(integer=True))
    return figure


def _side_view(side: Axes, model: mujoco.MjModel, data: mujoco.MjData) -> None:
    for geom in range(model.ngeom):
        radius, half = model.geom_size[geom][:2]
        half = half or radius  # a ball
        x, z = data.geom_xpos[geom][[0, 2]]
        corners = np.array([[-radius, -half], [radius, -half], [radius, half], [-radius, half]])
        body = model.body(model.geom_bodyid[geom])
        load = body.name == TIP_LOAD
        face, label = (VALIDATE, f"load, {_in_words(body.mass[0])}") if load else (UNIT, None)
        side.fill(*(corners + [x, z]).T * 1000, facecolor=face, edgecolor=UNIT_EDGE, linewidth=0.6, label=label)
    arm = ArmModel(model)
    for number, cable in enumerate(arm.cables):
        sites = data.site_xpos[arm.cable_sites(cable)]
        label = None if number else "tendons"
        side.plot(sites[:, 0] * 1000, sites[:, 2] * 1000, color=TENDON, linewidth=0.8, label=label)
    tracked = tracked_points(model)
    places = 1000 * data.site_xpos[tracked]
    side.plot(places[:, 0], places[:, 2], "o", color=IDENTIFIED, markersize=4, label="tracked points")
    side.set(aspect="equal", xlabel="x (mm)", ylabel="z (mm)", title="Side view")
    wide = max(np.abs(side.get_xlim()).max(), SLIMMEST * np.ptp(side.get_ylim()))
    side.set_xlim(-wide, wide)
    side.xaxis.set_major_locator(MaxNLocator(2))
    side.grid(False)
    side.legend(loc="upper center", bbox_to_anchor=(0.5, -0.13), fontsize=8)


def tracked_points(model: mujoco.MjModel) -> list[int]:
    """Numbers of the sites to draw as tracked: those that the description names, or else the units' centres."""
    arm = ArmModel(model)
    return arm.marker_sites([name for name in arm.markers if not name.startswith("unit_")] or arm.markers).tolist()


def _in_words(mass: float) -> str:
    """A mass, kg, with its unit."""
    return f"{mass:.3g} kg" if mass >= 1 else f"{1000 * mass:.3g} g"
