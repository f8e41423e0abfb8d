"""Can the same tendon lengths hold the arm in two shapes? Equilibria sought from many first guesses.

    python -m studies.snap_through [arm.xml] [--figure docs/snap_through.png]

Lengths are those of random equilibria at random gravity angles from 0 to 120°, with one tendon slack, as the data set
has them, and the same with that tendon drawn in by some millimetres more, so that all three pull against each other.
First guesses are shapes of other equilibria, and random bends of both halves of the arm. Then both ventral tendons
are drawn in alike, as for the paper's grasps, and equilibria are sought from shapes that lean to either side.
"""

import argparse
import sys
from contextlib import redirect_stdout
from pathlib import Path
from typing import NamedTuple

import numpy as np

from trunkline.compute.progress import progress
from trunkline.frames import gravity_in_base
from trunkline.kinematics.dataset.sampling import pull_directions
from trunkline.model.statics.chain import Chain, read_chain
from trunkline.model.statics.equilibria import equilibrium, equilibrium_paths
from trunkline.model.statics.restart import restart
from trunkline.pipeline.inputs import read_model
from trunkline.report.figures.style import IDENTIFIED, INITIAL, MEASURED, VALIDATE, plt, save_figure
from upkeep.results import recorded

DRAWN_IN_MM = (0.0, 0.5, 1.0, 2.0, 3.0)  # of the slack tendon
APART = 1e-3  # m; equilibria whose tips are nearer than this count as one
LARGEST_ANGLE = np.radians(120)
VENTRAL_DEG = (0, 60, 120)  # gravity angles for the two ventral tendons
LEAN = (-0.1, -0.02, 0.0, 0.02, 0.1)  # of one ventral tension over the other, where first guesses come from


class Branches(NamedTuple):
    """Of N targets: whether it has an equilibrium within the motors' force (N,), how many (N,), and how far their
    tips are apart, m (N,)."""

    solved: np.ndarray
    count: np.ndarray
    apart: np.ndarray


class Alike(NamedTuple):
    """Of E equilibria with both ventral tendons at one length: how far these are drawn in from the straight arm's, m
    (E,), how far the tip is aside, m (E,), and how far from that of another equilibrium at the same length, m (E,)."""

    drawn_in: np.ndarray
    aside: np.ndarray
    apart: np.ndarray


@recorded("snap_through")
def main() -> None:
    parser = argparse.ArgumentParser(description=__doc__)
    parser.add_argument("model", type=Path, nargs="?", default=Path("artifacts/identify_control/arm.xml"))
    parser.add_argument("--targets", type=int, default=300)
    parser.add_argument("--guesses", type=int, default=24)
    parser.add_argument("--figure", type=Path)
    arguments = parser.parse_args()
    chain = read_chain(read_model(arguments.model)).smooth
    rng = np.random.default_rng(0)
    tensions, gravity = random_loads(chain, arguments.targets, rng)
    rest = equilibrium(chain, tensions, gravity)
    results = {}
    for drawn in DRAWN_IN_MM:
        lengths = rest.lengths - 1e-3 * drawn * (tensions == 0)
        found = search(chain, lengths, gravity, rest.qpos, arguments.guesses, rng)
        results[drawn] = found
        print(f"slack tendon drawn in by {drawn:3.1f} mm: {within_force(found)}", flush=True)
    ventral = {angle: ventral_pull(chain, np.radians(angle)) for angle in VENTRAL_DEG}
    for angle, found in ventral.items():
        print(f"both ventral tendons alike, {angle:3d}°: {alike(found)}")
    if arguments.figure:
        save_figure(figure(results, ventral), arguments.figure)


def within_force(found: Branches) -> str:
    """What `search` found, in words."""
    several = found.solved & (found.count > 1)
    apart, said = 1e3 * found.apart[several], f"{found.solved.mean():6.1%} within the motors' force"
    if found.solved.any():
        said += f", of these {several.sum() / found.solved.sum():6.2%} with more than one equilibrium"
    if several.any():
        said += f", tips {np.median(apart):.0f} mm apart (median), {apart.max():.0f} mm at most"
    return said


def alike(found: Alike) -> str:
    """What `ventral_pull` found, in words."""
    several, most = found.apart > APART, f"{1e3 * found.drawn_in.max():.0f} mm"
    if not several.any():
        return f"one shape up to {most} drawn in, where the motors' force ends"
    said = f"one shape up to {1e3 * found.drawn_in[several].min():.0f} mm drawn in, several up to {most}"
    return f"{said}, tips up to {1e3 * found.apart.max():.0f} mm apart"


def random_loads(chain: Chain, count: int, rng: np.random.Generator) -> tuple[np.ndarray, np.ndarray]:
    """Tensions (count, K) with a slack tendon, N, and gravity (count, 3)."""
    around = pull_directions(chain, rng.uniform(0, 2 * np.pi, count))
    return around * rng.uniform(0.02, 1, (count, 1)) ** 2, gravity_in_base(rng.uniform(0, LARGEST_ANGLE, count))


