"""Samples of the reachable set: equilibria over directions of gravity and tensions, uniform in the space of tips.

Reachable means: at rest, with at least one tendon of every three slack. Pulling all of them at once bends nothing but
presses the units together, and above a few newtons a straight arm buckles under it: then the same lengths have many
equilibria, which one depends on history, and no function gives lengths from poses. With one tendon slack the
equilibrium was found to be unique. So, per direction of gravity, two neighbouring tendons pull, in any proportion, up
to their largest force: tips form a surface, each point of which has one set of path lengths.

Of an arm of several sections, each with tendons of its own that end there, two neighbouring ones of each section pull.
No single way leads through so many dimensions: forces are drawn at random, evenly over each section's pulls.
"""

from dataclasses import dataclass

import numpy as np

from trunkline.compute.scheduler import spread_rows
from trunkline.errors import InputError
from trunkline.kinematics.residual.residual_map import ResidualMap, moved
from trunkline.model.statics.chain import Chain
from trunkline.model.statics.equilibria import Equilibrium, equilibrium, equilibrium_paths

COARSE_STEPS = 48  # of the first look at a path, to space the second one evenly along the tip's way
SURFACE_LOOK = 2  # rays of a surface, of which one is looked at: places are along neighbouring rays as good as the same
LEAST = 1000  # equilibria that are worth being sent to another machine
COARSE_POWER = 3.0  # tension ~ (step / steps)^power there: the tip's soft units bend under the first newton


@dataclass
class Candidates:
    """All samples under one gravity before thinning: N of them, dropped ones left out.

    Attributes:
        gravity: in the base frame, m/s². Shape (3,).
        equilibrium: the N equilibria.
        kind: "general", or of an arm of three tendons "dorsal" (tendon 1 alone) or "ventral" (tendons 2 and 3 alike).
            Shape (N,).
        failed: samples dropped because Newton's method found no stable equilibrium.
        snapped: samples dropped because the arm jumped on the way there.
    """

    gravity: np.ndarray
    equilibrium: Equilibrium
    kind: np.ndarray
    failed: int
    snapped: int


def sample_at(
    chain: Chain,
    gravity: np.ndarray,
    directions: int,
    steps: int,
    rng: np.random.Generator,
    look_every: int = 1,
    deepest: np.ndarray | None = None,
    learnt: ResidualMap | None = None,
) -> Candidates:
    """Follow the arm along rays of growing tension, samples evenly spaced along the tip's way on each.

    An arm of several sections is pulled at random instead, directions * steps times, see `in_sections`.

    Args:
        gravity: in the base frame, m/s². Shape (3,).
        directions: rays, their bending moments evenly spread around the arm.
        steps: samples on each ray, at random in equal shares of its length; four times as many on the planar rays.
        look_every: the first look goes along one ray in so many; between them, the tip's way is interpolated.
        deepest: of each tendon of an arm of several sections, how far its motor draws it in at most, m; None for as
            far as its force goes. Shape (K,).
        learnt: by how far the arm's tip rests beside the twin's; None: tips are the twin's.
    """
    if len(sections(chain)) > 1:
        whole, within = in_sections(chain, gravity, directions * steps, deepest, rng)
        whole = moved(whole[within], chain, gravity, learnt)
        return _candidates(gravity, whole, np.full(len(whole.position), "general"))
    rays = pull_directions(chain, (np.arange(directions) + rng.random()) / directions * 2 * np.pi)
    planar, kinds = planar_directions(chain)
    parts = [_follow(chain, gravity, rays, steps, rng, look_every), _follow(chain, gravity, planar, 4 * steps, rng)]
    kind = np.repeat(np.array(["general", *kinds]), [directions * steps] + [4 * steps] * len(planar))
    whole = Equilibrium(
        **{name: np.concatenate([values, vars(parts[1])[name]]) for name, values in vars(parts[0]).items()}
    )
    return _candidates(gravity, moved(whole, chain, gravity, learnt), kind)


def _candidates(gravity: np.ndarray, whole: Equilibrium, kind: np.ndarray) -> Candidates:
    good = whole.converged & ~whole.snapped
    failed = int(np.sum(~whole.converged))
    return Candidates(gravity, whole[good], kind[good], failed, int(np.sum(~good)) - failed)


