"""Pictures in space: axes with one scale, shaded surfaces, thick lines."""

import numpy as np
from matplotlib.colors import to_rgb
from matplotlib.figure import Figure
from matplotlib.ticker import MaxNLocator
from mpl_toolkits.mplot3d import Axes3D
from mpl_toolkits.mplot3d.art3d import Line3DCollection, Poly3DCollection

from trunkline.kinematics.sdf.mesh import TriangleMesh
from trunkline.report.figures.style import BACKGROUND

LIGHT = np.array([0.35, -0.75, 0.55])  # towards the light


def space(figure: Figure, position: int, title: str) -> Axes3D:
    """Axes in m, at `position` (as 221) of `figure`."""
    axes = figure.add_subplot(position, projection="3d", computed_zorder=False)
    axes.set_title(title)
    axes.view_init(elev=18, azim=-60)
    axes.set_xlabel("x (m)", labelpad=8)
    axes.set_ylabel("y (m)", labelpad=8)
    axes.set_zlabel("z (m)", labelpad=10)
    for axis in (axes.xaxis, axes.yaxis, axes.zaxis):
        axis.pane.set_facecolor(BACKGROUND)
        axis.set_major_locator(MaxNLocator(5))
    return axes


def add_surface(axes: Axes3D, shape: TriangleMesh, color: str, alpha: float) -> None:
    """`shape` in `color`, lighter where it faces the light."""
    triangles = shape.vertices[shape.faces]
    normals = np.cross(triangles[:, 1] - triangles[:, 0], triangles[:, 2] - triangles[:, 0])
    normals /= np.maximum(np.linalg.norm(normals, axis=1, keepdims=True), 1e-15)
    light = 0.55 + 0.45 * np.clip(normals @ (LIGHT / np.linalg.norm(LIGHT)), -1, 1)
    shades = np.clip(np.array(to_rgb(color)) * (0.55 + 0.6 * light[:, None]), 0, 1)
    faces = np.column_stack([shades, np.full(len(shades), alpha)])
    axes.add_collection3d(Poly3DCollection(triangles, facecolors=faces, edgecolors="none", linewidths=0))


def add_line(axes: Axes3D, points: np.ndarray, color: str, width: float) -> None:
    """A thick line through `points` (P, 3), m, in front of the surfaces."""
    segments = np.stack([points[:-1], points[1:]], axis=1)
    axes.add_collection3d(Line3DCollection(segments, colors=color, linewidths=width, capstyle="round", zorder=5))
    axes.scatter(*points.T, color=color, s=3 * width, zorder=5, depthshade=False)


def frame(axes: Axes3D, vertices: list[np.ndarray]) -> None:
    """Limits around all `vertices`, (V, 3) each, m, with the same scale along every axis."""
    every = np.concatenate(vertices)
    lower, upper = every.min(axis=0), every.max(axis=0)
    axes.set(xlim=(lower[0], upper[0]), ylim=(lower[1], upper[1]), zlim=(lower[2], upper[2]))
    axes.set_box_aspect(upper - lower, zoom=0.85)  # room for the labels
