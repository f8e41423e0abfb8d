"""Pictures of the maps: in space, in slices, and how well blending between gravity angles holds."""

import matplotlib.pyplot as plt
import numpy as np
import pandas as pd
from matplotlib.colors import to_rgb
from matplotlib.figure import Figure
from matplotlib.ticker import MaxNLocator
from mpl_toolkits.mplot3d.art3d import Line3DCollection, Poly3DCollection
from numpy.typing import NDArray

from trunkline.fields.mesh import Surface
from trunkline.figures.style import IDENTIFIED, INITIAL, MEASURED, VALIDATE
from trunkline.panda.inverse import solve
from trunkline.panda.kinematics import DH_A, FLANGE, joint_frames
from trunkline.reachability.checks import Check
from trunkline.reachability.maps import Maps

SUN = np.array([0.35, -0.75, 0.55])  # towards the light
POSE = (0.45, 0.0, 0.55)  # m, where the drawn Panda holds the mount
RIGID, SOFT, HYBRID = IDENTIFIED, INITIAL, VALIDATE
WIDEST_SHOWN = 1.0  # m, of the label points: those in the corners of their box say little
GRAVITY_ARROW = 0.7  # of the arm's length
SLICES = 5  # gravity angles in the slice of the soft maps
GOAL_IOU = 0.95
SHOWN_DEG = (0.0, 60.0, 120.0)  # gravity angles of the paper's figure


def maps_figure(maps: Maps, tips: list[NDArray]) -> Figure:
    """The paper's figure: (a) rigid, (b) soft along gravity, (c) soft at three angles, (d) hybrid on the robot.

    Args:
        tips: of the soft arm (N, 3), m, at each of the ``maps.soft.mesh_angles``, the first of which is 0.
    """
    figure = plt.figure(figsize=(12, 11))
    arm = panda_line(maps.mount_offset, maps.self_collision)
    length = float(np.linalg.norm(tips[0], axis=1).max())
    mount = np.array(POSE)

    a = _space(figure, 221, "(a) Panda, end effector straight down")
    _add_surface(a, maps.rigid.mesh, RIGID, 0.30)
    _add_line(a, arm, MEASURED, 5)
    _frame(a, [maps.rigid.mesh.vertices])

    nearest = [int(np.abs(maps.soft.mesh_angles - np.radians(d)).argmin()) for d in SHOWN_DEG]
    b = _space(figure, 222, f"(b) Soft arm, gravity at {np.degrees(maps.soft.mesh_angles[nearest[0]]):.0f}°")
    b.yaxis.set_major_locator(MaxNLocator(3))
    _add_surface(b, maps.soft.meshes[nearest[0]], SOFT, 0.35)
    _add_line(b, np.array([[0, 0, 0], [0, 0, -length]]), MEASURED, 4)
    _frame(b, [maps.soft.meshes[nearest[0]].vertices, np.zeros((1, 3))])

    c = _space(figure, 223, "(c) Soft arm, gravity at " + ", ".join(
        f"{np.degrees(maps.soft.mesh_angles[i]):.0f}°" for i in sorted(set(nearest))))
    c.view_init(elev=12, azim=-80)
    c.yaxis.set_major_locator(MaxNLocator(2))
    for index, color in zip(sorted(set(nearest)), (SOFT, VALIDATE, IDENTIFIED), strict=False):
        _add_surface(c, maps.soft.meshes[index], color, 0.40)
        _add_gravity(c, maps.soft.mesh_angles[index], length, color)
    _add_line(c, np.array([[0, 0, 0.06], [0, 0, 0]]), MEASURED, 6)
    arrows = [GRAVITY_ARROW * length * _down(maps.soft.mesh_angles[i])[None] for i in nearest]
    _frame(c, [maps.soft.meshes[i].vertices for i in nearest] + arrows)

    d = _space(figure, 224, "(d) Both: soft tip, soft arm hanging from the Panda")
    _add_surface(d, maps.hybrid.mesh, HYBRID, 0.22)
    soft = maps.soft.meshes[nearest[0]]
    _add_surface(d, Surface(soft.vertices + mount, soft.faces), SOFT, 0.5)
    _add_line(d, arm, MEASURED, 4)
    _frame(d, [maps.hybrid.mesh.vertices])
    return figure


