"""A grasp as a row of pictures: the arm's units, the object and what it stands on, from the front and from above."""

from pathlib import Path

import numpy as np

from rehearsal.robot.rigid_object import RigidObject, rotation
from rehearsal.robot.shapes import BOX

CORNERS = np.array([(-1, -1), (-1, 1), (1, -1), (1, 1)])


def draw(trial, file: Path) -> None:
    """Write the trial's pictures, a column each: seen from the front (y, z) and from above (x, y)."""
    from matplotlib.figure import Figure

    pictures, scene = trial.pictures, trial.scene
    figure = Figure(figsize=(3.2 * len(pictures), 9))
    axes = figure.subplots(3, len(pictures), squeeze=False)
    lines = outline(trial.robot.object)
    middle = pictures[0][2].grip
    for column, (name, centres, truth) in enumerate(pictures):
        turn = np.array(rotation(truth.quaternion))
        for row, (a, b) in enumerate([(1, 2), (0, 2), (0, 1)]):
            plot = axes[row, column]
            for centre, width in zip(centres, trial.robot.arm.chain.widths, strict=True):
                plot.add_patch(_circle(centre[[a, b]], width / 2))
            for line in lines:
                points = line @ turn.T + truth.object
                plot.plot(points[:, a], points[:, b], "k", lw=0.8)
            for surface in scene.surfaces.values():
                top, size = np.array(surface.top), np.array(surface.size)
                x, y = [top[a] - size[a] / 2, top[a] + size[a] / 2], [top[b]] * 2
                if b == 2:
                    plot.plot(x, y, color="tab:brown", lw=3)
            plot.set_aspect("equal")
            plot.set_xlim(middle[a] - 0.3, middle[a] + 0.3)
            plot.set_ylim(middle[b] - 0.3, middle[b] + 0.35)
            plot.set_xlabel("xyz"[a] + " [m]")
            plot.set_ylabel("xyz"[b] + " [m]")
        axes[0, column].set_title(name)
    figure.subplots_adjust(left=0.04, right=0.99, bottom=0.05, top=0.96, wspace=0.3)
    file.parent.mkdir(parents=True, exist_ok=True)
    figure.savefig(file, dpi=70)


def outline(object: RigidObject) -> list[np.ndarray]:
    """Lines in the object's frame that show its shapes, m: two ends of each, and what joins them. Shapes (n, 3)."""
    angle = np.linspace(0, 2 * np.pi, 25)
    circle, square = np.column_stack([np.cos(angle), np.sin(angle)]), CORNERS[[0, 1, 3, 2, 0]]
    lines = []
    shapes = zip(object.kind, object.half, object.edge, object.shift, object.turn, strict=True)
    for kind, half, edge, shift, turn in shapes:
        ends = square if kind == BOX and half.any() else circle
        first, last = (np.column_stack([ends, np.full(len(ends), z)]) * (half + edge) for z in (-1, 1))
        quarter = (len(ends) - 1) // 4
        joined = [np.array(pair) for pair in zip(first[:-1:quarter], last[:-1:quarter], strict=True)]
        lines += [line @ turn.T + shift for line in (first, last, *joined)]
    return lines


def _circle(centre, radius):
    from matplotlib.patches import Circle

    return Circle(tuple(centre), radius, fill=False, color="tab:orange", lw=0.8)
