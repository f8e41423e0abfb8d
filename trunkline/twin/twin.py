"""A calibrated twin: the arm's model, what identification left open of it, and where both come from."""

from dataclasses import dataclass, field
from pathlib import Path

import mujoco
import numpy as np
from scipy.spatial.transform import Rotation

from trunkline.errors import InputError
from trunkline.files import file_digest
from trunkline.identification.stages import MODEL, STAGES, TABLE, final_model, read_table, read_tables
from trunkline.model.arm_model import ArmModel
from trunkline.model_files import read_spec
from trunkline.twin.discrepancy import FILE, Lacking, read_lacking
from trunkline.twin.package import MANIFEST, arm_of, lacking_of, manifest_of, package_digest, read_package, tables_of
from trunkline.twin.posterior import Posterior

MOST_TURN = np.radians(30)  # of the mount in the tracked base, as it may be identified; more is another frame


@dataclass(frozen=True)
class Provenance:
    """What is recorded of where a twin comes from.

    Attributes:
        model: the file that it was read from, of a package by its path there.
        files: SHA-256 of the files that it comes from, by their paths: of a model that, and its tables.
        tables: parameters.json by stage, in their order; none of a model that no stage has identified.
        package: its digest, by which live sessions know it; empty where the twin comes from none.
        versions: of what made the package.
    """

    model: Path
    files: dict[str, str]
    tables: dict[str, dict]
    package: str = ""
    versions: dict[str, str] = field(default_factory=dict)

    @property
    def digest(self) -> str:
        """SHA-256 of the model's file; empty of one that is none."""
        return self.files.get(self.model.as_posix(), "")

    @property
    def fitted_to(self) -> dict[str, str]:
        """Digests of the trials that any stage has fitted it to, by name."""
        return {name: digest for table in self.tables.values() for name, digest in table["fitted_to"].items()}


@dataclass(frozen=True)
class Twin:
    """spec: of the arm, to be changed, composed and compiled. arm: compiled, with the motors' dead time and winches,
    and cables that rub. posterior: of its parameters. lacking: what it lacks beside them, None where nobody knows."""

    spec: mujoco.MjSpec
    arm: ArmModel
    posterior: Posterior
    provenance: Provenance
    lacking: Lacking | None = None

    @classmethod
    def load(cls, path: str | Path) -> "Twin":
        """From a folder of artifacts, of which the last stage that has run counts; from an MJCF, with the tables beside
        it and, of a stage's, of those before; or from a Unity package, its .tgz or its folder.

        Raises:
            InputError: one line that says what is missing or wrong.
        """
        path = Path(path)
        if path.suffix == ".tgz" or (path / MANIFEST).is_file():
            return cls.of_package(read_package(path))
        model = final_model(path) if path.is_dir() or not path.suffix else path
        if model is None:
            raise InputError(f"{path}: found no {STAGES[0]}/{MODEL}, expected the artifacts of identification")
        return cls.of_model(model)

    @classmethod
    def of_model(cls, path: Path) -> "Twin":
        """From the MJCF at `path`: a chain of hinges that hangs from the world's origin."""
        if not path.is_file():
            raise InputError(f"{path}: no such file, expected the MJCF of an arm")
        spec, folder = read_spec(path), path.parent if path.parent.name else path.parent.resolve()
        arm = spec.compile()
        _check_chain(arm, path)
        if folder.name in STAGES:
            stages = STAGES[: STAGES.index(folder.name) + 1]
            ran = [s for s in stages if any((folder.parent / s / name).is_file() for name in (MODEL, TABLE))]
            tables = {stage: read_table(folder.parent / stage / TABLE) for stage in ran}
        else:
            tables = read_tables(folder.parent, (folder.name,))
        files = [path, *(folder.parent / stage / TABLE for stage in tables)]
        digests = {file.as_posix(): file_digest(file) for file in files}
        provenance = Provenance(path, digests, tables)
        lacking = read_lacking(folder.parent / FILE, provenance.digest)
        return cls(spec, ArmModel(arm), Posterior.from_tables(tables), provenance, lacking)

    @classmethod
    def of_package(cls, files: dict[str, bytes]) -> "Twin":
        """From a package's files by path.

        Raises:
            InputError: a file is not the one that the manifest means, or the package has no arm to preview with.
        """
        manifest, digest = manifest_of(files), package_digest(files)
        spec, tables = arm_of(files), tables_of(files)
        model = Path(manifest["hybrid"]["arm"])
        provenance = Provenance(model, manifest["sha256"], tables, digest, manifest["versions"])
        return cls(spec, ArmModel(spec.compile()), Posterior.from_tables(tables), provenance, package_lacking(files))


def package_lacking(files: dict[str, bytes]) -> Lacking | None:
    """What the arm of a package lacks; None where nobody knows."""
    manifest = manifest_of(files)
    hybrid = manifest.block("hybrid")
    model = manifest.block("sha256").text(hybrid.text("arm"))
    return Lacking.from_table(lacking_of(files), model, hybrid["parameters"])


def _check_chain(model: mujoco.MjModel, path: Path) -> None:
    sites = [model.site(index).name for index in range(model.nsite)]
    for name, where in (("base_center", "in the mount"), ("tip", "on the last unit")):
        if name not in sites:
            raise InputError(f"{path}: found no site {name!r}, expected one {where}")
    if not model.njnt or np.any(model.jnt_type != mujoco.mjtJoint.mjJNT_HINGE):
        raise InputError(f"{path}: found {model.njnt} joints, not all hinges, expected a chain of hinges")
    data = mujoco.MjData(model)
    mujoco.mj_kinematics(model, data)
    mount = data.site("base_center")
    turn = float(Rotation.from_matrix(mount.xmat.reshape(3, 3)).magnitude())
    if not np.allclose(mount.xpos, 0, atol=1e-9) or turn > MOST_TURN:
        actual = f"found it at {np.round(mount.xpos, 4).tolist()} m and turned by {np.degrees(turn):.1f}°"
        expected = f"expected it in the world's origin and turned by {np.degrees(MOST_TURN):.0f}° at most"
        raise InputError(f"{path}: site 'base_center': {actual}, {expected}")
