"""Models of other kinds on the same releases: `python -m studies.anchors [--session demo | asl_trunk]`

Two models that learn a soft arm's motion from data alone, as they are used on soft trunks: Koopman as dynamic mode
decomposition of delayed measurements (Hankel DMD; Haggerty et al., IEEE/RSJ IROS 2020), and a spectral submanifold
reduced to polynomial dynamics of the leading coordinates of delayed measurements (fastSSM; Axås, Cenedese and Haller,
Nonlinear Dynamics 2023). They see the releases of `identify`; their sizes are chosen by leaving each of these out in
turn. Then all predict the releases of `validate` in open loop. The twin is given the pose and velocity in which a
release begins, the learnt models two frames, which say as much, or up to twelve, 0.4 s of the motion itself. All errors
are counted from the end of these twelve on. A prediction that runs away counts as the arm's length off. Needs the
trials and models of the session.
"""

import argparse
import sys
from collections.abc import Iterator
from dataclasses import dataclass
from functools import cache
from itertools import combinations_with_replacement, product
from pathlib import Path

import numpy as np

from stages import identify_damping
from trunkline.errors import in_one_line
from trunkline.identification.evaluation.baselines import hanging_still
from trunkline.identification.evaluation.evaluation import replay, survived
from trunkline.identification.fit.setup import set_up
from trunkline.identification.simulate.experiment import Experiment
from trunkline.pipeline.config import load_config
from trunkline.pipeline.inputs import read_spec
from trunkline.recordings.trials.splits import DECIDING, IDENTIFY, VALIDATE
from trunkline.recordings.trials.trial import read_trials
from upkeep.results import recorded

ROOTS = {"demo": Path("."), "asl_trunk": Path("examples/asl_trunk")}
STEP = 1 / 30  # s, of the learnt models, about; an arm swings at 1 to 2 Hz
DELAYS = {"2": (2,), "2 to 12": (2, 4, 8, 12)}  # frames that a learnt model is given
LAST = 12  # of them
RANKS = (4, 6, 8, 12, 20)
CUBIC_RANKS = (2, 4, 6, 8)  # a cubic of more coordinates has more terms than there are frames
RIDGE = (1e-8, 1e-4, 1e-2, 1.0)  # of a term's sum of squares
BESIDE_CUBES = 1e-6  # at most, of linear terms beside others

Size = tuple[int, int, float]  # delays, coordinates, ridge


@dataclass
class Learnt:
    """Dynamics z' = W φ(z) of the leading coordinates z of `delays` shapes in a row, less the mean shape at rest.

    basis: from stacked shapes, m, to z. Shape (D * 3S, r). weights: W. Shape (terms, r). scale: of z, m. Shape (r,).
    """

    delays: int
    cubic: bool
    rest: np.ndarray
    basis: np.ndarray
    scale: np.ndarray
    weights: np.ndarray

    def predict(self, begun: np.ndarray, frames: int) -> np.ndarray:
        """From the first `delays` shapes (D, 3S) on, m. Shape (frames, 3S), the given ones first."""
        z = (begun - self.rest).ravel() @ self.basis / self.scale
        found = list(begun)
        width = begun.shape[1]
        with np.errstate(over="ignore", invalid="ignore"):
            for _ in range(frames - len(begun)):
                z = terms(z[None], self.cubic)[0] @ self.weights
                found.append(self.rest + ((z * self.scale) @ self.basis.T)[-width:])
        return np.array(found)


def coordinates(shapes: list[np.ndarray], rest: np.ndarray, delays: int) -> np.ndarray:
    """Principal directions of `delays` shapes in a row, less `rest` (3S,), m, the leading ones. Shape (D * 3S, r)."""
    rows = np.concatenate([windows(trial - rest, delays) for trial in shapes])
    return np.linalg.eigh(rows.T @ rows)[1][:, : -max(RANKS) - 1 : -1]


def learn(
    shapes: list[np.ndarray], rest: np.ndarray, basis: np.ndarray, delays: int, cubic: bool, ridge: float
) -> Learnt:
    """From trials of shapes (T, 3S), m, around the shape `rest` (3S,), in coordinates `basis` (D * 3S, r)."""
    rank = basis.shape[1]
    z = [windows(trial - rest, delays) @ basis for trial in shapes]
    scale = np.sqrt(np.mean(np.square(np.concatenate(z)), axis=0))
    z = [one / scale for one in z]
    before = terms(np.concatenate([one[:-1] for one in z]), cubic)
    after = np.concatenate([one[1:] for one in z])
    normal = before.T @ before
    shares = np.full(len(normal), ridge)
    if cubic:
        shares[:rank] = min(ridge, BESIDE_CUBES)
    damped = normal + np.diag(shares * np.diag(normal))
    return Learnt(delays, cubic, rest, basis, scale, np.linalg.solve(damped, before.T @ after))


def windows(trial: np.ndarray, delays: int) -> np.ndarray:
    """`delays` frames in a row, stacked. Shape (T - D + 1, D * 3S)."""
    return np.stack([trial[i : i + delays].ravel() for i in range(len(trial) - delays + 1)])


def terms(z: np.ndarray, cubic: bool) -> np.ndarray:
    """z itself, or all its monomials of degree 1 to 3. Shape (n, terms)."""
    if not cubic:
        return z
    second, third = monomials(z.shape[1])
    return np.concatenate([z, z[:, second].prod(axis=2), z[:, third].prod(axis=2)], axis=1)