def slices_figure(maps: Maps, tips: list[NDArray], check: Check) -> Figure:
    """Slices through y = 0 with what they were checked against: labels, tips; and the hybrid around the rigid map."""
    figure, (rigid, soft, hybrid) = plt.subplots(1, 3, figsize=(14, 5.7))
    _fill_slice(rigid, maps.rigid, RIGID)
    radius = np.hypot(check.points[:, 0], check.points[:, 1]) * np.where(check.points[:, 0] < 0, -1, 1)
    for right, mark, size in ((True, ".", 3), (False, "x", 40)):
        for reached, color in ((True, IDENTIFIED), (False, "#999999")):
            rows = (check.reachable == reached) & ((check.claimed == check.reachable) == right)
            name = ("reached" if reached else "not reached") + ("" if right else ", map wrong")
            rigid.scatter(radius[rows], check.points[rows, 2], s=size, marker=mark, zorder=3,
                          color=color if right else INITIAL, label=f"{name} ({rows.sum()})")
    rigid.legend(loc="upper center", bbox_to_anchor=(0.5, -0.16), ncols=2, fontsize=8, markerscale=1.5)
    rigid.set(title=f"Rigid: {100 * check.rigid.accuracy:.1f} % of labels agree", xlabel="±radius (m)", ylabel="z (m)")

    shown = np.unique(np.linspace(0, len(tips) - 1, SLICES).round().astype(int))
    colors = plt.get_cmap("viridis")(np.linspace(0, 0.9, len(shown)))
    x, y, z = maps.soft.lattice.axes()
    middle = int(np.abs(y).argmin())
    for index, color in zip(shown, colors, strict=True):
        angle = float(maps.soft.mesh_angles[index])
        soft.contour(x, z, maps.soft.at(angle)[:, middle].T, levels=[0.0], colors=[color], linewidths=1.4)
        near = tips[index][np.abs(tips[index][:, 1]) < maps.soft.lattice.spacing / 2]
        soft.scatter(near[:, 0], near[:, 2], s=2, color=color, label=f"{np.degrees(angle):.0f}°")
    soft.plot(0, 0, "k^", markersize=8)
    soft.legend(loc="upper center", bbox_to_anchor=(0.5, -0.16), ncols=5, fontsize=8, markerscale=4,
                title="lines: maps, dots: tips, at gravity angle")
    soft.set(title="Soft: the shell of its tips", xlabel="x (m)", ylabel="z (m)")

    _fill_slice(hybrid, maps.hybrid, HYBRID)
    x, y, z = maps.rigid.lattice.axes()
    rigid_slice = maps.rigid.field[:, int(np.abs(y).argmin())].T
    hybrid.contour(x, z, rigid_slice, levels=[0.0], colors=[RIGID], linewidths=1.5)
    hybrid.plot([], [], color=RIGID, label="mount (rigid map)")
    hybrid.plot([], [], color=HYBRID, linewidth=6, alpha=0.6, label="soft tip (hybrid map)")
    for one, style in zip(maps.tilted, ("--", ":", "-."), strict=False):
        x, y, z = one.lattice.axes()
        hybrid.contour(x, z, one.field[:, int(np.abs(y).argmin())].T, levels=[0.0], colors=[INITIAL], linestyles=style)
        hybrid.plot([], [], style, color=INITIAL, label=f"soft tip, tilted by {np.degrees(one.tilt):.0f}°")
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
    """The soft maps at gravity angles without a grid.

    Args:
        heldout: columns ``angle_deg``, ``iou``, ``reachable``, ``beyond``.
        beyond: m, how far from every tip the points beyond reach are.
    """
    figure, (left, right) = plt.subplots(1, 2, figsize=(10, 3.6))
    left.plot(heldout["angle_deg"], heldout["iou"], "o-", color=IDENTIFIED, markersize=4)
    left.axhline(GOAL_IOU, color=VALIDATE, linestyle="--", label=f"goal, {GOAL_IOU:g}")
    left.set(ylim=(0.93, 1), ylabel="IoU", title="Blended map against the angle's own")
    for name, color, label in (
        ("reachable", IDENTIFIED, "tips"), ("beyond", INITIAL, f"points {1e3 * beyond:.0f} mm from every tip")
    ):
        right.plot(heldout["angle_deg"], 100 * heldout[name], "o-", color=color, markersize=4, label=label)
    right.set(ylim=(-3, 103), ylabel="called reachable (%)", title="The signal that a headset shows")
    for ax, place in ((left, "lower right"), (right, "center right")):
        ax.set_xlabel("gravity angle, half-way between grids (°)")
        ax.legend(loc=place)
    return figure


