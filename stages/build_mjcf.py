"""Build the CAD model of the arm from geometry and material alone."""

from pathlib import Path

from trunkline.arm.cad import CadArm
from trunkline.arm.holes import Holes, add_holes
from trunkline.arm.joints import Joints, add_elements
from trunkline.arm.kinds import Arm
from trunkline.arm.mjcf import Actuation, Solver
from trunkline.figures.arm import arm_figure
from trunkline.figures.style import save_figure
from trunkline.pipeline.config import own_or_project
from trunkline.pipeline.stage import output_folder, run_stage, write_json
from trunkline.settings import settings
from trunkline.statics.chain import read_chain

ARTIFACTS = Path("artifacts/build_mjcf")
MODELS = "build_mjcf/mjcf"  # folder below conf/ of arms that come as MJCF


@settings
class Config:
    arm: Arm
    joints: Joints
    holes: Holes
    actuation: Actuation
    solver: Solver


def cad_arm(config: Config) -> CadArm:
    arm = config.arm.build(config.actuation, config.solver, own_or_project(Path("."), "conf") / MODELS)
    add_elements(arm.spec, config.joints, config.solver.armature)
    add_holes(arm.spec, config.holes)
    return arm


def main(config: Config) -> None:
    arm = cad_arm(config)
    model = arm.spec.compile()
    if model.nu:  # refused here rather than hours later, by the first stage that needs the statics
        read_chain(model)
    with output_folder(ARTIFACTS) as folder:
        (folder / "arm.xml").write_text(arm.spec.to_xml())
        save_figure(arm_figure(model), folder / "arm.png")
        write_json(folder / "metrics.json", arm.metrics)


if __name__ == "__main__":
    run_stage("build_mjcf", Config, main)
