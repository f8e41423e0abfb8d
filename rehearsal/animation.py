"""One run of each experiment as an animation, and a still of all of them."""

from pathlib import Path

import numpy as np

from rehearsal.experiments.bench import SharedRun, perform
from rehearsal.experiments.registry import EXPERIMENTS
from rehearsal.film import SHOTS_PER_SECOND, Shot, filmed
from trunkline.frames import rotation_from_wxyz

AZIMUTH, ELEVATION = np.radians(-58), np.radians(22)  # from where it is seen
SHOWN = ((-0.53, 1.05), (-0.44, 0.9))  # m, of the picture's plane
GROUND = np.array([(-0.2, -0.65, -0.1), (0.8, -0.65, -0.1), (0.8, 0.65, -0.1), (-0.2, 0.65, -0.1)])  # m, of shadows
RAYS = {"rigid ray": "tab:blue", "tip ray": "tab:red"}  # of the left and of the right hand
PREVIEWED, ARM, PANDA, OBJECT, WORLD = "tab:purple", "tab:orange", "0.45", "tab:green", "0.85"
TRACED = 80  # shots, about 7 s
AROUND = np.linspace(0, 2 * np.pi, 17)


def animate(bench: SharedRun, names: list[str], seed: int, folder: Path) -> None:
    """Write `folder / "<name>.gif"` of each experiment, and `folder / "still.png"` of all."""
    folder.mkdir(parents=True, exist_ok=True)
    stills = {}
    for name in names:
        staged = EXPERIMENTS[name](bench, seed)
        shots = filmed(staged.session)
        result, _ = perform(staged)
        write_gif(shots, name, folder / f"{name}.gif")
        stills[name] = shots[: telling(shots) + 1]
        outcome = "success" if result.success else result.cause
        print(f"{folder / name}.gif: seed {seed}, {outcome}, {result.seconds:.0f} s", flush=True)
    figure, plots = _figure(len(names))
    for plot, (name, shots) in zip(plots, stills.items(), strict=True):
        draw(plot, shots, name)
    figure.savefig(folder / "still.png", dpi=80)


def write_gif(shots: list[Shot], name: str, file: Path) -> None:
    """A run in its own time."""
    from matplotlib.animation import FuncAnimation, PillowWriter

    figure, (plot,) = _figure(1)
    frames = range(1, len(shots) + 1)
    drawn = FuncAnimation(figure, lambda count: draw(plot, shots[:count], name), frames, cache_frame_data=False)
    drawn.save(file, PillowWriter(round(SHOTS_PER_SECOND)), dpi=80)


def telling(shots: list[Shot]) -> int:
    """Which is the last in which the robot goes where it was sent, or, where it follows, in the midst of that."""
    for mode, share in (("execute", 1.0), ("follow", 0.5)):
        places = [index for index, shot in enumerate(shots) if shot.mode == mode]
        if places:
            return places[round(share * (len(places) - 1))]
    return len(shots) - 1


def draw(plot, shots: list[Shot], name: str) -> None:
    """The last of `shots` into axes, which are cleared first, and the ways of tip and object before: without
    perspective, the farther the earlier."""
    shot, before = shots[-1], shots[-TRACED:]
    plot.clear()
    plot.set_axis_off()
    plot.set(xlim=SHOWN[0], ylim=SHOWN[1], aspect="equal")
    _fill(plot, GROUND, facecolor="0.97", edgecolor="0.9")
    for surface in shot.surfaces:
        _fill(plot, _top(surface), facecolor=WORLD, edgecolor="0.6")
    robot = np.vstack([shot.panda, shot.mount])
    for points, width in ((robot, 5), (shot.units, 4)):
        _line(plot, _below(points), color="0.9", lw=width)
    outlines = _outlines(shot)
    for outline in outlines:
        _line(plot, _below(outline), color="0.85", lw=1)
    _line(plot, np.array([past.units[-1] for past in before]), color="0.4", lw=0.8)
    _line(plot, np.array([past.centre for past in before]), color=OBJECT, lw=0.8)
    if shot.hook is not None:
        _line(plot, np.array([shot.centre, shot.hook]), color="0.3", lw=0.8)
    _line(plot, robot, color=PANDA, lw=7, solid_joinstyle="round", solid_capstyle="round")
    _line(plot, shot.panda[:-1], color="0.25", ls="", marker="o", ms=5)
    _line(plot, np.vstack([shot.mount, shot.units]), color=ARM, lw=2)
    units = zip(shot.units, shot.axes, shot.radii, strict=True)
    faces = [(unit[0] @ _towards(), [_circle(*unit)], ARM) for unit in units]
    faces.append((shot.centre @ _towards(), outlines, OBJECT))
    for _, polygons, colour in sorted(faces, key=lambda face: face[0]):
        for polygon in polygons:
            _fill(plot, polygon, facecolor=colour, edgecolor="0.2", lw=0.5, alpha=0.9 if colour == ARM else 0.4)
    for hand, end, colour in zip(shot.hands, shot.ends, RAYS.values(), strict=True):
        _line(plot, np.array([hand, end]), color=colour, lw=1.2, ls="--")
        _line(plot, hand[None], color="0.2", marker="s", ms=7)
        _line(plot, end[None], color=colour, marker="o", ms=4)
    if shot.previewed is not None:
        _line(plot, shot.previewed[None], color=PREVIEWED, marker="*", ms=9, markeredgecolor="white", mew=0.4)
    plot.set_title(f"{name}: {shot.mode}, {shot.now:.1f} s", fontsize=11)


