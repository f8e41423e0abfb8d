"""Pictures of the maps: in space, in slices, and how well blending between gravity angles holds."""

import matplotlib.pyplot as plt
import numpy as np
import pandas as pd
from matplotlib.figure import Figure
from matplotlib.ticker import MaxNLocator

from trunkline.kinematics.reachability.checks import Check
from trunkline.kinematics.reachability.maps import Maps
from trunkline.kinematics.sdf.mesh import Surface
from trunkline.report.figures.panda import POSE, panda_line
from trunkline.report.figures.space import add_line, add_surface, frame, space
from trunkline.report.figures.style import (
    BASE,
    DOUBTFUL,
    HYBRID,
    IDENTIFIED,
    INITIAL,
    MEASURED,
    RIGID,
    SEQUENTIAL,
    SOFT,
    VALIDATE,
)

WIDEST_SHOWN = 1.0  # m, of the label points: those in the corners of their box say little
GRAVITY_ARROW = 0.7  # of the arm's length
SLICES = 5  # gravity angles in the slice of the soft maps
GOAL_IOU = 0.95
SHOWN_DEG = (0.0, 60.0, 120.0)  # gravity angles of the paper's figure


def maps_figure(maps: Maps, tips: list[np.ndarray]) -> Figure:
    """The paper's figure: (a) rigid, (b) soft along gravity, (c) soft at three angles, (d) hybrid on the robot.

    Args:
        tips: of the soft arm (N, 3), m, at each of the `maps.soft.mesh_angles`, the first of which is 0.
    """
    figure = plt.figure(figsize=(12, 11))
    arm = panda_line(maps.mount_offset, maps.self_collision)
    length = float(np.linalg.norm(tips[0], axis=1).max())
    mount = np.array(POSE)

    a = space(figure, 221, "(a) Panda, end effector straight down")
    add_surface(a, maps.rigid.mesh, RIGID, 0.30)
    add_line(a, arm, MEASURED, 5)
    frame(a, [maps.rigid.mesh.vertices])

    nearest = [int(np.abs(maps.soft.mesh_angles - np.radians(d)).argmin()) for d in SHOWN_DEG]
    b = space(figure, 222, "(b) Soft arm" + _under(maps, nearest[:1]))
    b.yaxis.set_major_locator(MaxNLocator(3))
    add_surface(b, maps.soft.meshes[nearest[0]], SOFT, 0.35)
    add_line(b, np.array([[0, 0, 0], [0, 0, -length]]), MEASURED, 4)
    frame(b, [maps.soft.meshes[nearest[0]].vertices, np.zeros((1, 3))])

    under = _under(maps, sorted(set(nearest)))
    c = space(figure, 223, "(c) Soft arm" + (under or ", seen from the front"))
    c.view_init(elev=12, azim=-80)
    c.yaxis.set_major_locator(MaxNLocator(2))
    for index, color in zip(sorted(set(nearest)), (SOFT, VALIDATE, IDENTIFIED), strict=False):
        add_surface(c, maps.soft.meshes[index], color, 0.40)
        if len(set(nearest)) > 1:
            _add_gravity(c, maps.soft.mesh_angles[index], length, color)
    add_line(c, np.array([[0, 0, 0.06], [0, 0, 0]]), MEASURED, 6)
    arrows = [GRAVITY_ARROW * length * _down(maps.soft.mesh_angles[i])[None] for i in nearest]
    frame(c, [maps.soft.meshes[i].vertices for i in nearest] + arrows)

    d = space(figure, 224, "(d) Both: soft tip, soft arm hanging from the Panda")
    add_surface(d, maps.hybrid.mesh, HYBRID, 0.22)
    soft = maps.soft.meshes[nearest[0]]
    add_surface(d, Surface(soft.vertices + mount, soft.faces), SOFT, 0.5)
    add_line(d, arm, MEASURED, 4)
    frame(d, [maps.hybrid.mesh.vertices])
    return figure


