"""Twins of arms that no stage has identified."""

from pathlib import Path

import mujoco
import numpy as np

from trunkline.identification.parameters.parameters import PARAMETERS
from trunkline.model.arm_model import ArmModel
from trunkline.twin.posterior import Posterior
from trunkline.twin.twin import Provenance, Twin


def twin_of(model: mujoco.MjModel, tables: dict[str, dict] | None = None) -> Twin:
    """Of a model, as if stages had written `tables` of it."""
    tables = tables or {}
    provenance = Provenance(Path("arm.xml"), {}, tables)
    return Twin(mujoco.MjSpec(), ArmModel(model), Posterior.from_tables(tables), provenance)


def posterior_about(
    model: mujoco.MjModel, deviations: dict[str, float], correlation: float = 0.0, degrees: float = 1e6
) -> Posterior:
    """Of what `model` has, within no range. deviations: on the parameters' own axes."""
    names, count = list(deviations), len(deviations)
    estimate = np.array([PARAMETERS[name].coordinate(PARAMETERS[name].read(model)) for name in names])
    matrix, far = np.full((count, count), correlation), np.full(count, np.inf)
    np.fill_diagonal(matrix, 1.0)
    spread = np.array(list(deviations.values()))
    return Posterior(names, ["a"] * count, estimate, spread, np.full(count, degrees), matrix, -far, far)
