"""A finished package, read back: its digest, the calibrated arm whole, what is known of its parameters, and what holds
it."""

import hashlib
import json
import tarfile
from pathlib import Path

import mujoco
from pydantic import TypeAdapter

from trunkline.errors import InputError
from trunkline.kinematics.panda.mounts import Robot

ROOT = "package/"  # folder that npm's and Unity's tarballs hold everything in
MANIFEST = "Runtime/manifest.json"


def read_package(path: Path) -> dict[str, bytes]:
    """Contents by path in the package, of its .tgz or of the folder that it was unpacked into.

    Raises:
        InputError: if it is not a package.
    """
    if not path.is_dir():
        return read_tarball(path)
    files = {str(file.relative_to(path).as_posix()): file.read_bytes() for file in path.rglob("*") if file.is_file()}
    if MANIFEST not in files:
        raise InputError(f"{path}: found no {MANIFEST}, expected a package's folder")
    return files


def read_tarball(path: Path) -> dict[str, bytes]:
    """Contents by path in the package.

    Raises:
        InputError: if it is not a package.
    """
    try:
        with tarfile.open(path, "r:gz") as archive:
            return {
                entry.name.removeprefix(ROOT): file.read()
                for entry in archive.getmembers()
                if entry.isfile() and (file := archive.extractfile(entry)) is not None
            }
    except (tarfile.TarError, EOFError, OSError) as error:
        raise InputError(f"{path}: found {error}, expected a package's .tgz") from error


def package_digest(files: dict[str, bytes]) -> str:
    """SHA-256 of the manifest, which has that of every other file: of another package, another digest.

    Args:
        files: contents by path, as `read_package` gives them.

    Raises:
        InputError: naming the file that is not the one that the manifest means.
    """
    manifest = manifest_of(files)
    for path, expected in manifest["sha256"].items():
        digest = hashlib.sha256(files[path]).hexdigest() if path in files else "none"
        if digest != expected:
            raise InputError(f"{path}: found sha256 {digest[:12]}, expected {expected[:12]} as the manifest says")
    return hashlib.sha256(files[MANIFEST]).hexdigest()


def arm_of(files: dict[str, bytes]) -> mujoco.MjSpec:
    """The calibrated arm, with the motors' dead time and winches, and cables that rub: what `hybrid.compose` takes."""
    return mujoco.MjSpec.from_string(file_of(files, "arm").decode())


def tables_of(files: dict[str, bytes]) -> dict[str, dict]:
    """By stage and in their order, what the package has of the tables of identification."""
    return {stage["stage"]: stage for stage in json.loads(file_of(files, "parameters"))["stages"]}


def lacking_of(files: dict[str, bytes]) -> dict | None:
    """What the package has of discrepancy.json; None of an earlier release's."""
    return json.loads(file_of(files, "parameters")).get("lacking")


def robot_of(files: dict[str, bytes]) -> Robot:
    """What holds the arm."""
    return TypeAdapter(Robot).validate_python(_hybrid(files)["robot"])


class _CheckedBlock(dict):
    """A block of a JSON file, and where it is, so that what is missing is named."""

    def __init__(self, values: dict, source: str) -> None:
        super().__init__(
            (name, _CheckedBlock(value, f"{source}: {name}") if isinstance(value, dict) else value)
            for name, value in values.items()
        )
        self._source = source

    def __missing__(self, name: str):
        raise InputError(f"{self._source}: found no {name}, expected one")


def file_of(files: dict[str, bytes], name: str) -> bytes:
    """The file that the manifest's block `hybrid` calls `name`."""
    return files[_hybrid(files)[name]]


def _hybrid(files: dict[str, bytes]) -> dict:
    manifest = manifest_of(files)
    if "hybrid" not in manifest:
        raise InputError(f"{MANIFEST}: found no block hybrid, expected a package that a preview can be made of")
    return manifest["hybrid"]


def manifest_of(files: dict[str, bytes]) -> _CheckedBlock:
    """The package's manifest; what is missing in it is an error that names it."""
    if MANIFEST not in files:
        raise InputError(f"package: found no {MANIFEST}, expected one of the stage package_unity")
    try:
        manifest = json.loads(files[MANIFEST].decode(errors="replace"))
    except json.JSONDecodeError as error:
        raise InputError(f"{MANIFEST}: found no JSON at character {error.pos}, expected some") from None
    if not isinstance(manifest, dict):
        raise InputError(f"{MANIFEST}: found no block, expected one")
    return _CheckedBlock(manifest, MANIFEST)
