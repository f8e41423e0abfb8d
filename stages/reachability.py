"""Map the reach of the rigid arm, of the soft arm per gravity angle, and of both together."""

from pathlib import Path

import numpy as np
import pandas as pd
from pydantic import Field, PositiveInt

from trunkline.errors import InputError
from trunkline.fields.mesh import Surface, write_obj
from trunkline.figures.maps import heldout_figure, maps_figure, slices_figure
from trunkline.figures.style import save_figure
from trunkline.panda.mjcf import panda_spec
from trunkline.pipeline.inputs import read_model
from trunkline.pipeline.stage import output_folder, run_stage, write_json
from trunkline.progress import progress
from trunkline.reachability.checks import Check, LabelSettings, SpotCheckSettings, check_maps
from trunkline.reachability.maps import HybridSettings, Maps, RigidSettings, blend_angles, build_maps
from trunkline.reachability.soft import SoftShape
from trunkline.reachability.tips import ArmTips, Tips
from trunkline.settings import settings
from trunkline.statics.chain import Chain, read_chain

MODEL = Path("artifacts/identify_control/arm.xml")
SAMPLES = Path("data/processed/fk_dataset/samples.parquet")
ARTIFACTS = Path("artifacts/reachability")


@settings
class Rigid:
    mount_offset: float = Field(ge=0, le=0.5)
    self_collision: bool
    poses: int = Field(ge=1000, le=2**24)
    profile_voxel: float = Field(ge=0.001, le=0.1)
    voxel: float = Field(ge=0.005, le=0.1)
    closing: float = Field(gt=0, le=0.2)
    smoothing: float = Field(ge=0, le=5)
    smallest: PositiveInt


@settings
class Labels:
    count: int = Field(ge=100, le=1_000_000)
    starts: PositiveInt
    starts_in_doubt: PositiveInt
    margin: float = Field(gt=0, le=1)


@settings
class Soft:
    tolerance: float = Field(gt=0, le=0.2)
    voxel: float = Field(ge=0.003, le=0.1)
    closing: float = Field(gt=0, le=0.2)
    smoothing: float = Field(ge=0, le=5)
    smallest: PositiveInt
    angle_step_deg: float = Field(ge=0.5, le=180)
    directions: int = Field(ge=8)
    steps: int = Field(ge=8)


@settings
class Hybrid:
    voxel: float = Field(ge=0.007, le=0.1)
    smoothing: float = Field(ge=0, le=5)
    smallest: PositiveInt
    tilts_deg: list[float]
    tilted_poses: int = Field(ge=1000, le=2**22)

    def __post_init__(self) -> None:
        if any(not 0 < tilt <= 120 for tilt in self.tilts_deg) or len(set(self.tilts_deg)) < len(self.tilts_deg):
            raise ValueError(f"tilts_deg: found {self.tilts_deg}, expected different angles above 0, up to 120")


@settings
class SpotCheck:
    count: int = Field(ge=1, le=10_000)
    outside: float = Field(gt=0, le=0.2)


@settings
class Config:
    most_triangles: int = Field(ge=100)
    seed: int = Field(ge=0)
    rigid: Rigid
    labels: Labels
    soft: Soft
    hybrid: Hybrid
    spot_check: SpotCheck


