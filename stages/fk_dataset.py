"""Sample static equilibria of the calibrated arm over gravity angles, uniform in the workspace."""

from pathlib import Path

import numpy as np
import pandas as pd
from pydantic import Field

from trunkline.dataset.deviation import mujoco_deviation
from trunkline.dataset.table import Density, sample_table, split
from trunkline.figures.dataset import density_figure, deviation_figure
from trunkline.figures.style import save_figure
from trunkline.pipeline.inputs import read_model
from trunkline.pipeline.stage import output_folder, run_stage, write_json
from trunkline.progress import progress
from trunkline.settings import settings
from trunkline.statics.chain import read_chain

MODEL = Path("artifacts/identify_control/arm.xml")
DATA = Path("data/processed/fk_dataset")
ARTIFACTS = Path("artifacts/fk_dataset")


@settings
class Config:
    samples: int = Field(ge=1000)
    angles_deg: list[float] = Field(min_length=1)
    seed: int = Field(ge=0)
    directions: int = Field(ge=8)
    steps: int = Field(ge=8)
    validate_share: float = Field(gt=0, lt=1)
    check: int = Field(ge=1)

    def __post_init__(self) -> None:
        if any(not 0 <= angle <= 180 for angle in self.angles_deg) or len(set(self.angles_deg)) < len(self.angles_deg):
            raise ValueError(f"angles_deg: found {self.angles_deg}, expected different angles from 0 to 180")


def main(config: Config) -> None:
    model = read_model(MODEL)
    chain = read_chain(model)
    rng = np.random.default_rng(config.seed)
    angles = np.radians(sorted(config.angles_deg))
    tables, densities = [], []
    with progress(len(angles), "fk_dataset", "angles") as bar:
        for angle in angles:
            count = config.samples // len(angles)
            table, density = sample_table(chain, angle, count, config.directions, config.steps, rng)
            tables.append(table)
            densities.append(density)
            bar.update(1, kept=sum(map(len, tables)), dropped=density.failed + density.snapped)
    table = pd.concat(tables, ignore_index=True)
    table["split"] = split(len(table), config.validate_share, rng)
    print(f"fk_dataset: settling {config.check} samples in MuJoCo", flush=True)
    deviation = mujoco_deviation(model, chain, table, config.check, rng)

    with output_folder(DATA) as folder:
        table.to_parquet(folder / "samples.parquet", index=False)
    with output_folder(ARTIFACTS) as folder:
        save_figure(density_figure(densities), folder / "density.png")
        save_figure(deviation_figure(deviation), folder / "deviation.png")
        unevenness_table(densities).to_csv(folder / "density.csv", index=False, float_format="%.6g")
        deviation.to_csv(folder / "deviation.csv", index=False, float_format="%.6g")
        write_json(folder / "metrics.json", metrics(table, densities, deviation))


def unevenness_table(densities: list[Density]) -> pd.DataFrame:
    """Per gravity angle and stage of thinning, the spread of the tip density."""
    rows = []
    for density in densities:
        for name, value in zip(("before", "after"), density.unevenness(), strict=True):
            rows.append({"angle_deg": np.degrees(density.tilt).round(6), "unevenness": value, "thinning": name})
    return pd.DataFrame(rows)


def metrics(table: pd.DataFrame, densities: list[Density], deviation: pd.DataFrame) -> dict:
    """What SPEC section 11 asks for, what was dropped, and how even the samples are."""
    before, after = np.mean([density.unevenness() for density in densities], axis=0)
    return {
        "samples": len(table),
        "angles": len(densities),
        "candidates": sum(len(d.before) + d.failed + d.snapped for d in densities),
        "failed": sum(d.failed for d in densities),
        "snapped": sum(d.snapped for d in densities),
        "residual_max": table["residual"].max(),
        "iterations_median": table["iterations"].median(),
        "density_unevenness": {"before": before, "after": after},
        "mujoco_deviation_mm": spread(deviation["deviation_mm"]),
        "mujoco_checked": len(deviation),
        "mujoco_rested": int(deviation["rested"].sum()),
        "friction_band_mm": spread(deviation["friction_band_mm"]),
        "friction_band_found": int(deviation["friction_band_mm"].notna().sum()),
    }


def spread(values: pd.Series) -> dict:
    return {"median": values.median(), "p95": values.quantile(0.95), "max": values.max()}


if __name__ == "__main__":
    run_stage("fk_dataset", Config, main)
