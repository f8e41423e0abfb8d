"""The table of samples: gravity, tip pose, path lengths, tensions, and how they answer to each other."""

from dataclasses import dataclass

import numpy as np
import pandas as pd

from trunkline.frames import STANDARD_GRAVITY, tilt_of_gravity
from trunkline.kinematics.dataset.columns import AXES, DOWN, POSE, command_columns, length_columns, tension_columns
from trunkline.kinematics.dataset.sampling import Candidates, crowding, sample_at, thin
from trunkline.model.statics.chain import Chain
from trunkline.model.statics.sensitivity import sensitivity


@dataclass
class Density:
    """Tips under one gravity before and after thinning.

    Attributes:
        down: direction of gravity in the base frame. Shape (3,).
        before, after: tip positions, m. Shapes (N, 3), (M, 3).
        failed, snapped: candidates dropped, see `Candidates`.
    """

    down: np.ndarray
    before: np.ndarray
    after: np.ndarray
    failed: int
    snapped: int

    @property
    def angle(self) -> float:
        """Of gravity to the straight arm, rad; 0 without it."""
        return angle_of(self.down)

    def unevenness(self) -> tuple[float, float]:
        """Standard deviation over mean of the number of tips in occupied cells of 2 cm, before and after."""
        before, after = crowding(self.before, 0.02), crowding(self.after, 0.02)
        return float(before.std() / before.mean()), float(after.std() / after.mean())


def sample_table(
    chain: Chain,
    down: np.ndarray,
    count: int,
    directions: int,
    steps: int,
    rng: np.random.Generator,
    deepest: np.ndarray | None = None,
) -> tuple[pd.DataFrame, Density]:
    """About `count` samples under one gravity, thinned in the space of tips.

    Columns: theta_g (rad), gx, gy, gz (direction of gravity), x, y, z (m), qw, qx, qy, qz, l1… (m, path lengths), f1…
    (N, tensions), c1… (m or N, commands), residual (N m), iterations, set, and the derivatives by tension dx_df1… (tip,
    m/N), rx_df1… (turn of the tip as a rotation vector in the base frame, rad/N) and dl1_df1… (path lengths, m/N).
    The planar sets are kept beside the thinned samples, thinned along their own curves.

    Args:
        down: direction of gravity in the base frame, of unit length, or zero without it. Shape (3,).
        directions, steps, deepest: of the candidates, see `sample_at`.
    """
    candidates = sample_at(chain, STANDARD_GRAVITY * down, directions, steps, rng, deepest=deepest)
    tips = candidates.equilibrium.position
    planar = {kind: np.flatnonzero(candidates.kind == kind) for kind in ("dorsal", "ventral")}
    on_curves = [rows[thin(tips[rows], max(1, count // 50), rng)] for rows in planar.values() if len(rows)]
    general = np.flatnonzero(candidates.kind == "general")
    share = count - sum(len(rows) for rows in on_curves)
    retained = np.sort(np.concatenate([general[thin(tips[general], share, rng)], *on_curves]))
    density = Density(down, tips, tips[retained], candidates.failed, candidates.snapped)
    return _table(chain, down, candidates, retained), density


def _table(chain: Chain, down: np.ndarray, candidates: Candidates, retained: np.ndarray) -> pd.DataFrame:
    rest = candidates.equilibrium[retained]
    slopes = sensitivity(chain, rest.qpos, rest.tensions, candidates.gravity)
    columns = {"theta_g": np.full(len(retained), angle_of(down))}
    columns |= {name: np.full(len(retained), part) for name, part in zip(DOWN, down, strict=True)}
    columns |= dict(zip(POSE, np.concatenate([rest.position, rest.quaternion], axis=1).T, strict=True))
    columns |= dict(zip(length_columns(chain.tendons), rest.lengths.T, strict=True))
    columns |= dict(zip(tension_columns(chain.tendons), rest.tensions.T, strict=True))
    columns |= dict(zip(command_columns(chain.tendons), rest.commands.T, strict=True))
    columns |= {"residual": rest.residual, "iterations": rest.iterations, "set": candidates.kind[retained]}
    for t in range(chain.tendons):
        columns |= {f"d{axis}_df{t + 1}": slopes.tip_by_tension[:, k, t] for k, axis in enumerate(AXES)}
        columns |= {f"r{axis}_df{t + 1}": slopes.turn_by_tension[:, k, t] for k, axis in enumerate(AXES)}
        columns |= {f"dl{s + 1}_df{t + 1}": slopes.length_by_tension[:, s, t] for s in range(chain.tendons)}
    return pd.DataFrame(columns)


def angle_of(down: np.ndarray) -> float:
    """Of gravity in the direction `down` (3,) to the straight arm, rad; 0 where there is none."""
    return tilt_of_gravity(down) if down.any() else 0.0


def tip_by_tension(table: pd.DataFrame, tendons: int) -> np.ndarray:
    """∂(tip position)/∂(tensions), m/N. Shape (N, 3, K)."""
    names = [[f"d{axis}_df{t + 1}" for t in range(tendons)] for axis in AXES]
    return np.stack([table[row].to_numpy() for row in names], axis=1)


def turn_by_tension(table: pd.DataFrame, tendons: int) -> np.ndarray:
    """∂(rotation vector of the tip)/∂(tensions), rad/N. Shape (N, 3, K)."""
    names = [[f"r{axis}_df{t + 1}" for t in range(tendons)] for axis in AXES]
    return np.stack([table[row].to_numpy() for row in names], axis=1)


def length_by_tension(table: pd.DataFrame, tendons: int) -> np.ndarray:
    """∂(path lengths)/∂(tensions), m/N. Shape (N, K, K)."""
    names = [[f"dl{s + 1}_df{t + 1}" for t in range(tendons)] for s in range(tendons)]
    return np.stack([table[row].to_numpy() for row in names], axis=1)


def command_by_tension(table: pd.DataFrame, gain: np.ndarray) -> np.ndarray:
    """∂(commands)/∂(tensions) with actuators of `gain` (K,), N/m: m/N. Shape (N, K, K)."""
    return length_by_tension(table, len(gain)) - np.diag(1 / gain)


def split(count: int, validate_share: float, rng: np.random.Generator) -> np.ndarray:
    """ "train" or "validate" for each of `count` samples, at random. Shape (count,)."""
    names = np.full(count, "train", dtype=object)
    names[rng.permutation(count)[: round(validate_share * count)]] = "validate"
    return names