def workspace_surface_at(
    chain: Chain, gravity: np.ndarray, around: int, along: int, learnt: ResidualMap | None = None
) -> np.ndarray:
    """The surface of tips as a lattice: even ways to pull around the arm, even places along the tip's way on each.

    The first place of every way is where the arm hangs, the last where its motors pull with all their force.

    Args:
        gravity: in the base frame, m/s². Shape (3,).
        learnt: as for `sample_at`.

    Returns:
        m. Shape (around, along, 3).

    Raises:
        InputError: some equilibrium was not found, or was reached by a jump, so that there is no surface.
    """
    rays = pull_directions(chain, np.arange(around) / around * 2 * np.pi)
    places = np.broadcast_to(np.linspace(0, 1, along), (around, along))
    equilibria = _along(chain, gravity, rays, places, SURFACE_LOOK)
    bad = int((~equilibria.converged | equilibria.snapped).sum())
    if bad:
        raise InputError(
            f"gravity {np.round(gravity, 3)}: found {bad} of {around * along} tips by no steady way, expected a surface"
        )
    return moved(equilibria, chain, gravity, learnt).position.reshape(around, along, 3)


def sections(chain: Chain) -> list[np.ndarray]:
    """The tendons that end at one unit, section by section from the base."""
    ends = chain.units - 1 - np.argmax(chain.crosses[::-1], axis=0)
    return [np.flatnonzero(ends == end) for end in np.unique(ends)]


def pull_directions(
    chain: Chain, angles: np.ndarray, section: np.ndarray | None = None, most: np.ndarray | None = None
) -> np.ndarray:
    """Two neighbouring tendons' tensions whose moment points at `angles` (rad) around the arm, one at its limit.

    Args:
        section: the tendons from which to choose; None for all.
        most: N, or any other unit of a pull; None for the motors' largest force. Shape (K,).

    Returns:
        Tensions in N, or in the unit of `most`. Shape (len(angles), K).

    Raises:
        InputError: if fewer than three tendons surround the arm.
    """
    section = np.arange(chain.tendons) if section is None else section
    most = chain.max_tension if most is None else most
    holes = _first_holes(chain)
    around = np.arctan2(holes[section, 1], holes[section, 0])
    order = section[np.argsort(around)]
    around = np.sort(around)
    gaps = np.diff(np.append(around, around[0] + 2 * np.pi))
    if len(section) < 3 or gaps.max() >= np.pi - 1e-6:
        raise InputError(
            f"arm: found {len(section)} tendons that end at one unit, expected 3 or more all around, to reach every way"
        )
    tensions = np.zeros((len(angles), chain.tendons))
    for row, angle in enumerate(angles):
        place = np.searchsorted(around, np.arctan2(np.sin(angle), np.cos(angle))) - 1
        pair = order[[place % len(order), (place + 1) % len(order)]]
        moment = np.linalg.solve(holes[pair, :2].T, [np.cos(angle), np.sin(angle)])
        tensions[row, pair] = np.maximum(moment, 0)
    share = (tensions / most).max(axis=1, keepdims=True)
    return tensions / share


def planar_directions(chain: Chain) -> tuple[np.ndarray, list[str]]:
    """The two planar pulls of the paper's grasps: one dorsal cable, the two ventral cables together."""
    if chain.tendons != 3:
        return np.zeros((0, chain.tendons)), []
    force = chain.max_tension
    return np.array([[force[0], 0, 0], [0, min(force[1:]), min(force[1:])]]), ["dorsal", "ventral"]


def around_the_arm(chain: Chain) -> np.ndarray:
    """The tendons in the order in which they lie around the arm. Shape (K,)."""
    holes = _first_holes(chain)
    return np.argsort(np.arctan2(holes[:, 1], holes[:, 0]))


def _first_holes(chain: Chain) -> np.ndarray:
    """Where each tendon leaves the base, in the plane across the straight arm, as unit vectors. Shape (K, 3)."""
    holes = chain.hole_in[0] + chain.offset[0]
    across = holes - np.outer(holes @ chain.tip, chain.tip) / (chain.tip @ chain.tip)
    return across / np.linalg.norm(across, axis=1, keepdims=True)


def in_sections(
    chain: Chain, gravity: np.ndarray, count: int, deepest: np.ndarray | None, rng: np.random.Generator
) -> tuple[Equilibrium, np.ndarray]:
    """Equilibria of an arm whose every section is pulled at random, evenly over all ways and forces: of each tendon up
    to the one by which its motor, pulling alone, draws it in by `deepest`.

    Args:
        gravity: in the base frame, m/s². Shape (3,) or (count, 3).
        deepest: m; None for as far as the motors' force goes. Shape (K,).

    Returns:
        `count` equilibria, and in which of them no motor draws in further than `deepest`. Shape (count,).
    """
    most = chain.max_tension if deepest is None else _forces(chain, deepest)
    tensions = np.zeros((count, chain.tendons))
    for section in sections(chain):
        ways = pull_directions(chain, rng.uniform(-np.pi, np.pi, count), section, most)
        tensions += np.sqrt(rng.random((count, 1))) * ways
    result = equilibrium(chain, tensions, gravity)
    if deepest is None:
        return result, np.ones(count, bool)
    return result, np.all(chain.straight_lengths - result.commands <= deepest, axis=1)


