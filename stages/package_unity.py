"""Pack the twin for Unity: calibrated MJCF, IK network, reachability maps and a manifest, in one tarball."""

import json
from pathlib import Path

import mujoco
import numpy as np
import pandas as pd
from pydantic import Field, PositiveFloat

from trunkline.errors import InputError
from trunkline.figures.package import roundtrip_figure
from trunkline.figures.style import save_figure
from trunkline.pipeline.inputs import existing
from trunkline.pipeline.stage import output_folder, run_stage, write_json
from trunkline.settings import settings
from trunkline.unity.importer import as_imported
from trunkline.unity.linearize import compile_with
from trunkline.unity.manifest import Manifest
from trunkline.unity.package import read_tarball, write_tarball
from trunkline.unity.roundtrip import curl, deviation, simulate
from trunkline.unity.twin import MANIFEST, MODEL, Label, Sources, Trajectory, assemble, compare
from trunkline.version import __version__

ARTIFACTS = Path("artifacts")
MEASURED = ["ingest", "filter", "build_mjcf", "identify_stiffness", "identify_damping", "identify_control"]
MEASURED += ["fk_dataset", "train_ik", "reachability"]


@settings
class Roundtrip:
    duration: PositiveFloat
    pull: PositiveFloat
    tilts_deg: list[float] = Field(min_length=1)


@settings
class Config:
    name: str = Field(pattern=r"^[a-z0-9-]+(\.[a-z0-9-]+){2,}$")
    version: str = Field(pattern=r"^\d+\.\d+\.\d+$")
    display_name: str
    description: str
    unity: str = Field(pattern=r"^\d+\.\d+$")
    roundtrip: Roundtrip


def main(config: Config) -> None:
    trajectory = Trajectory(
        duration=config.roundtrip.duration,
        pull=config.roundtrip.pull,
        tilts=np.radians(config.roundtrip.tilts_deg).tolist(),
    )
    label = Label(
        config.name,
        config.version,
        config.display_name,
        config.description,
        config.unity,
        trunkline=__version__,
    )
    sources = read_sources(config.version)
    files, violations = assemble(label, sources, trajectory)
    for violation in violations:
        print(f"package_unity: broken rule: {violation}")

    with output_folder(ARTIFACTS / "package_unity") as out:
        tarball = out / f"{config.name}-{config.version}.tgz"
        write_tarball(tarball, files)
        packed = read_tarball(tarball)
        (out / "manifest.json").write_bytes(packed[MANIFEST])
        models = read_models(sources.mjcf, packed)
        write_json(
            out / "metrics.json",
            {
                "rule_violations": len(violations),
                "roundtrip_max_deviation_mm": compare(models["calibrated"], models["packed"], trajectory)[0],
                "files": len(packed),
                "bytes": tarball.stat().st_size,
            },
        )
        write_roundtrip(out, models, trajectory)


def read_sources(version: str) -> Sources:
    """What the earlier stages wrote; a missing file is a user's mistake."""
    reachability = ARTIFACTS / "reachability"
    meshes = sorted((reachability / "meshes").glob("*.obj"))
    if not meshes:
        raise InputError(f"{reachability}/meshes: found no mesh, expected .obj files (run the reachability stage)")
    return Sources(
        mjcf=existing(ARTIFACTS / "identify_control/arm.xml").read_text(),
        network=existing(ARTIFACTS / "train_ik/ik.onnx"),
        meshes=meshes,
        grids=existing(reachability / "grids.npz"),
        metrics={s: json.loads(existing(ARTIFACTS / s / "metrics.json").read_text()) for s in MEASURED},
        texts={
            "README.md": existing("docs/unity.md").read_bytes(),
            "LICENSE.md": existing("LICENSE").read_bytes(),
            "CHANGELOG.md": f"# Changelog\n\n## [{version}]\n\nSee `Runtime/manifest.json`.\n".encode(),
        },
    )


def read_models(calibrated: str, packed: dict[str, bytes]) -> dict[str, mujoco.MjModel]:
    """Calibrated, packed and as Unity imports it; the latter two with the manifest's springs and dampers restored."""
    mjcf = packed[MODEL].decode()
    described = Manifest.model_validate_json(packed[MANIFEST]).model
    return {
        "calibrated": mujoco.MjModel.from_xml_string(calibrated),
        "packed": compile_with(mjcf, described.springs, described.dampers),
        "imported": compile_with(as_imported(mjcf), described.springs, described.dampers),
    }


def write_roundtrip(out: Path, models: dict[str, mujoco.MjModel], trajectory: Trajectory) -> None:
    """The curl at the last gravity angle."""
    calibrated = models["calibrated"]
    controls = curl(calibrated, trajectory.duration, trajectory.pull)
    motions = {name: simulate(model, controls, trajectory.tilts[-1]) for name, model in models.items()}
    tips = {name: motion.positions[:, -1] for name, motion in motions.items()}
    gaps_mm = {name: 1e3 * deviation(motions["calibrated"], motions[name]) for name in ("packed", "imported")}
    time = calibrated.opt.timestep * np.arange(1, len(controls) + 1)
    columns = {"time": time} | {f"{name}_gap_mm": gap for name, gap in gaps_mm.items()}
    columns |= {f"{name}_{axis}": tip[:, "xyz".index(axis)] for name, tip in tips.items() for axis in "xyz"}
    pd.DataFrame(columns)[::10].to_csv(out / "roundtrip.csv", index=False, float_format="%.6g")
    save_figure(roundtrip_figure(time, tips, gaps_mm), out / "roundtrip.png")


if __name__ == "__main__":
    run_stage("package_unity", Config, main)
