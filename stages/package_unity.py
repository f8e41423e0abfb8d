"""Pack the twin for Unity: calibrated MJCF, IK network, reachability maps and a manifest, in one tarball."""

from pathlib import Path
from typing import Annotated

import mujoco
import numpy as np
from pydantic import Field

from trunkline.ar.conformance.vectors import vectors, with_shared_vectors
from trunkline.ar.teleop.settings import Teleop
from trunkline.kinematics.panda.mounts import Robot
from trunkline.model.arm_model import ArmModel
from trunkline.pipeline.stage import output_folder, run_stage, write_metrics
from trunkline.report.figures.package import roundtrip_figure
from trunkline.report.figures.style import save_figure
from trunkline.settings import settings
from trunkline.twin.package import MANIFEST, read_tarball
from trunkline.unity.assemble import Label, Trajectory, assemble, compare
from trunkline.unity.comparison import curled, read_models
from trunkline.unity.readers import refusals
from trunkline.unity.sources import read_sources
from trunkline.unity.start_check import started
from trunkline.unity.upm_package import write_tarball

ARTIFACTS = Path("artifacts/package_unity")


@settings
class Config(Label):
    roundtrip: Trajectory
    robot: Robot
    core: Teleop
    start_tilts_deg: Annotated[list[Annotated[float, Field(ge=0, le=180)]], Field(min_length=1)]


def main(config: Config) -> None:
    sources = read_sources(Path("."))
    ArmModel(mujoco.MjModel.from_xml_string(sources.mjcf)).require_lengths("package_unity")
    files, violations = assemble(config, sources, config.roundtrip, config.robot)
    files = with_shared_vectors(files, config.core)
    for violation in violations:
        print(f"package_unity: broken rule: {violation}")

    with output_folder(ARTIFACTS) as out:
        tarball = out / f"{config.name}-{config.version}.tgz"
        write_tarball(tarball, files)
        packed = read_tarball(tarball)
        refused = refusals(packed)
        for path, reason in refused.items():
            print(f"package_unity: another reader refuses {path}: {reason}")
        (out / "manifest.json").write_bytes(packed[MANIFEST])
        models, whole = read_models(sources.mjcf, packed), mujoco.MjModel.from_xml_string(sources.mjcf)
        motion = curled(models, config.roundtrip)
        motion.table().to_csv(out / "roundtrip.csv", index=False, float_format="%.6g")
        save_figure(roundtrip_figure(motion.time, motion.tips, motion.gaps_mm()), out / "roundtrip.png")
        metrics = {
            "rule_violations": len(violations),
            "roundtrip_max_deviation_mm": compare(models["calibrated"], models["packed"], config.roundtrip)[0],
            "dropped_max_deviation_mm": compare(whole, models["packed"], config.roundtrip)[0],
            "foreign_readers_failed": len(refused),
            "files": len(packed),
            "bytes": tarball.stat().st_size,
            "shared_vectors": vectors(packed),
        }
        metrics |= started(models["calibrated"], packed, np.radians(config.start_tilts_deg).tolist())
        write_metrics(out, metrics)


if __name__ == "__main__":
    run_stage("package_unity", Config, main)