@cache
def monomials(rank: int) -> tuple[np.ndarray, np.ndarray]:
    """Which coordinates the products of two and of three take. Shapes (n, 2), (m, 3)."""
    second, third = (np.array(list(combinations_with_replacement(range(rank), degree))) for degree in (2, 3))
    return second, third


def shapes_of(experiment: Experiment, stride: int) -> np.ndarray:
    """Every `stride`th frame, m, bridged where a segment was not measured. Shape (T, 3S)."""
    filled = experiment.positions.copy()
    frames = np.arange(len(filled))
    for segment, seen in enumerate(experiment.measured.T):
        for axis in range(3):
            filled[:, segment, axis] = np.interp(frames, frames[seen], filled[seen, segment, axis])
    return filled[::stride].reshape(len(filled[::stride]), -1)


def errors(found: np.ndarray, experiment: Experiment, stride: int, length: float, tip: int) -> tuple[float, float]:
    """Mean position and tip error of a prediction (T, 3S) from frame LAST on, mm."""
    positions = survived(found.reshape(len(found), -1, 3), length)
    positions = np.clip(positions, -1e3, 1e3)  # m
    off = np.minimum(np.linalg.norm(positions - experiment.positions[::stride], axis=2), length)
    seen = experiment.measured[::stride]
    late = slice(LAST, None)
    return 1e3 * float(off[late][seen[late]].mean()), 1e3 * float(off[late, tip][seen[late, tip]].mean())


def chosen(
    own: list[Experiment], stride: int, delays: tuple[int, ...], cubic: bool, length: float, tip: int
) -> tuple[Size, Learnt]:
    """The size whose models err least on the release that each did not see, and the model of all of them."""
    shapes = [shapes_of(e, stride) for e in own]
    ends = np.array([trial[-1] for trial in shapes])

    def learnt(trials: list[np.ndarray], rest: np.ndarray) -> Iterator[tuple[Size, Learnt]]:
        for count in delays:
            basis = coordinates(trials, rest, count)
            for rank, ridge in product(ranks, RIDGE):
                if rank <= basis.shape[1]:
                    yield (count, rank, ridge), learn(trials, rest, basis[:, :rank], count, cubic, ridge)

    ranks = CUBIC_RANKS if cubic else RANKS
    missed: dict[Size, list[float]] = {}
    for i, experiment in enumerate(own):
        others = [trial for j, trial in enumerate(shapes) if j != i]
        for size, model in learnt(others, np.delete(ends, i, axis=0).mean(axis=0)):
            found = model.predict(shapes[i][: size[0]], len(shapes[i]))
            missed.setdefault(size, []).append(errors(found, experiment, stride, length, tip)[0])
    best = min(missed, key=lambda size: np.mean(missed[size]))
    return best, dict(learnt(shapes, ends.mean(axis=0)))[best]


def rows(session: str) -> list[str]:
    root = ROOTS[session]
    trials = [t for t in read_trials(root / "data/processed/filter", DECIDING) if t.experiment == "release"]
    trials = [t for t in trials if not t.load]
    twin = read_spec(root / "artifacts/identify_damping/arm.xml").compile()
    config = load_config(identify_damping.Config, "identify_damping", root)
    twin, experiments, fit = set_up(config, trials, twin)
    replayed = replay(twin, experiments, fit.segments)
    length, tip = replayed.length, replayed.tip
    stride = max(round(STEP / experiments[0].frame_step), 1)
    own = [e for e in experiments if e.split == IDENTIFY]
    still = hanging_still(experiments, replayed, own)
    unseen = [i for i, e in enumerate(experiments) if e.split == VALIDATE]

    def row(name: str, of: dict[int, np.ndarray], sizes: str = "") -> str:
        missed = np.mean([errors(of[i], experiments[i], stride, length, tip) for i in unseen], axis=0)
        share = missed / length / 10
        return f"| {session} | {name} | {sizes} | {missed[0]:.3g} / {missed[1]:.3g} | {share[0]:.3g} / {share[1]:.3g} |"

    def flat(positions: list[np.ndarray]) -> dict[int, np.ndarray]:
        return {i: p.reshape(len(p), -1) for i in unseen for p in [positions[i][::stride]]}

    lines = [row("mean shape at rest", flat(still.positions))]
    kinds = (("Koopman, linear", False), ("spectral submanifold, cubic", True))
    for (name, cubic), (given, delays) in product(kinds, DELAYS.items()):
        size, model = chosen(own, stride, delays, cubic, length, tip)
        found = {}
        for i in unseen:
            shapes = shapes_of(experiments[i], stride)
            found[i] = model.predict(shapes[: size[0]], len(shapes))
        lines.append(row(name, found, f"{size[0]} frames of {given}, {size[1]} coordinates"))
    return [*lines, row("the twin", flat(replayed.positions))]


@in_one_line
@recorded("anchors")
def main() -> int:
    parser = argparse.ArgumentParser(description=__doc__)
    parser.add_argument("--session", choices=ROOTS, action="append", help="one alone (default: all)")
    chosen_sessions = parser.parse_args().session or list(ROOTS)
    print("| releases of | model | size | position / tip error on `validate`, mm | % of length |")
    print("|---|---|---|---:|---:|")
    for session in chosen_sessions:
        for line in rows(session):
            print(line, flush=True)
    return 0


if __name__ == "__main__":
    sys.exit(main())
