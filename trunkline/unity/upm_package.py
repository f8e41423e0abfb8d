"""A Unity package (UPM) as one tarball that is the same bytes for the same files.

Unity ignores files of a tarball package that come without a `.meta`, since it cannot write one there; so each
file and folder gets one, with an identifier made from its path that stays the same from version to version.
"""

import gzip
import hashlib
import io
import json
import tarfile
from pathlib import Path

from trunkline.twin.package import ROOT

# where the twin's own files are in it
MODEL = "Runtime/Model/arm.xml"
CALIBRATED, PARAMETERS = "Runtime/Model/calibrated.xml", "Runtime/Model/parameters.json"
NETWORK = "Runtime/Network/ik.onnx"
README = "README.md"
# of Unity's own, which a project may have switched off: JsonUtility, Physics.gravity, controllers of the sample
MODULES = ["com.unity.modules.jsonserialize", "com.unity.modules.physics", "com.unity.modules.xr"]
SAMPLES = [{
    "displayName": "Pointing",
    "description": "Two rays set the targets of a robot that carries the arm; the twin bends as the network says.",
    "path": "Samples~/Pointing",
}]  # fmt: skip


def package_json(name: str, version: str, display_name: str, unity: str, description: str) -> bytes:
    """The manifest that Unity's package manager reads."""
    fields = {
        "name": name,
        "version": version,
        "displayName": display_name,
        "unity": unity,
        "description": description,
        "author": {"name": "Trunkline maintainers"},
        "dependencies": dict.fromkeys(MODULES, "1.0.0"),  # org.mujoco is in no registry
        "keywords": ["mujoco", "soft robot", "tendon-driven", "digital twin", "teleoperation", "xr"],
        "license": "MIT",
        "samples": SAMPLES,
        "hideInEditor": False,
    }
    return (json.dumps(fields, indent=2) + "\n").encode()


def with_metas(name: str, files: dict[str, bytes]) -> dict[str, bytes]:
    """The files of a package and a `.meta` beside each of them and of their folders. Unity does not look into folders
    whose names end in `~`: what is in them has none.

    Args:
        name: the package's name, part of the identifiers. files: contents by path in the package.
    """
    visible = [path for path in files if not any(part.endswith("~") for part in Path(path).parts)]
    folders = {str(folder) for path in visible for folder in Path(path).parents if str(folder) != "."}
    metas = {f"{path}.meta": _meta(name, path, is_folder=False) for path in visible}
    metas |= {f"{folder}.meta": _meta(name, folder, is_folder=True) for folder in folders}
    return dict(sorted((files | metas).items()))


def without_metas(files: dict[str, bytes]) -> dict[str, bytes]:
    """The files without what `with_metas` has put beside them."""
    return {path: data for path, data in files.items() if not path.endswith(".meta")}


def _meta(name: str, path: str, is_folder: bool) -> bytes:
    guid = hashlib.sha256(f"{name}/{path}".encode()).hexdigest()[:32]
    folder = "folderAsset: yes\nDefaultImporter:\n  externalObjects: {}\n" if is_folder else ""
    return f"fileFormatVersion: 2\nguid: {guid}\n{folder}".encode()


def write_tarball(path: Path, files: dict[str, bytes]) -> None:
    """Write `files` to a .tgz: sorted, without times, owners or file name in it."""
    buffer = io.BytesIO()
    with tarfile.open(fileobj=buffer, mode="w", format=tarfile.USTAR_FORMAT) as archive:
        for name, data in sorted(files.items()):
            entry = tarfile.TarInfo(ROOT + name)
            entry.size, entry.mode = len(data), 0o644
            archive.addfile(entry, io.BytesIO(data))
    path.write_bytes(gzip.compress(buffer.getvalue(), compresslevel=9, mtime=0))
