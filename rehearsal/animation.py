"""One run of each experiment as an animation, and a still of all of them."""

from pathlib import Path

import numpy as np

from rehearsal.experiments.bench import Bench
from rehearsal.experiments.registry import EXPERIMENTS
from rehearsal.film import SHOTS_PER_SECOND, Shot, filming
from trunkline.frames import rotation_from_wxyz

LOW, HIGH = np.array([-0.15, -0.75, -0.1]), np.array([1.35, 0.75, 1.05])  # m, of what is shown
RAYS = {"rigid ray": "tab:blue", "tip ray": "tab:red"}  # of the left and of the right hand
PREVIEWED, ARM, PANDA, THING, WORLD = "tab:purple", "tab:orange", "0.45", "tab:green", "0.85"
AROUND = np.linspace(0, 2 * np.pi, 17)


def animate(bench: Bench, names: list[str], seed: int, folder: Path) -> None:
    """Write `folder / "<name>.gif"` of each experiment, and `folder / "still.png"` of all."""
    from matplotlib.animation import FuncAnimation, PillowWriter

    folder.mkdir(parents=True, exist_ok=True)
    stills = {}
    for name in names:
        film = filming(bench)
        result, _ = EXPERIMENTS[name](film, seed)
        told = "success" if result.success else result.cause
        figure, (plot,) = _figure(1)
        drawn = FuncAnimation(figure, lambda shot, plot=plot, name=name: draw(plot, shot, name), film.shots)
        drawn.save(folder / f"{name}.gif", PillowWriter(round(SHOTS_PER_SECOND)), dpi=80)
        stills[name] = telling(film.shots)
        print(f"{folder / name}.gif: seed {seed}, {told}, {film.shots[-1].now:.0f} s", flush=True)
    figure, plots = _figure(len(names))
    for plot, (name, shot) in zip(plots, stills.items(), strict=True):
        draw(plot, shot, name)
    figure.savefig(folder / "still.png", dpi=80)


def telling(shots: list[Shot]) -> Shot:
    """The last in which the robot goes where it was sent; where it follows, in the middle of that; else the last."""
    for mode, share in (("execute", 1.0), ("follow", 0.5)):
        found = [shot for shot in shots if shot.mode == mode]
        if found:
            return found[round(share * (len(found) - 1))]
    return shots[-1]


def draw(plot, shot: Shot, name: str) -> None:
    """A shot into three-dimensional axes, which are cleared first."""
    from mpl_toolkits.mplot3d.art3d import Poly3DCollection

    plot.clear()
    plot.set_axis_off()
    plot.set(xlim=(LOW[0], HIGH[0]), ylim=(LOW[1], HIGH[1]), zlim=(LOW[2], HIGH[2]))
    plot.set_box_aspect(HIGH - LOW, zoom=1.5)
    plot.view_init(elev=18, azim=-60)
    for surface in shot.surfaces:
        plot.add_collection3d(Poly3DCollection([_top(surface)], facecolor=WORLD, edgecolor="0.6", alpha=0.6))
    _shadow(plot, shot)
    plot.plot(*np.vstack([shot.panda, shot.mount]).T, color=PANDA, lw=6, solid_joinstyle="round")
    plot.plot(*shot.panda[:-1].T, "o", color="0.25", ms=5)
    discs = [_circle(*unit) for unit in zip(shot.units, shot.axes, shot.radii, strict=True)]
    plot.add_collection3d(Poly3DCollection(discs, facecolor=ARM, edgecolor="0.2", lw=0.4, alpha=0.9))
    for outline in _outlines(shot):
        plot.plot(*outline.T, color=THING, lw=1.2)
    if shot.hook is not None:
        plot.plot(*np.array([shot.thing, shot.hook]).T, color="0.3", lw=0.8)
    for hand, end, colour in zip(shot.hands, shot.ends, RAYS.values(), strict=True):
        plot.plot(*np.array([hand, end]).T, color=colour, lw=1, ls="--")
        plot.plot(*end[:, None], "o", color=colour, ms=4)
    if shot.previewed is not None:
        plot.plot(*shot.previewed[:, None], "*", color=PREVIEWED, ms=11)
    plot.set_title(f"{name}: {shot.mode}, {shot.now:.1f} s", y=0.95)


def _figure(count: int):
    """A figure with so many views beside each other, and what the colours mean."""
    from matplotlib.figure import Figure
    from matplotlib.lines import Line2D

    figure = Figure(figsize=(5.2 * count, 4.6))
    plots = figure.subplots(1, count, subplot_kw={"projection": "3d", "computed_zorder": True}, squeeze=False)[0]
    figure.subplots_adjust(0, 0.05, 1, 0.97, 0, 0)
    keys = [Line2D([], [], color=colour, ls="--", marker="o", ms=4, label=name) for name, colour in RAYS.items()]
    keys.append(Line2D([], [], color=PREVIEWED, ls="", marker="*", ms=10, label="previewed tip"))
    keys.append(Line2D([], [], color=THING, label="object"))
    figure.legend(handles=keys, loc="lower center", ncols=4, frameon=False)
    return figure, plots


def _shadow(plot, shot: Shot) -> None:
    """What is straight above a level plane below the robot, so that depth can be seen."""
    ground = [(x, y, LOW[2]) for x, y in ((LOW[0], LOW[1]), (HIGH[0], LOW[1]), (HIGH[0], HIGH[1]), (LOW[0], HIGH[1]))]
    from mpl_toolkits.mplot3d.art3d import Poly3DCollection

    plot.add_collection3d(Poly3DCollection([ground], facecolor="0.96", edgecolor="0.9"))
    for points, width in ((shot.panda, 4), (shot.units, 3)):
        plot.plot(points[:, 0], points[:, 1], LOW[2], color="0.85", lw=width)
    plot.plot(*shot.thing[:2, None], LOW[2], "o", color="0.8", ms=6)


def _circle(centre: np.ndarray, axis: np.ndarray, radius: float) -> np.ndarray:
    """Points (17, 3), m, about `axis`."""
    side = np.cross(axis, [1.0, 0.0, 0.0] if abs(axis[0]) < 0.9 else [0.0, 1.0, 0.0])
    side /= np.linalg.norm(side)
    return centre + radius * (np.outer(np.cos(AROUND), side) + np.outer(np.sin(AROUND), np.cross(axis, side)))


def _outlines(shot: Shot) -> list[np.ndarray]:
    """Lines of the object: three great circles of a sphere, else its rims and four edges."""
    turn, thing = rotation_from_wxyz(shot.turn), shot.object
    radius = thing.diameter / 2
    if thing.shape == "sphere":
        return [_circle(shot.thing, axis, radius) for axis in turn.as_matrix()]
    if thing.shape == "cylinder":
        rim = radius * np.column_stack([np.cos(AROUND), np.sin(AROUND), np.zeros_like(AROUND)])
    else:
        rim = radius * np.array([(1, 1, 0), (-1, 1, 0), (-1, -1, 0), (1, -1, 0), (1, 1, 0)], dtype=float)
    up = np.array([0.0, 0.0, thing.half_height])
    corners = rim[:: max((len(rim) - 1) // 4, 1)]
    lines = [rim + up, rim - up, *(np.array([corner + up, corner - up]) for corner in corners)]
    return [turn.apply(line) + shot.thing for line in lines]


def _top(surface) -> np.ndarray:
    """Corners (4, 3), m, of a surface's upper side."""
    half = np.array([surface.size[0], surface.size[1], 0.0]) / 2
    return np.array(surface.top) + half * np.array([(1, 1, 0), (-1, 1, 0), (-1, -1, 0), (1, -1, 0)])
