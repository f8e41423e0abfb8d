"""The twin, whole: the calibrated model and all that was made from it, as the files of a Unity package."""

import json
from dataclasses import dataclass
from pathlib import Path
from typing import Annotated

import mujoco
import numpy as np
from pydantic import Field

from trunkline.errors import InputError
from trunkline.kinematics.panda.mounts import Robot
from trunkline.twin.package import MANIFEST
from trunkline.unity.importer import as_imported
from trunkline.unity.linearize import compile_with, linearize
from trunkline.unity.manifest import Hybrid, Manifest, Versions, describe_model, hashes
from trunkline.unity.network import describe_network
from trunkline.unity.pulls import as_pulls
from trunkline.unity.reach_maps import convert_grids, convert_meshes, convert_sheets, describe_reach
from trunkline.unity.roundtrip import curl, deviation, simulate
from trunkline.unity.rules import Violation, lint_mjcf
from trunkline.unity.time_steps import LONGEST_STEP, step_errors, with_steps
from trunkline.unity.unsupported import without_unsupported
from trunkline.unity.upm_package import (
    CALIBRATED,
    MODEL,
    NETWORK,
    PARAMETERS,
    README,
    package_json,
    with_metas,
)

CSHARP = Path(__file__).parent / "csharp"
PLAIN_FOLDERS = ("Editor", "Samples~", "Tests")  # of CSHARP, which lie beside Runtime in the package, as Unity expects


@dataclass
class Label:
    """How the package calls itself; `unity` is the oldest editor that it is for."""

    name: Annotated[str, Field(pattern=r"^[a-z0-9-]+(\.[a-z0-9-]+){2,}$")]
    version: Annotated[str, Field(pattern=r"^\d+\.\d+\.\d+$")]
    display_name: str
    description: str
    unity: Annotated[str, Field(pattern=r"^\d+\.\d+$")]


@dataclass
class Trajectory:
    """The movement on which models are compared.

    Attributes:
        duration: s. pull: largest pull of tendon 1, m. tilts_deg: gravity angles.
    """

    duration: Annotated[float, Field(gt=0, le=60)]
    pull: Annotated[float, Field(gt=0, le=1)]
    tilts_deg: Annotated[list[Annotated[float, Field(ge=0, le=180)]], Field(min_length=1)]

    @property
    def tilts(self) -> list[float]:
        """Gravity angles, rad."""
        return np.radians(self.tilts_deg).tolist()


@dataclass
class Sources:
    """What the earlier stages made: the calibrated MJCF, files to read, metrics by stage, texts by name.

    tables: of identification, by stage, the latest last. trunkline: version of the code that made it. lacking:
    discrepancy.json of the stage `report`; None where that has not run.
    """

    mjcf: str
    tables: dict[str, dict]
    network: Path
    meshes: list[Path]
    grids: Path
    metrics: dict[str, dict]
    texts: dict[str, bytes]
    trunkline: str
    lacking: dict | None = None


def assemble(
    label: Label, sources: Sources, trajectory: Trajectory, robot: Robot
) -> tuple[dict[str, bytes], list[Violation]]:
    """All files of the package by path, and the rules that it breaks."""
    spec = mujoco.MjSpec.from_string(sources.mjcf)
    left_out = without_unsupported(spec)
    calibrated = spec.compile()
    laws = linearize(spec, *movement(calibrated, trajectory))
    as_pulls(spec)
    spec.compile()
    mjcf = spec.to_xml()
    violations = lint_mjcf(mjcf)

    bundled = mujoco.MjModel.from_xml_string(mjcf)
    imported = compile_with(as_imported(mjcf), laws)
    import_deviation_mm, complaints = compare(calibrated, imported, trajectory)
    if complaints:  # MjScene.CheckForPhysicsException
        violations.append(
            Violation("simulation", "warning", f"{complaints} while it curls; Unity stops at one")
        )
    restored = compile_with(mjcf, laws)
    steps = step_errors(calibrated, restored, trajectory.duration, trajectory.pull, trajectory.tilts)
    tendons = [bundled.tendon(i).name for i in bundled.actuator_trnid[:, 0]]
    network = sources.network.read_bytes()
    network_block, network_violations = describe_network(network, NETWORK, tendons, str(sources.network))
    with np.load(sources.grids) as archive:
        arrays, source = dict(archive), str(sources.grids)
    meshes, mesh_blocks = convert_meshes(sources.meshes, arrays, source)
    grids, grid_blocks = convert_grids(arrays, source)
    sheets, sheet_block = convert_sheets(arrays, source)
    reach = describe_reach(arrays, sheet_block, source)

    files = sources.texts | {
        README: with_steps(sources.texts[README].decode(), steps).encode(),
        "package.json": package_json(
            label.name, label.version, label.display_name, label.unity, label.description
        ),
        MODEL: mjcf.encode(),
        CALIBRATED: sources.mjcf.encode(),
        PARAMETERS: parameters_file(sources.tables, sources.lacking),
        NETWORK: network,
    }
    files |= scripts()
    if "README.md" in files:  # what the package manager's link opens, as there is no address on the web
        files[f"Documentation~/{label.name}.md"] = files["README.md"]
    manifest = Manifest(
        name=label.name,
        versions=Versions(
            package=label.version, trunkline=sources.trunkline, mujoco=mujoco.__version__, unity=label.unity
        ),
        model=describe_model(
            bundled,
            MODEL,
            longest_step=LONGEST_STEP,
            steps=steps,
            springs=laws.springs,
            dampers=laws.dampers,
            diagonals=laws.diagonals,
            changes_max_deviation_mm=compare(calibrated, bundled, trajectory)[0] if laws else 0.0,
            import_max_deviation_mm=import_deviation_mm,
            **left_out,
        ),
        hybrid=Hybrid(arm=CALIBRATED, parameters=PARAMETERS, robot=robot),
        network=network_block,
        meshes=mesh_blocks,
        grids=grid_blocks,
        reach=reach,
        metrics=sources.metrics,
        sha256={},
    )
    return sealed(manifest, files | meshes | grids | sheets), violations + network_violations


