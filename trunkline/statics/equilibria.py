"""Forward kinematics of the arm: its equilibrium under gravity and tendons that only pull, many at a time.

Three ways to say how the tendons pull: by tensions (`equilibrium`, `equilibrium_paths`), by the lengths of
inextensible cables (`forward`), by the commands of the model's position actuators (`actuated`).
All start from the arm at rest without pull, its weight growing from nothing, and follow that branch of equilibria.
"""

from dataclasses import dataclass

import numba
import numpy as np
from numba import njit, prange

from trunkline.statics.chain import Chain
from trunkline.statics.energy import Pull
from trunkline.statics.newton import follow, new_work
from trunkline.threads import thread_count

PENALTY = 1e5  # N/m, stiffness by which Newton feels a cable before its multiplier is known; no result depends on it


@dataclass
class Equilibrium:
    """B equilibria.

    Attributes:
        qpos: joint angles, rad. Shape (B, nq).
        position: tip in the base frame, m. Shape (B, 3).
        quaternion: orientation of the tip in the base frame, w first and not negative. Shape (B, 4).
        lengths: path length of each tendon, slack ones included, m. Shape (B, K).
        tensions: N, not negative. Shape (B, K).
        residual: largest joint torque out of balance, N m. Shape (B,).
        iterations: of Newton's method, all steps of the continuation together. Shape (B,).
        converged: whether this is a stable equilibrium to tolerance. Shape (B,).
        snapped: whether a branch of equilibria ended on the way here and the arm jumped. Shape (B,).
    """

    qpos: np.ndarray
    position: np.ndarray
    quaternion: np.ndarray
    lengths: np.ndarray
    tensions: np.ndarray
    residual: np.ndarray
    iterations: np.ndarray
    converged: np.ndarray
    snapped: np.ndarray

    def __getitem__(self, rows) -> "Equilibrium":
        return Equilibrium(**{name: values[rows] for name, values in vars(self).items()})


def equilibrium(chain: Chain, tensions: np.ndarray, gravity: np.ndarray) -> Equilibrium:
    """Equilibria at given tensions, each reached from rest by raising its tensions in proportion.

    Args:
        tensions: N, not negative. Shape (B, K).
        gravity: in the base frame, m/s². Shape (3,) or (B, 3).
    """
    return equilibrium_paths(chain, np.asarray(tensions, float)[:, None, :], gravity)


def equilibrium_paths(chain: Chain, tensions: np.ndarray, gravity: np.ndarray) -> Equilibrium:
    """Equilibria along P paths of S tensions each, every one followed from the one before, the first from rest.

    After a failure the rest of a path is not converged. Results come in the order of the paths, B = P S.

    Args:
        tensions: N. Shape (P, S, K).
        gravity: Shape (3,) or (P, 3).
    """
    tensions = np.ascontiguousarray(tensions, float)
    return solve_paths(chain, tensions, np.zeros_like(tensions), gravity, np.zeros(chain.tendons), np.inf, False)


def actuated(chain: Chain, commands: np.ndarray, gravity: np.ndarray) -> Equilibrium:
    """Equilibria under the model's position actuators: tension clip(kp (l - command), 0, F).

    Args:
        commands: target path lengths, m. Shape (B, K).
        gravity: Shape (3,) or (B, 3).
    """
    commands = np.ascontiguousarray(commands, float)[:, None, :]
    return solve_paths(chain, np.zeros_like(commands), commands, gravity, chain.gain, chain.max_tension, False)


def forward(chain: Chain, lengths: np.ndarray, gravity: np.ndarray) -> Equilibrium:
    """Equilibria with cables of given lengths: l_t(q) ≤ L_t, taut where equal, slack (tension 0) where shorter.

    All cables are paid out until slack and then drawn in at the same rate. Tensions have no ceiling here: compare them
    with `chain.max_tension` to know whether the motors reach these lengths.

    Args:
        lengths: m. Shape (B, K).
        gravity: Shape (3,) or (B, 3).
    """
    lengths = np.ascontiguousarray(lengths, float)[:, None, :]
    return solve_paths(chain, np.zeros_like(lengths), lengths, gravity, np.full(chain.tendons, PENALTY), np.inf, True)


def solve_paths(chain, tensions, lengths, gravity, slope, ceiling, cables) -> Equilibrium:
    paths, steps, tendons = tensions.shape
    if tendons != chain.tendons:
        raise ValueError(f"found {tendons} tendons, expected {chain.tendons}")
    gravity = np.ascontiguousarray(np.broadcast_to(np.asarray(gravity, float), (paths, 3)))
    ceiling = np.ascontiguousarray(np.broadcast_to(np.asarray(ceiling, float), (tendons,)))
    out = empty_equilibria(paths * steps, chain)
    numba.set_num_threads(min(thread_count(), numba.config.NUMBA_NUM_THREADS))
    _solve_paths(
        chain, tensions, lengths, gravity, np.ascontiguousarray(slope, float), ceiling, cables, *vars(out).values()
    )
    return out


