"""Build the CAD model of the arm from geometry and material alone."""

from pathlib import Path

from trunkline.model.arm.cad import CadArm
from trunkline.model.arm.kinds import Description, described_arm
from trunkline.model.arm_model import ArmModel
from trunkline.model.statics.chain import read_chain
from trunkline.model.statics.supported import require_supported
from trunkline.pipeline.config import own_or_project
from trunkline.pipeline.stage import output_folder, run_stage, write_metrics
from trunkline.report.figures.arm import arm_figure
from trunkline.report.figures.style import save_figure

ARTIFACTS = Path("artifacts/build_mjcf")

Config = Description


def cad_arm(config: Config) -> CadArm:
    return described_arm(config, own_or_project(Path("."), "conf"))


def main(config: Config) -> None:
    arm = cad_arm(config)
    model = arm.spec.compile()
    if model.nu or len(ArmModel(model).cables):  # refused here, and not hours later by what first needs the statics
        read_chain(model)
    else:
        require_supported(model)
    with output_folder(ARTIFACTS) as folder:
        (folder / "arm.xml").write_text(arm.spec.to_xml())
        save_figure(arm_figure(model), folder / "arm.png")
        write_metrics(folder, arm.metrics)


if __name__ == "__main__":
    run_stage("build_mjcf", Config, main)