def slices_figure(maps: Maps, tips: list[np.ndarray], check: Check) -> Figure:
    """Slices through y = 0 with what they were checked against: labels, tips; and the hybrid around the rigid map."""
    figure, (rigid, soft, hybrid) = plt.subplots(1, 3, figsize=(14, 5.7))
    _fill_slice(rigid, maps.rigid, RIGID)
    radius = np.hypot(check.points[:, 0], check.points[:, 1]) * np.where(check.points[:, 0] < 0, -1, 1)
    for right, mark, size in ((True, ".", 3), (False, "x", 40)):
        for reached, color in ((True, IDENTIFIED), (False, DOUBTFUL)):
            rows = (check.reachable == reached) & ((check.claimed == check.reachable) == right)
            name = ("reached" if reached else "not reached") + ("" if right else ", map wrong")
            rigid.scatter(
                radius[rows],
                check.points[rows, 2],
                s=size,
                marker=mark,
                zorder=3,
                color=color if right else INITIAL,
                label=f"{name} ({rows.sum()})",
            )
    rigid.legend(loc="upper center", bbox_to_anchor=(0.5, -0.16), ncols=2, fontsize=8, markerscale=1.5)
    rigid.set(title=f"Rigid: {100 * check.rigid.accuracy:.1f} % of labels agree", xlabel="±radius (m)", ylabel="z (m)")

    drawn = np.unique(np.linspace(0, len(tips) - 1, SLICES).round().astype(int))
    colors = plt.get_cmap(SEQUENTIAL)(np.linspace(0, 0.9, len(drawn)))
    x, y, z = maps.soft.lattice.axes()
    middle = int(np.abs(y).argmin())
    for index, color in zip(drawn, colors, strict=True):
        angle = float(maps.soft.mesh_angles[index])
        soft.contour(x, z, maps.soft.at(angle)[:, middle].T, levels=[0.0], colors=[color], linewidths=1.4)
        near = tips[index][np.abs(tips[index][:, 1]) < maps.soft.lattice.spacing / 2]
        label = f"{np.degrees(angle):.0f}°" if len(drawn) > 1 else "no gravity"
        soft.scatter(near[:, 0], near[:, 2], s=2, color=color, label=label)
    soft.plot(0, 0, "^", color=BASE, markersize=8)
    soft.legend(
        loc="upper center",
        bbox_to_anchor=(0.5, -0.16),
        ncols=5,
        fontsize=8,
        markerscale=4,
        title="lines: maps, dots: tips" + (", at gravity angle" if len(drawn) > 1 else ""),
    )
    soft.set(title="Soft: the shell of its tips", xlabel="x (m)", ylabel="z (m)")

    _fill_slice(hybrid, maps.hybrid, HYBRID)
    x, y, z = maps.rigid.lattice.axes()
    rigid_slice = maps.rigid.field[:, int(np.abs(y).argmin())].T
    hybrid.contour(x, z, rigid_slice, levels=[0.0], colors=[RIGID], linewidths=1.5)
    hybrid.plot([], [], color=RIGID, label="mount (rigid map)")
    hybrid.plot([], [], color=HYBRID, linewidth=6, alpha=0.6, label="soft tip (hybrid map)")
    for tilt, style in zip(maps.tilted, ("--", ":", "-."), strict=False):
        x, y, z = tilt.lattice.axes()
        tilted_slice = tilt.field[:, int(np.abs(y).argmin())].T
        hybrid.contour(x, z, tilted_slice, levels=[0.0], colors=[INITIAL], linestyles=style)
        hybrid.plot([], [], style, color=INITIAL, label=f"soft tip, tilted by {np.degrees(tilt.tilt):.0f}°")
    arm = panda_line(maps.mount_offset, maps.self_collision)
    hybrid.plot(arm[:, 0], arm[:, 2], color=MEASURED, linewidth=3, label="Panda")
    hybrid.legend(loc="upper center", bbox_to_anchor=(0.5, -0.16), ncols=2, fontsize=8)
    inside = 100 * check.found["hybrid"][0]
    hybrid.set(title=f"Hybrid: poses found for {inside:.1f} % inside", xlabel="x (m)", ylabel="z (m)")
    rigid.set_xlim(-WIDEST_SHOWN, WIDEST_SHOWN)
    for axes in (rigid, soft, hybrid):
        axes.set_aspect("equal")
        axes.xaxis.set_major_locator(MaxNLocator(5))
    return figure


def heldout_figure(heldout: pd.DataFrame, beyond: float) -> Figure:
    """The soft maps under gravities without one; without gravity, the map against tips that it was not made of.

    Args:
        heldout: columns `angle_deg`, all 0 without gravity, `iou`, `reachable`, `beyond`.
        beyond: m, how far from every tip the points beyond reach are.
    """
    figure, (left, right) = plt.subplots(1, 2, figsize=(10, 3.8))
    tilted = bool(heldout["angle_deg"].any())
    left.plot(heldout["angle_deg"], heldout["iou"], "o-", color=IDENTIFIED, markersize=4)
    if tilted:  # otherwise the other tips are fewer, so their map is smaller
        left.axhline(GOAL_IOU, color=VALIDATE, linestyle="--", label=f"goal, {GOAL_IOU:g}")
        left.legend(loc="lower right")
    title = "Map in between against gravity's own" if tilted else "Map against that of other tips"
    left.set(ylim=(min(0.93, heldout["iou"].min() - 0.01), 1), ylabel="IoU", title=title)
    for name, color, label in (
        ("reachable", IDENTIFIED, "tips"), ("beyond", INITIAL, f"points {1e3 * beyond:.0f} mm from every tip")
    ):  # fmt: skip
        right.plot(heldout["angle_deg"], 100 * heldout[name], "o-", color=color, markersize=4, label=label)
    right.set(ylim=(-3, 103), ylabel="called reachable (%)", title="The signal that a headset shows")
    right.legend(loc="center right")
    for ax in (left, right):
        if tilted:
            ax.set_xlabel("gravity angle, between the maps (°)")
        else:
            ax.set_xticks([0], ["no gravity"])
    return figure


def _under(maps: Maps, drawn: list[int]) -> str:
    """Which gravity the soft maps `shown` are for; nothing where there is none."""
    if len(maps.soft.mesh_angles) == 1:
        return ""
    return ", gravity at " + ", ".join(f"{np.degrees(maps.soft.mesh_angles[i]):.0f}°" for i in drawn)


def _add_gravity(axes, angle: float, length: float, color: str) -> None:
    arrow = GRAVITY_ARROW * length * _down(angle)
    axes.quiver(0, 0, 0, *arrow, color=color, linewidth=2, arrow_length_ratio=0.08, zorder=6)


def _down(angle: float) -> np.ndarray:
    return np.array([np.sin(angle), 0.0, -np.cos(angle)])


def _fill_slice(axes, reach_map, color: str) -> None:
    x, y, z = reach_map.lattice.axes()
    values = reach_map.field[:, int(np.abs(y).argmin())].T
    axes.contourf(x, z, values, levels=[values.min() - 1, 0.0], colors=[color], alpha=0.25)
    axes.contour(x, z, values, levels=[0.0], colors=[color], linewidths=1.5)
