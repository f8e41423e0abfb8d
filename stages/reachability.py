"""Map the reach of the rigid arm, of the soft arm per gravity angle, and of both together."""

from io import BytesIO
from pathlib import Path
from zipfile import ZIP_DEFLATED, ZipFile, ZipInfo

import numpy as np

from trunkline.compute.progress import progress
from trunkline.files import file_digest
from trunkline.kinematics.panda.mjcf import panda_spec
from trunkline.kinematics.reachability.report import heldout_table, summary
from trunkline.kinematics.reachability.sampled import read_tips
from trunkline.kinematics.reachability.survey import SurveySettings, survey
from trunkline.kinematics.sdf.mesh import write_obj
from trunkline.model.arm_model import ArmModel
from trunkline.model.statics.chain import read_chain
from trunkline.model_files import read_model
from trunkline.pipeline.stage import output_folder, run_stage, write_metrics
from trunkline.report.figures.maps import heldout_figure, maps_figure, slices_figure
from trunkline.report.figures.style import save_figure
from trunkline.settings import settings
from trunkline.twin.discrepancy import FILE, read_lacking

SAMPLES = Path("data/processed/fk_dataset/samples.parquet")
ARTIFACTS, LACKING = Path("artifacts/reachability"), Path("artifacts") / FILE


@settings
class Config(SurveySettings):
    """See conf/reachability/config.yaml. model: MJCF file of the arm."""

    model: str


def main(config: Config) -> None:
    model = read_model(Path(config.model))
    ArmModel(model).require_stiff_units("reachability.model")
    chain = read_chain(model).smooth
    lacking = read_lacking(LACKING, file_digest(Path(config.model)))
    tips_at = read_tips(SAMPLES, chain, config.soft, config.seed, lacking and lacking.residual_map)
    with progress(config.parts(tips_at), "reachability", "parts") as bar:
        maps, check = survey(tips_at, config, lambda part: bar.update(1, done=part))

    with output_folder(ARTIFACTS) as folder:
        write_arrays(folder / "grids.npz", maps.arrays())
        (folder / "meshes").mkdir()
        for name, mesh in maps.meshes().items():
            write_obj(folder / "meshes" / f"{name}.obj", mesh, f"Reachable set: {name}")
        (folder / "panda.xml").write_text(panda_spec(config.rigid.mount_offset).to_xml())
        heldout, tips = heldout_table(check), [sample.positions for sample in tips_at.samples]
        heldout.to_csv(folder / "heldout.csv", index=False, float_format="%.6g")
        save_figure(maps_figure(maps, tips), folder / "maps.png")
        save_figure(slices_figure(maps, tips, check), folder / "slices.png")
        save_figure(heldout_figure(heldout, config.spot_check.outside), folder / "heldout.png")
        write_metrics(folder, summary(maps, check))


def write_arrays(path: Path, arrays: dict[str, np.ndarray]) -> None:
    """An `.npz` whose bytes are the same by every Python: of those of NumPy the headers changed within 3.11."""
    with ZipFile(path, "w", ZIP_DEFLATED) as packed:
        for name, array in arrays.items():
            content = BytesIO()
            np.save(content, array, allow_pickle=False)
            packed.writestr(ZipInfo(f"{name}.npy"), content.getvalue(), ZIP_DEFLATED)


if __name__ == "__main__":
    run_stage("reachability", Config, main)