def search(chain: Chain, lengths, gravity, known, guesses: int, rng: np.random.Generator) -> Branches:
    """Stable equilibria of `lengths` (N, K), m, under `gravity` (N, 3), from `known` (N, nq) and `guesses` shapes."""
    count = len(lengths)
    tips, good = np.empty((guesses + 1, count, 3)), np.empty((guesses + 1, count), bool)
    with redirect_stdout(sys.stderr), progress(guesses + 1, "snap_through", "guesses") as bar:
        for guess in range(guesses + 1):
            qpos = known if guess == 0 else first_guesses(chain, count, rng, random_bend=guess % 2 == 0)
            found = restart(chain, qpos, np.zeros_like(lengths), lengths, gravity)
            tips[guess] = found.position
            good[guess] = found.converged & (found.tensions <= chain.max_tension * (1 + 1e-6)).all(axis=1)
            bar.update(1)
    counts, apart = np.zeros(count, int), np.zeros(count)
    for row in range(count):
        different: list[np.ndarray] = []
        for tip in tips[good[:, row], row]:
            if all(np.linalg.norm(tip - other) > APART for other in different):
                different.append(tip)
        counts[row] = len(different)
        if different:
            apart[row] = np.linalg.norm(np.array(different)[:, None] - different, axis=2).max()
    return Branches(np.asarray(good.any(axis=0)), counts, apart)


def first_guesses(chain: Chain, count: int, rng: np.random.Generator, random_bend: bool) -> np.ndarray:
    """Joint angles (count, nq): each half of the arm bent evenly some way, or equilibria under other loads."""
    if not random_bend:
        return equilibrium(chain, *random_loads(chain, count, rng)).qpos
    halves = rng.uniform(-0.5, 0.5, (count, 2, 2))
    return np.repeat(halves, [chain.units // 2, chain.units - chain.units // 2], axis=1).reshape(count, -1)


def ventral_pull(chain: Chain, angle: float, steps: int = 80) -> Alike:
    """Stable equilibria with both ventral tendons at one length, of `steps` lengths as far as the motors' force goes.

    Args:
        angle: θ_G, rad.
    """
    gravity, leans, shares = gravity_in_base(angle), np.array(LEAN), np.linspace(0, 1, steps) ** 2
    ends = np.column_stack([np.zeros(len(leans)), 1 - np.maximum(leans, 0), 1 + np.minimum(leans, 0)])
    paths = equilibrium_paths(chain, (ends * chain.max_tension)[:, None] * shares[:, None], gravity)
    rest, mean = chain.straight_lengths[1], paths.lengths[:, 1:].mean(axis=1)
    both = rest - np.linspace(0, rest - mean[paths.converged].min(), steps)
    lengths = np.column_stack([np.full(steps, 2 * chain.length), both, both])
    tips = np.full((len(leans), steps, 3), np.nan)
    for lean, path in enumerate(np.arange(len(mean)).reshape(len(leans), steps)):
        known = path[paths.converged[path]]
        near = known[np.abs(mean[known] - both[:, None]).argmin(axis=1)]  # the path's shape of about this length
        found = restart(chain, paths.qpos[near], paths.tensions[near], lengths, gravity)
        good = found.converged & (found.tensions <= chain.max_tension * (1 + 1e-6)).all(axis=1)
        tips[lean, good] = found.position[good]
    apart = np.linalg.norm(tips[:, None] - tips, axis=-1)  # (leans, leans, steps)
    good = np.isfinite(tips[..., 0])
    drawn_in = np.broadcast_to(rest - both, good.shape)
    return Alike(drawn_in[good], tips[good][:, 1], np.where(good, np.nan_to_num(apart).max(axis=0), 0)[good])


def figure(results: dict[float, Branches], ventral: dict[int, Alike]):
    """Share of lengths with several equilibria, and how far apart these are, over how far the tendon is drawn in;
    where the tip goes when both ventral tendons are drawn in alike."""
    figure, (left, right, plane) = plt.subplots(1, 3, figsize=(13, 3.9))
    for (angle, found), color in zip(ventral.items(), (IDENTIFIED, VALIDATE, INITIAL), strict=True):
        plane.scatter(1e3 * found.drawn_in, 1e3 * found.aside, s=9, color=color, linewidths=0, label=f"θ_G = {angle}°")
    plane.set(xlabel="both ventral tendons drawn in (mm)", ylabel="tip out of the plane (mm)")
    plane.legend(loc="best", markerscale=2)
    drawn = list(results)
    places = np.arange(len(drawn))
    shares = [100 * (found.count[found.solved] > 1).mean() if found.solved.any() else 0.0 for found in results.values()]
    bars = left.bar(places, shares, color=[IDENTIFIED if d == 0 else INITIAL for d in drawn], width=0.6)
    left.bar_label(bars, [f"{share:.1f} %" for share in shares], padding=2, fontsize=9)
    left.set(ylabel="lengths with more than one equilibrium (%)", ylim=(0, 1.15 * max([*shares, 1])))
    for place, found in zip(places, results.values(), strict=True):
        apart = 1e3 * found.apart[found.solved & (found.count > 1)]
        right.scatter(np.full(len(apart), place), apart, s=12, color=MEASURED, alpha=0.5, linewidths=0)
    right.set(yscale="log", ylim=(0.8, 200), ylabel="their tips apart (mm)")
    labels = ["slack\n(data set)" if d == 0 else f"{d:g} mm\nshorter" for d in drawn]
    for ax in (left, right):
        ax.set_xticks(places, labels)
        ax.set_xlabel("third tendon")
        ax.set_xlim(-0.6, len(drawn) - 0.4)
    figure.suptitle("Snap-through: the same tendon lengths, several shapes")
    return figure


if __name__ == "__main__":
    main()