def _figure(count: int):
    """A figure with so many views beside each other, and what the colours mean."""
    from matplotlib.figure import Figure
    from matplotlib.lines import Line2D

    figure = Figure(figsize=(4.6 * count, 4.3))
    plots = figure.subplots(1, count, squeeze=False)[0]
    figure.subplots_adjust(0.01, 0.06, 0.99, 0.94, 0.02, 0)
    keys = [Line2D([], [], color=colour, ls="--", marker="o", ms=4, label=name) for name, colour in RAYS.items()]
    keys.append(Line2D([], [], color=PREVIEWED, ls="", marker="*", ms=9, label="previewed tip"))
    keys.append(Line2D([], [], color=OBJECT, ls="", marker="o", ms=8, alpha=0.5, label="object"))
    figure.legend(handles=keys, loc="lower center", ncols=4, frameon=False, fontsize=8, columnspacing=1)
    return figure, plots


def _projected(points: np.ndarray) -> np.ndarray:
    """(N, 2), m, in the picture's plane: to the right and up, of points (N, 3)."""
    right = np.array([-np.sin(AZIMUTH), np.cos(AZIMUTH), 0.0])
    return points @ np.column_stack([right, np.cross(_towards(), right)])


def _towards() -> np.ndarray:
    """Unit vector (3,) from the scene to the eye."""
    level = np.cos(ELEVATION)
    return np.array([level * np.cos(AZIMUTH), level * np.sin(AZIMUTH), np.sin(ELEVATION)])


def _below(points: np.ndarray) -> np.ndarray:
    """The shadows (N, 3) of points (N, 3), straight down on the ground."""
    return np.column_stack([points[:, :2], np.full(len(points), GROUND[0, 2])])


def _line(plot, points: np.ndarray, **style) -> None:
    plot.plot(*_projected(points).T, **style)


def _fill(plot, points: np.ndarray, **style) -> None:
    plot.fill(*_projected(points).T, **style)


def _circle(centre: np.ndarray, axis: np.ndarray, radius: float) -> np.ndarray:
    """Points (17, 3), m, about `axis`."""
    side = np.cross(axis, [1.0, 0.0, 0.0] if abs(axis[0]) < 0.9 else [0.0, 1.0, 0.0])
    side /= np.linalg.norm(side)
    return centre + radius * (np.outer(np.cos(AROUND), side) + np.outer(np.sin(AROUND), np.cross(axis, side)))


def _outlines(shot: Shot) -> list[np.ndarray]:
    """Lines of the object: three great circles of a sphere, else the rims and four edges of each of its parts."""
    turn, object = rotation_from_wxyz(shot.turn), shot.object
    radius = object.diameter / 2
    if object.shape == "sphere":
        return [_circle(shot.centre, axis, radius) for axis in turn.as_matrix()]
    if object.shape == "basket":
        parts = [(part.shape, part.half, part.turn, part.place) for part in object.parts().values()]
    else:
        half = np.array([radius, radius, object.half_height])
        parts = [("cylinder" if object.shape == "cylinder" else "box", half, np.eye(3), np.zeros(3))]
    lines = [line @ axes.T + place for shape, half, axes, place in parts for line in _edges(shape, half)]
    return [turn.apply(line) + shot.centre for line in lines]


def _edges(shape: str, half: np.ndarray) -> list[np.ndarray]:
    """Rims and four edges of a cylinder about z, or of a box, with half its sizes (3,), m."""
    if shape == "cylinder":
        rim = np.column_stack([np.cos(AROUND), np.sin(AROUND), np.zeros_like(AROUND)])
    else:
        rim = np.array([(1, 1, 0), (-1, 1, 0), (-1, -1, 0), (1, -1, 0), (1, 1, 0)], dtype=float)
    rim, up = rim * half, np.array([0.0, 0.0, half[2]])
    corners = rim[: -1 : (len(rim) - 1) // 4]
    return [rim + up, rim - up, *(np.array([corner + up, corner - up]) for corner in corners)]


def _top(surface) -> np.ndarray:
    """Corners (4, 3), m, of a surface's upper side."""
    half = np.array([surface.size[0], surface.size[1], 0.0]) / 2
    return np.array(surface.top) + half * np.array([(1, 1, 0), (-1, 1, 0), (-1, -1, 0), (1, -1, 0)])
