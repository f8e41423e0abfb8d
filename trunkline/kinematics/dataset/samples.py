"""The samples as others read them: the table that the stage fk_dataset writes."""

from pathlib import Path

import numpy as np
import pandas as pd

from trunkline.errors import InputError
from trunkline.frames import downwards
from trunkline.kinematics.dataset.columns import DOWN, POSE, command_columns, length_columns

ALIKE = 1e-9  # by which directions of gravity may differ and be the same


def read_samples(path: Path, tendons: int, *columns: str) -> pd.DataFrame:
    """The table at `path`, of an arm of `tendons`, at two gravity angles or more, or without gravity.

    Args:
        columns: that must be there, beside gravity, the tip's pose, the tendons' lengths and commands.

    Raises:
        InputError: there is no such file, or it lacks a column or a second gravity angle.
    """
    if not path.is_file():
        raise InputError(f"{path}: no such file, expected the samples of the fk_dataset stage (run `dvc repro`)")
    table = pd.read_parquet(path)
    for name in ("theta_g", *DOWN, *POSE, *length_columns(tendons), *command_columns(tendons), *columns):
        if name not in table:
            raise InputError(f"{path}: found no column {name!r}, expected samples of an arm of {tendons} tendons")
    angles = table["theta_g"].nunique()
    if angles < 2 and not weightless(table):
        raise InputError(f"{path}: found {angles} gravity angle, expected at least 2: others lie between them")
    return table


def weightless(table: pd.DataFrame) -> bool:
    """Whether nothing pulls but the tendons in these samples."""
    return not table[DOWN].to_numpy().any()


def from_any_side(table: pd.DataFrame) -> bool:
    """Whether gravity leaves the plane of tilt in these samples, so that no angle about base +y tells of it."""
    if weightless(table):
        return False
    tilts = downwards(table["theta_g"].to_numpy(), np.zeros(len(table)))
    return bool(np.abs(table[DOWN].to_numpy() - tilts).max() > ALIKE)