def empty_equilibria(count: int, chain: Chain) -> Equilibrium:
    """Room for `count` equilibria, for a kernel to fill."""
    return Equilibrium(
        qpos=np.zeros((count, 2 * chain.units)),
        position=np.zeros((count, 3)),
        quaternion=np.zeros((count, 4)),
        lengths=np.zeros((count, chain.tendons)),
        tensions=np.zeros((count, chain.tendons)),
        residual=np.zeros(count),
        iterations=np.zeros(count, np.int64),
        converged=np.zeros(count, np.bool_),
        snapped=np.zeros(count, np.bool_),
    )


@njit(cache=True, parallel=True)
def _solve_paths(
    chain, all_tensions, all_lengths, gravities, slope, ceiling, cables,
    qpos, position, quaternion, lengths, tensions, residual, iterations, converged, snapped,
):  # fmt: skip
    """One path a task: what a path computes depends on nothing else, so neither does it on the thread count."""
    paths, steps, _ = all_tensions.shape
    for path in prange(paths):
        rows = slice(path * steps, (path + 1) * steps)
        _solve_path(
            chain, all_tensions[path], all_lengths[path], gravities[path], slope, ceiling, cables,
            qpos[rows], position[rows], quaternion[rows], lengths[rows], tensions[rows],
            residual[rows], iterations[rows], converged[rows], snapped[rows],
        )  # fmt: skip


@njit(cache=True)
def _solve_path(
    chain, all_tensions, all_lengths, gravity, slope, ceiling, cables,
    qpos, position, quaternion, lengths, tensions, residual, iterations, converged, snapped,
):  # fmt: skip
    """Weight first, then the pulls one after the other; the last arguments are outputs, a row a pull."""
    steps, tendons = all_tensions.shape
    work = new_work(chain.mass.shape[0], tendons)
    q = chain.rest.copy().reshape(-1)
    nothing = Pull(np.zeros(tendons), np.zeros(tendons), np.zeros(tendons), ceiling)
    here = Pull(np.zeros(tendons), slope, np.zeros(tendons), ceiling)
    loss, total, good, jumped = follow(chain, q, np.zeros(3), gravity, nothing, nothing, False, work)
    here.length[:] = work.state.lengths
    if cables:
        here.length[:] = all_lengths[0] + max(0.0, np.max(here.length - all_lengths[0]))
    for step in range(steps):
        goal = Pull(all_tensions[step].copy(), slope, all_lengths[step].copy(), ceiling)
        if good:
            loss, more, good, snap = follow(chain, q, gravity, gravity, here, goal, cables, work)
            total += more
            jumped = jumped or snap
            here.tension[:] = goal.tension
            here.length[:] = goal.length
        qpos[step] = q
        lengths[step] = work.state.lengths
        tensions[step] = work.state.tensions
        residual[step] = loss
        iterations[step] = total
        converged[step] = good
        snapped[step] = jumped
        tip_pose(chain, work.state, position[step], quaternion[step])
        total = 0


@njit(cache=True)
def tip_pose(chain, state, position, quaternion):
    """Fill the tip's position (3,) and quaternion (4,), w first and not negative, from the last unit's rotation."""
    r = state.rotation[-1]
    for k in range(3):
        moved = r[k, 0] * chain.tip[0] + r[k, 1] * chain.tip[1] + r[k, 2] * chain.tip[2]
        position[k] = state.position[-1, k] + moved
    # Shepperd's method: divide by the largest component
    trace = r[0, 0] + r[1, 1] + r[2, 2]
    size = np.array([trace, r[0, 0], r[1, 1], r[2, 2]])
    best = np.argmax(size)
    p = np.empty(4)
    if best == 0:
        p[0], p[1], p[2], p[3] = 1 + trace, r[2, 1] - r[1, 2], r[0, 2] - r[2, 0], r[1, 0] - r[0, 1]
    else:
        i = best - 1
        j, k = (i + 1) % 3, (i + 2) % 3
        p[0] = r[k, j] - r[j, k]
        p[1 + i] = 1 + r[i, i] - r[j, j] - r[k, k]
        p[1 + j] = r[j, i] + r[i, j]
        p[1 + k] = r[k, i] + r[i, k]
    s = chain.tip_quaternion
    quaternion[0] = p[0] * s[0] - p[1] * s[1] - p[2] * s[2] - p[3] * s[3]
    quaternion[1] = p[0] * s[1] + p[1] * s[0] + p[2] * s[3] - p[3] * s[2]
    quaternion[2] = p[0] * s[2] - p[1] * s[3] + p[2] * s[0] + p[3] * s[1]
    quaternion[3] = p[0] * s[3] + p[1] * s[2] - p[2] * s[1] + p[3] * s[0]
    norm = np.sqrt(np.sum(quaternion**2))
    sign = -1.0 if quaternion[0] < 0 else 1.0
    for k in range(4):
        quaternion[k] *= sign / norm
