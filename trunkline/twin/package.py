"""A finished package, read back: its digest, the calibrated arm whole, what is known of its parameters, and what holds
it."""

import gzip
import hashlib
import io
import json
import math
import tarfile
import zlib
from pathlib import Path
from xml.etree import ElementTree

import mujoco
from pydantic import TypeAdapter, ValidationError

from trunkline.errors import InputError, first_problem
from trunkline.kinematics.panda.mounts import Robot

ROOT = "package/"  # folder that npm's and Unity's tarballs hold everything in
MANIFEST = "Runtime/manifest.json"
MOST_COUNTED = 1 << 30  # of a whole number in a manifest
MOST_BYTES = 256 << 20  # unpacked; the demo's package has 27 MiB


def read_package(path: Path) -> dict[str, bytes]:
    """Contents by path in the package, of its .tgz or of the folder that it was unpacked into.

    Raises:
        InputError: it is not a package, is damaged, or is larger than MOST_BYTES.
    """
    if not path.is_dir():
        return read_tarball(path)
    paths = [file for file in path.rglob("*") if file.is_file()]
    _check_size(path, sum(file.stat().st_size for file in paths))
    files = {str(file.relative_to(path).as_posix()): file.read_bytes() for file in paths}
    if MANIFEST not in files:
        raise InputError(f"{path}: found no {MANIFEST}, expected a package's folder")
    return files


def read_tarball(path: Path) -> dict[str, bytes]:
    """Contents by path in the package. No more than MOST_BYTES of it are unpacked, whatever its headers say.

    Raises:
        InputError: as for `read_package`.
    """
    try:
        with gzip.open(path) as stream:
            unpacked = stream.read(MOST_BYTES + 1)
    except (zlib.error, EOFError) as error:
        raise InputError(f"{path}: damaged: found {error}, expected a whole .tgz") from None
    except OSError as error:
        damaged = "damaged: " if "CRC" in str(error) else ""
        raise InputError(f"{path}: {damaged}found {error.strerror or error}, expected a package's .tgz") from None
    _check_size(path, len(unpacked))
    files: dict[str, bytes] = {}
    try:
        with tarfile.open(fileobj=io.BytesIO(unpacked), mode="r:") as archive:
            entries = [entry for entry in archive if not entry.isdir()]
            _check_size(path, sum(entry.size for entry in entries))  # a sparse file's is that of its holes too
            for entry in entries:
                name, file = entry.name.removeprefix(ROOT), archive.extractfile(entry) if entry.isreg() else None
                if file is None or name in files:
                    fault = "a link or device" if file is None else "twice"
                    raise InputError(f"{path}: found {name} {fault}, expected plain files, each once")
                files[name] = file.read()
    except (tarfile.TarError, ValueError) as error:
        raise InputError(f"{path}: damaged: found {error}, expected a package's .tgz") from None
    return files


def _check_size(path: Path, size: int) -> None:
    if size > MOST_BYTES:
        raise InputError(f"{path}: found more than {MOST_BYTES >> 20} MiB in it, expected a package, which has less")


def package_digest(files: dict[str, bytes]) -> str:
    """SHA-256 of the manifest, which has that of every other file: of another package, another digest.

    Args:
        files: contents by path, as `read_package` gives them.

    Raises:
        InputError: naming the file that is not the one that the manifest means, or that it does not list.
    """
    listed = {path: str(digest) for path, digest in manifest_of(files).block("sha256").items()}
    for path in [*listed, *(files.keys() - listed.keys() - {MANIFEST})]:
        expected = listed.get(path, "none")
        digest = hashlib.sha256(files[path]).hexdigest() if path in files else "none"
        if digest != expected:
            raise InputError(f"{path}: found sha256 {digest[:12]}, expected {expected[:12]} as the manifest says")
    return hashlib.sha256(files[MANIFEST]).hexdigest()


def arm_of(files: dict[str, bytes]) -> mujoco.MjSpec:
    """The calibrated arm, with the motors' dead time and winches, and cables that rub: what `hybrid.compose` takes."""
    return spec_of(files, _hybrid(files).text("arm"))


def spec_of(files: dict[str, bytes], path: str) -> mujoco.MjSpec:
    """A package's MJCF, which reads no other file.

    Raises:
        InputError: there is none, it names another file, or MuJoCo refuses it.
    """
    try:
        text = data_of(files, path).decode()
        root = ElementTree.fromstring(text)
    except (UnicodeDecodeError, ElementTree.ParseError) as error:
        raise InputError(f"{path}: damaged: found no XML ({error}), expected MJCF") from None
    for element in root.iter():  # a texture may name a file for each side
        named = [value for name, value in element.attrib.items() if name.startswith("file")]
        if element.tag == "include" or named:
            other = "".join(named[:1])
            raise InputError(f"{path}: found <{element.tag}> of the file {other!r}, expected MJCF that reads no other")
    try:
        return mujoco.MjSpec.from_string(ElementTree.tostring(root, encoding="unicode"))  # what was looked at, no more
    except ValueError as error:
        raise InputError(f"{path}: not a model that MuJoCo reads: {str(error).splitlines()[0]}") from None