def scripts() -> dict[str, bytes]:
    """The C# and what describes it, by path in the package."""
    files = {}
    for path in sorted(CSHARP.rglob("*")):
        if path.suffix in (".cs", ".asmdef", ".md"):
            place = path.relative_to(CSHARP)
            files[("" if place.parts[0] in PLAIN_FOLDERS else "Runtime/") + place.as_posix()] = path.read_bytes()
    return files


def sealed(manifest: Manifest, files: dict[str, bytes]) -> dict[str, bytes]:
    """A package's `files` with a `.meta` beside each, and with the `manifest` that has the digests of them all."""
    files = with_metas(manifest.name, files | {MANIFEST: b""})
    digests = hashes({path: data for path, data in files.items() if path != MANIFEST})
    manifest = manifest.model_copy(update={"sha256": digests})
    return files | {MANIFEST: (manifest.model_dump_json(indent=2) + "\n").encode()}


def parameters_file(tables: dict[str, dict], lacking: dict | None) -> bytes:
    """What `parameters.json` of the stages have that a twin needs, one after the other, and what the model lacks beside
    them; the rest is about trials."""
    columns = ("value", "unit", "interval_95_given_model", "range")
    stages = [
        {
            "stage": stage,
            "parameters": {name: {key: row[key] for key in columns} for name, row in table["parameters"].items()},
            "correlation": table["correlation"],
            "fitted_to": table["fitted_to"],
        }
        for stage, table in tables.items()
    ]
    beside = {"lacking": lacking} if lacking else {}
    return (json.dumps({"stages": stages} | beside, indent=2) + "\n").encode()


def movement(model: mujoco.MjModel, trajectory: Trajectory) -> tuple[np.ndarray, np.ndarray]:
    """Joint angles and speeds of a model on the trajectory, all gravity angles one after the other."""
    commands = curl(model, trajectory.duration, trajectory.pull)
    motions = [simulate(model, commands, tilt) for tilt in trajectory.tilts]
    return np.concatenate([m.angles for m in motions]), np.concatenate([m.speeds for m in motions])


def compare(first: mujoco.MjModel, second: mujoco.MjModel, trajectory: Trajectory) -> tuple[float, int]:
    """Largest distance of any body between two models on the trajectory, over all its gravity angles, in mm,
    and how many warnings MuJoCo counted while it simulated the second.

    Raises:
        InputError: one of them diverges, so that no distance says anything.
    """
    commands = curl(first, trajectory.duration, trajectory.pull)
    largest, warnings = 0.0, 0
    for tilt in trajectory.tilts:
        expected, motion = (simulate(model, commands, tilt) for model in (first, second))
        furthest = float(deviation(expected, motion).max())
        if not np.isfinite(furthest):
            raise InputError(f"a curl at a gravity angle of {tilt:g} rad: found positions that are not finite")
        largest, warnings = max(largest, furthest), warnings + motion.warnings
    return round(1e3 * largest, 6), warnings