def main(config: Config) -> None:
    chain = read_chain(read_model(MODEL))
    tips_at = read_tips(SAMPLES, chain, config)
    shape = SoftShape(config.soft.tolerance, config.soft.closing, config.soft.smoothing, config.soft.smallest)
    step = np.radians(config.soft.angle_step_deg)
    fields = len(blend_angles(tips_at.angles, step))
    hybrid = {name: value for name, value in vars(config.hybrid).items() if name != "tilts_deg"}
    with progress(2 * fields + 4 + len(config.hybrid.tilts_deg), "reachability", "parts") as bar:
        maps = build_maps(
            tips_at,
            tips_at.angles,
            RigidSettings(**vars(config.rigid)),
            shape,
            HybridSettings(**hybrid, tilts=np.radians(config.hybrid.tilts_deg).tolist()),
            soft_voxel=config.soft.voxel,
            step=step,
            most_triangles=config.most_triangles,
            seed=config.seed,
            done=lambda part: bar.update(1, done=part),
        )
        check = check_maps(
            maps,
            chain,
            tips_at,
            LabelSettings(**vars(config.labels)),
            SpotCheckSettings(**vars(config.spot_check)),
            seed=config.seed,
            done=lambda part: bar.update(1, done=part),
        )

    with output_folder(ARTIFACTS) as folder:
        np.savez_compressed(folder / "grids.npz", **maps.arrays())
        (folder / "meshes").mkdir()
        for name, mesh in maps.meshes().items():
            write_obj(folder / "meshes" / f"{name}.obj", mesh, f"Reachable set: {name}")
        (folder / "panda.xml").write_text(panda_spec(config.rigid.mount_offset).to_xml())
        heldout = pd.DataFrame(check.heldout).rename(columns={"angle": "angle_deg"})
        heldout["angle_deg"] = np.degrees(heldout["angle_deg"]).round(6)
        heldout.to_csv(folder / "heldout.csv", index=False, float_format="%.6g")
        tips = [sample.positions for sample in tips_at.samples]
        save_figure(maps_figure(maps, tips), folder / "maps.png")
        save_figure(slices_figure(maps, tips, check), folder / "slices.png")
        save_figure(heldout_figure(heldout, config.spot_check.outside), folder / "heldout.png")
        write_json(folder / "metrics.json", metrics(maps, check))


def read_tips(path: Path, chain: Chain, config: Config) -> ArmTips:
    """Tips and lengths by gravity angle, from the data set of forward kinematics."""
    if not path.is_file():
        raise InputError(f"{path}: no such file, expected the samples of the fk_dataset stage (run `dvc repro`)")
    table = pd.read_parquet(path)
    lengths = [f"l{t + 1}" for t in range(chain.tendons)]
    missing = [name for name in ("theta_g", "x", "y", "z", *lengths) if name not in table]
    if missing:
        raise InputError(f"{path}: found no column {', '.join(missing)}, expected tips and tendon lengths")
    groups = [group for _, group in table.groupby(table["theta_g"].round(9))]
    if len(groups) < 2:
        raise InputError(f"{path}: found {len(groups)} gravity angles, expected at least 2 to blend between")
    if table["theta_g"].abs().min() > 1e-6:
        raise InputError(f"{path}: found no gravity angle of 0, expected one: the hybrid map hangs straight down")
    return ArmTips(
        chain=chain,
        angles=np.array([group["theta_g"].iloc[0] for group in groups]),
        samples=[Tips(group[["x", "y", "z"]].to_numpy(float), group[lengths].to_numpy(float)) for group in groups],
        directions=config.soft.directions,
        steps=config.soft.steps,
        seed=config.seed,
    )


def metrics(maps: Maps, check: Check) -> dict:
    """How right the maps are, by map, and whether their meshes are closed and small."""
    soft = maps.soft.meshes
    space = {name: mesh_metrics(one.mesh, check.moved[name]) for name, one in maps.in_space().items()}
    found = {
        name: space[name] | {"found_inside": inside, "found_outside": outside}
        for name, (inside, outside) in check.found.items()
    }
    return found | {
        "rigid": check.rigid._asdict() | space["rigid"],
        "soft": {
            "heldout_iou_min": min(one.iou for one in check.heldout),
            "heldout_reachable_min": min(one.reachable for one in check.heldout),
            "heldout_beyond_max": max(one.beyond for one in check.heldout),
            "watertight": all(mesh.is_closed() for mesh in soft),
            "triangles": max(len(mesh.faces) for mesh in soft),
            "moved_voxels": check.moved["soft"],
        },
    }


def mesh_metrics(mesh: Surface, moved: float) -> dict:
    return {"watertight": mesh.is_closed(), "triangles": len(mesh.faces), "moved_voxels": moved}


if __name__ == "__main__":
    run_stage("reachability", Config, main)
