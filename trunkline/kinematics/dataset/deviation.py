"""How far the statics are from MuJoCo at rest, and how far friction, which is off in both, may hold the tip."""

import mujoco
import numpy as np
import pandas as pd

from trunkline.compute.scheduler import spread_rows
from trunkline.errors import InputError
from trunkline.frames import STANDARD_GRAVITY
from trunkline.kinematics.dataset.columns import DOWN, command_columns, tension_columns
from trunkline.model.arm_model import ArmModel
from trunkline.model.simulation.rest import settle
from trunkline.model.statics.chain import Chain
from trunkline.model.statics.hysteresis import friction_band, model_friction


def mujoco_deviation(
    model: mujoco.MjModel, chain: Chain, table: pd.DataFrame, count: int, rng: np.random.Generator
) -> pd.DataFrame:
    """Distance of `count` random samples' tips from those of MuJoCo settled to rest under the same actuators.

    Returns:
        Columns theta_g (rad), largest_tension (N), deviation_mm, rested, and friction_band_mm: how far apart friction,
        which is off in the comparison, may hold the tip (NaN where the ends of its band were not found).

    Raises:
        InputError: if there are fewer samples.
    """
    if count > len(table):
        raise InputError(f"fk_dataset.check: found {len(table)} samples, expected at least the {count} to be checked")
    rows = table.iloc[np.sort(rng.permutation(len(table))[:count])]
    tensions = rows[tension_columns(chain.tendons)].to_numpy()
    commands = rows[command_columns(chain.tendons)].to_numpy()
    gravity = STANDARD_GRAVITY * rows[DOWN].to_numpy()
    settled, rested, width = spread_rows(_settled, (tensions, commands, gravity), (model, chain))
    position = rows[["x", "y", "z"]].to_numpy()
    deviation = np.linalg.norm(settled - position, axis=1)
    return pd.DataFrame(
        {
            "theta_g": rows["theta_g"].to_numpy(),
            "largest_tension": tensions.max(axis=1),
            "deviation_mm": deviation * 1e3,
            "rested": rested,
            "friction_band_mm": width * 1e3,
        }
    )


def _settled(
    fixed: tuple[mujoco.MjModel, Chain], rows: tuple[np.ndarray, np.ndarray, np.ndarray]
) -> tuple[np.ndarray, np.ndarray, np.ndarray]:
    """Of some samples' `tensions`, N, and `commands`, m (n, K), under `gravity`, m/s² (n, 3): the tips in MuJoCo, m
    (n, 3), which of them rested (n,), and how far apart friction may hold them, m (n,)."""
    (model, chain), (tensions, commands, gravity) = fixed, rows
    settled = settle(model, commands[:, model.actuator_trnid[:, 0]], gravity)
    band = friction_band(chain, tensions, gravity, *model_friction(model), capstan=ArmModel(model).capstan_friction)
    return settled.position, settled.rested, band.width