def tables_of(files: dict[str, bytes]) -> dict[str, dict]:
    """By stage and in their order, what the package has of the tables of identification."""
    path, parameters = _parameters(files)
    stages = parameters["stages"]
    if not isinstance(stages, list) or not all(isinstance(stage, dict) and "stage" in stage for stage in stages):
        raise InputError(f"{path}: stages: found no list of blocks with their stage, expected one")
    return {stage["stage"]: stage for stage in stages}


def lacking_of(files: dict[str, bytes]) -> dict | None:
    """What the package has of discrepancy.json; None of an earlier release's."""
    return _parameters(files)[1].get("lacking")


def robot_of(files: dict[str, bytes]) -> Robot:
    """What holds the arm."""
    try:
        return TypeAdapter(Robot).validate_python(_hybrid(files)["robot"])
    except ValidationError as error:
        raise InputError(f"{MANIFEST}: hybrid: robot: {first_problem(error)}") from None


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

    def block(self, name: str) -> "_CheckedBlock":
        """Raises: InputError: it is missing, or no block."""
        if not isinstance(block := self[name], _CheckedBlock):
            raise InputError(f"{self._source}: found no block {name}, expected one")
        return block

    def text(self, name: str) -> str:
        """Raises: InputError: it is missing, or something else; so do those below."""
        if not isinstance(text := self[name], str):
            raise self._other(name, "a text")
        return text

    def texts(self, name: str) -> list[str]:
        """A list of them, one at least."""
        texts = self[name]
        if not isinstance(texts, list) or not texts or not all(isinstance(text, str) for text in texts):
            raise self._other(name, "texts")
        return texts

    def number(self, name: str) -> float:
        if not _is_number(value := self[name]):
            raise self._other(name, "a number")
        return value

    def numbers(self, name: str, count: int = 0) -> list[float]:
        """So many of them, where `count` says."""
        numbers = self[name]
        if not isinstance(numbers, list) or not all(map(_is_number, numbers)) or (count and len(numbers) != count):
            raise self._other(name, f"{count} numbers" if count else "numbers")
        return numbers

    def counts(self, name: str, count: int) -> list[int]:
        """So many whole numbers of 1 or more."""
        counts = self.numbers(name, count)
        if not all(number == int(number) and 1 <= number <= MOST_COUNTED for number in counts):
            raise self._other(name, f"{count} whole numbers from 1")
        return [int(number) for number in counts]

    def count(self, name: str) -> int:
        """A whole number of 1 or more."""
        number = self.number(name)
        if not (number == int(number) and 1 <= number <= MOST_COUNTED):
            raise self._other(name, "a whole number from 1")
        return int(number)

    def _other(self, name: str, expected: str) -> InputError:
        return InputError(f"{self._source}: {name}: found something else, expected {expected}")


def _is_number(value: object) -> bool:
    return isinstance(value, int | float) and not isinstance(value, bool) and math.isfinite(value)


def _hybrid(files: dict[str, bytes]) -> _CheckedBlock:
    manifest = manifest_of(files)
    if "hybrid" not in manifest:
        raise InputError(f"{MANIFEST}: found no block hybrid, expected a package that a preview can be made of")
    return manifest.block("hybrid")


def _parameters(files: dict[str, bytes]) -> tuple[str, _CheckedBlock]:
    path = _hybrid(files).text("parameters")
    return path, _json(data_of(files, path), path)


def data_of(files: dict[str, bytes], path: str) -> bytes:
    """Raises: InputError: the package has no such file."""
    if path not in files:
        raise InputError(f"{path}: found no such file, expected it as {MANIFEST} names it")
    return files[path]


def manifest_of(files: dict[str, bytes]) -> _CheckedBlock:
    """The package's manifest; what is missing in it is an error that names it."""
    if MANIFEST not in files:
        raise InputError(f"package: found no {MANIFEST}, expected one of the stage package_unity")
    return _json(files[MANIFEST], MANIFEST)


def _json(data: bytes, path: str) -> _CheckedBlock:
    try:
        values = json.loads(data.decode(errors="replace"))
        if not isinstance(values, dict):
            raise InputError(f"{path}: found no block, expected one")
        return _CheckedBlock(values, path)
    except json.JSONDecodeError as error:
        raise InputError(f"{path}: found no JSON at character {error.pos}, expected some") from None
    except RecursionError:
        raise InputError(f"{path}: found blocks in blocks without end, expected a few") from None