def _forces(chain: Chain, deepest: np.ndarray) -> np.ndarray:
    """By which each motor draws its tendon in by `deepest`, m (K,), without gravity, none of the others pulling: N,
    at most its largest. Shape (K,)."""
    shares, forces = np.linspace(0, 1, COARSE_STEPS) ** COARSE_POWER, np.empty(chain.tendons)
    for tendon in range(chain.tendons):
        ray = np.zeros((1, COARSE_STEPS, chain.tendons))
        ray[0, :, tendon] = shares * chain.max_tension[tendon]
        paths = equilibrium_paths(chain, ray, np.zeros(3))
        pulls = chain.straight_lengths[tendon] - paths.commands[paths.converged, tendon]
        forces[tendon] = np.interp(deepest[tendon], pulls, ray[0, paths.converged, tendon])
    return forces


def _follow(
    chain: Chain, gravity: np.ndarray, rays: np.ndarray, steps: int, rng: np.random.Generator, look_every: int = 1
) -> Equilibrium:
    """`steps` equilibria on each ray, from no tension to the whole of it, evenly spaced along the tip's way."""
    places = (np.arange(steps) + rng.random((len(rays), steps))) / steps
    return _along(chain, gravity, rays, places, look_every)


def _along(chain: Chain, gravity: np.ndarray, rays: np.ndarray, places: np.ndarray, look_every: int) -> Equilibrium:
    """Equilibria at `places` (rays, steps) on each ray, as shares of the tip's way."""
    shares = np.linspace(0, 1, COARSE_STEPS) ** COARSE_POWER
    looked = np.arange(0, len(rays), look_every)
    coarse = _paths(chain, rays[looked, None, :] * shares[:, None], gravity)
    tips = coarse.position.reshape(len(looked), COARSE_STEPS, 3)
    way = np.linalg.norm(np.diff(tips, axis=1), axis=2).cumsum(axis=1)
    way = np.concatenate([np.zeros((len(looked), 1)), way], axis=1)
    if look_every > 1:  # rays go around the arm: the last one is beside the first
        every = np.arange(len(rays))
        way = np.stack([np.interp(every, looked, column, period=len(rays)) for column in way.T], axis=1)
    fine = np.stack([np.interp(p * w[-1], w, shares) for p, w in zip(places, way, strict=True)])
    return _paths(chain, rays[:, None, :] * fine[..., None], gravity)


def _paths(chain: Chain, tensions: np.ndarray, gravity: np.ndarray) -> Equilibrium:
    """As `equilibrium_paths` under one gravity."""
    least = -(-LEAST // tensions.shape[1])
    return Equilibrium(*spread_rows(_follow_some, (tensions,), (chain, gravity), least))


def _follow_some(fixed: tuple[Chain, np.ndarray], rows: tuple[np.ndarray]) -> tuple[np.ndarray, ...]:
    (chain, gravity), (tensions,) = fixed, rows
    return tuple(vars(equilibrium_paths(chain, tensions, gravity)).values())


def thin(points: np.ndarray, count: int, rng: np.random.Generator) -> np.ndarray:
    """Indices of at most `count` points, no two in one cell of a cubic lattice, the cells as small as that allows.

    Args:
        points: m. Shape (N, 3).
    """
    shuffled = rng.permutation(len(points))
    low, high = 1e-5, float(np.ptp(points, axis=0).max()) + 1e-3
    if len(points) <= count:
        return np.sort(shuffled)
    for _ in range(40):
        edge = np.sqrt(low * high)
        low, high = (edge, high) if len(_one_a_cell(points[shuffled], edge)) > count else (low, edge)
    retained = shuffled[_one_a_cell(points[shuffled], low)]
    return np.sort(retained[rng.permutation(len(retained))[:count]])


def _one_a_cell(points: np.ndarray, edge: float) -> np.ndarray:
    """Index of the first point in each occupied cell."""
    cells = np.floor((points - points.min(axis=0)) / edge).astype(np.int64)
    size = cells.max(axis=0) + 1
    flat = (cells[:, 0] * size[1] + cells[:, 1]) * size[2] + cells[:, 2]
    return np.unique(flat, return_index=True)[1]


def crowding(points: np.ndarray, edge: float = 0.01) -> np.ndarray:
    """Number of points in each occupied cell of `edge` m. Even samples of a surface give similar numbers."""
    cells = np.floor(points / edge).astype(np.int64)
    return np.unique(cells, axis=0, return_counts=True)[1]
