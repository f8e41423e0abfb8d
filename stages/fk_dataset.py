"""Sample static equilibria of the calibrated arm over directions of gravity, uniform in the workspace."""

from pathlib import Path

from trunkline.compute.progress import progress
from trunkline.kinematics.dataset.gather import Sampling, gather
from trunkline.kinematics.dataset.report import summary, unevenness_table
from trunkline.model.arm_model import ArmModel
from trunkline.model.statics.chain import read_chain
from trunkline.model_files import read_model
from trunkline.pipeline.stage import output_folder, run_stage, write_metrics
from trunkline.report.figures.dataset import density_figure, deviation_figure
from trunkline.report.figures.style import save_figure
from trunkline.settings import settings

DATA, ARTIFACTS = Path("data/processed/fk_dataset"), Path("artifacts/fk_dataset")


@settings
class Config(Sampling):
    """See conf/fk_dataset/config.yaml. model: MJCF file of the arm."""

    model: str


def main(config: Config) -> None:
    model = read_model(Path(config.model))
    ArmModel(model).require_stiff_units("fk_dataset.model")
    chain = read_chain(model).smooth
    with progress(len(config.gravity.downs), "fk_dataset", "gravities") as bar:
        gathered = gather(model, chain, config, lambda **counts: bar.update(1, **counts))

    with output_folder(DATA) as folder:
        gathered.table.to_parquet(folder / "samples.parquet", index=False)
    with output_folder(ARTIFACTS) as folder:
        save_figure(density_figure(gathered.densities), folder / "density.png")
        save_figure(deviation_figure(gathered.deviation), folder / "deviation.png")
        unevenness_table(gathered.densities).to_csv(folder / "density.csv", index=False, float_format="%.6g")
        gathered.deviation.to_csv(folder / "deviation.csv", index=False, float_format="%.6g")
        write_metrics(folder, summary(gathered))


if __name__ == "__main__":
    run_stage("fk_dataset", Config, main)