def panda_line(mount_offset: float, avoid_collisions: bool) -> NDArray:
    """Polyline (P, 3) in m along the links of a Panda that holds the mount at ``POSE``, pointing down."""
    found = solve(np.array([POSE]), seed=1, starts=200, mount_offset=mount_offset, avoid_collisions=avoid_collisions)
    frames = joint_frames(found.q)
    shoulder, elbow, wrist, hand = (frames[i].p[:, 0] for i in (0, 3, 5, 6))
    upper_end = frames[2].p[:, 0]
    forearm_start = elbow + DH_A[4] * frames[3].x[:, 0]
    mount = hand + (FLANGE + mount_offset) * frames[6].z[:, 0]
    return np.array([[0, 0, 0], shoulder, upper_end, elbow, forearm_start, wrist, hand, mount])


def _space(figure: Figure, position: int, title: str):
    axes = figure.add_subplot(position, projection="3d", computed_zorder=False)
    axes.set_title(title)
    axes.view_init(elev=18, azim=-60)
    axes.set_xlabel("x (m)", labelpad=8)
    axes.set_ylabel("y (m)", labelpad=8)
    axes.set_zlabel("z (m)", labelpad=10)
    for axis in (axes.xaxis, axes.yaxis, axes.zaxis):
        axis.pane.set_facecolor("white")
        axis.set_major_locator(MaxNLocator(5))
    return axes


def _add_surface(axes, shape: Surface, color: str, alpha: float) -> None:
    triangles = shape.vertices[shape.faces]
    normals = np.cross(triangles[:, 1] - triangles[:, 0], triangles[:, 2] - triangles[:, 0])
    normals /= np.maximum(np.linalg.norm(normals, axis=1, keepdims=True), 1e-15)
    light = 0.55 + 0.45 * np.clip(normals @ (SUN / np.linalg.norm(SUN)), -1, 1)
    shades = np.clip(np.array(to_rgb(color)) * (0.55 + 0.6 * light[:, None]), 0, 1)
    faces = np.column_stack([shades, np.full(len(shades), alpha)])
    axes.add_collection3d(Poly3DCollection(triangles, facecolors=faces, edgecolors="none", linewidths=0))


def _add_line(axes, points: NDArray, color: str, width: float) -> None:
    segments = np.stack([points[:-1], points[1:]], axis=1)
    axes.add_collection3d(Line3DCollection(segments, colors=color, linewidths=width, capstyle="round", zorder=5))
    axes.scatter(*points.T, color=color, s=3 * width, zorder=5, depthshade=False)


def _add_gravity(axes, angle: float, length: float, color: str) -> None:
    arrow = GRAVITY_ARROW * length * _down(angle)
    axes.quiver(0, 0, 0, *arrow, color=color, linewidth=2, arrow_length_ratio=0.08, zorder=6)


def _down(angle: float) -> NDArray:
    return np.array([np.sin(angle), 0.0, -np.cos(angle)])


def _frame(axes, vertices: list[NDArray]) -> None:
    every = np.concatenate(vertices)
    lower, upper = every.min(axis=0), every.max(axis=0)
    axes.set(xlim=(lower[0], upper[0]), ylim=(lower[1], upper[1]), zlim=(lower[2], upper[2]))
    axes.set_box_aspect(upper - lower, zoom=0.85)  # room for the labels


def _fill_slice(axes, one, color: str) -> None:
    x, y, z = one.lattice.axes()
    values = one.field[:, int(np.abs(y).argmin())].T
    axes.contourf(x, z, values, levels=[values.min() - 1, 0.0], colors=[color], alpha=0.25)
    axes.contour(x, z, values, levels=[0.0], colors=[color], linewidths=1.5)
