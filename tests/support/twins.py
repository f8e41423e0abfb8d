"""Twins of arms that no stage has identified."""

from pathlib import Path

import mujoco

from trunkline.twin.posterior import Posterior
from trunkline.twin.twin import Provenance, Twin


def twin_of(model: mujoco.MjModel, tables: dict[str, dict] | None = None) -> Twin:
    """Of a model, as if stages had written `tables` of it."""
    tables = tables or {}
    return Twin(mujoco.MjSpec(), model, Posterior.from_tables(tables), Provenance(Path("arm.xml"), {}, tables))
