"""Forward kinematics of the arm: its equilibrium under gravity and tendons that only pull, many at a time.

Three ways to say how the tendons pull: by tensions (`equilibrium`, `equilibrium_paths`), by the lengths of
inextensible cables (`forward`), by the commands of the model's position actuators (`actuated`).
All start from the arm at rest without pull, its weight growing from nothing, and follow that branch of equilibria.
Where the chain has capstan friction, its tendons have been drawn in from there; tensions are those at the motors.
"""

from dataclasses import dataclass

import numpy as np
from scipy.spatial.transform import Rotation

from trunkline.frames import rotation_from_wxyz, wxyz_from_rotation
from trunkline.model.statics.chain import Chain
from trunkline.model.statics.continuation import EquilibriumRows, solve_paths
from trunkline.model.statics.kernel import over_rows
from trunkline.model.statics.placement import place_chords

# N/m, stiffness by which Newton feels a cable before its multiplier is known; an equilibrium does not depend on it
PENALTY = 1e5
SOFT_PENALTY = 10.0  # with capstan friction: a stiffer one leaps to other shapes that have the same lengths


@dataclass
class Equilibrium:
    """B equilibria.

    Attributes:
        qpos: joint angles, rad. Shape (B, nq).
        position: tip in the base frame, m. Shape (B, 3).
        quaternion: orientation of the tip in the base frame, w first and not negative. Shape (B, 4).
        lengths: path length of each tendon, slack ones included, m. Shape (B, K).
        tensions: N, not negative. Shape (B, K).
        commands: what position actuators are sent so that they hold this, l - T / kp: a slack tendon's path length,
            less than it where a motor pulls, m; of motors that are commanded by force the tensions, N. Shape (B, K).
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
    commands: np.ndarray
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
    return follow(chain, tensions, np.zeros_like(tensions), gravity, np.zeros(chain.tendons), np.inf)


def actuated(chain: Chain, commands: np.ndarray, gravity: np.ndarray) -> Equilibrium:
    """Equilibria under the model's actuators: tension clip(kp (l - command), 0, F), or clip(command, 0, F) of motors
    that are commanded by force.

    Args:
        commands: target path lengths, m, or tensions, N. Shape (B, K).
        gravity: Shape (3,) or (B, 3).
    """
    tensions, lengths = chain.pulls(np.ascontiguousarray(commands, float)[:, None, :])
    return follow(chain, tensions, lengths, gravity, chain.gain, chain.max_tension)


def forward(chain: Chain, lengths: np.ndarray, gravity: np.ndarray) -> Equilibrium:
    """Equilibria with cables of given lengths: l_t(q) ≤ L_t, taut where equal, slack (tension 0) where shorter.

    All cables are paid out until slack and then drawn in at the same rate. Tensions have no ceiling here: compare them
    with `chain.max_tension` to know whether the motors reach these lengths.

    Args:
        lengths: m. Shape (B, K).
        gravity: Shape (3,) or (B, 3).
    """
    lengths = np.ascontiguousarray(lengths, float)[:, None, :]
    slope = np.full(chain.tendons, penalty(chain))
    return follow(chain, np.zeros_like(lengths), lengths, gravity, slope, np.inf, cables=True)


def penalty(chain: Chain) -> float:
    """Stiffness of cables before their multipliers are known, N/m."""
    return SOFT_PENALTY if chain.capstan else PENALTY


def follow(
    chain: Chain,
    tensions: np.ndarray,
    lengths: np.ndarray,
    gravity: np.ndarray,
    slope: np.ndarray,
    ceiling: np.ndarray | float,
    cables: bool = False,
    torques: np.ndarray | None = None,
) -> Equilibrium:
    """Equilibria along P paths of S pulls each, in the words of `energy.Pull`.

    Args:
        tensions, lengths: Shape (P, S, K).
        gravity: Shape (3,) or (P, 3).
        slope: Shape (K,).
        ceiling: Shape () or (K,).
        cables: whether `lengths` are those of cables, which no tendon exceeds.
        torques: Shape (P, n, 2), none if not given.

    Raises:
        ValueError: if the tendons are not those of the chain.
    """
    paths, steps, tendons = tensions.shape
    if tendons != chain.tendons:
        raise ValueError(f"found {tendons} tendons, expected {chain.tendons}")
    if torques is None:
        torques = np.zeros((paths, chain.units, 2))
    rows, gravities = room(chain, paths * steps), plain(gravity, (paths, 3))
    over_rows(
        solve_paths, paths, chain, plain(tensions), plain(lengths), gravities, plain(slope), plain(ceiling, (tendons,)),
        plain(torques), loose_chords(chain, gravities), cables, rows,
    )  # fmt: skip
    return equilibria(chain, rows)


def loose_chords(chain: Chain, gravities: np.ndarray) -> np.ndarray:
    """What capstan friction counts sliding from: the tendons' chords across the joints, m, of the arm without pull.

    Args:
        gravities: Shape (B, 3).

    Returns:
        Shape (B, n, K), zero where the chain has no friction.
    """
    if chain.capstan == 0:
        return np.zeros((len(gravities), chain.units, chain.tendons))
    distinct, which = np.unique(gravities, axis=0, return_inverse=True)
    chords = np.zeros((len(distinct), chain.units, chain.tendons))
    hanging = equilibrium(chain._replace(capstan=0.0), np.zeros((len(distinct), chain.tendons)), distinct)
    over_rows(place_chords, len(distinct), chain, hanging.qpos, chords)
    return chords[which.reshape(-1)]


def plain(values: np.ndarray | float, shape: tuple | None = None) -> np.ndarray:
    """A copy in C order that may be written to: numba compiles a kernel anew for arrays of every other kind."""
    return np.array(values if shape is None else np.broadcast_to(values, shape), float, order="C")


def room(chain: Chain, count: int) -> EquilibriumRows:
    """Room for `count` equilibria, for a kernel to fill."""
    return EquilibriumRows(
        qpos=np.zeros((count, 2 * chain.units)),
        rotation=np.zeros((count, 3, 3)),
        position=np.zeros((count, 3)),
        lengths=np.zeros((count, chain.tendons)),
        tensions=np.zeros((count, chain.tendons)),
        residual=np.zeros(count),
        iterations=np.zeros(count, np.int64),
        converged=np.zeros(count, np.bool_),
        snapped=np.zeros(count, np.bool_),
    )


def equilibria(chain: Chain, rows: EquilibriumRows) -> Equilibrium:
    """What the kernels found, with the pose of the tip in place of the last unit's."""
    rotation = Rotation.from_matrix(rows.rotation, assume_valid=True)
    values = rows._asdict() | {
        "position": rows.position + rows.rotation @ chain.tip,
        "commands": chain.commands(rows.lengths, rows.tensions),
    }
    del values["rotation"]
    return Equilibrium(quaternion=wxyz_from_rotation(rotation * rotation_from_wxyz(chain.tip_quaternion)), **values)
