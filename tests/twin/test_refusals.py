"""What damaged and hostile packages come to; `python -m tests.twin.test_refusals` prints the table for docs."""

import gzip
import tarfile
from collections.abc import Callable
from pathlib import Path
from tempfile import TemporaryDirectory

from tests.twin.test_package import MJCF, MODEL, TABLES, entry, sealed, tarball
from trunkline.errors import InputError
from trunkline.pipeline.config import PROJECT
from trunkline.twin.package import MANIFEST, MOST_BYTES, arm_of, package_digest, read_package
from trunkline.unity.upm_package import write_tarball

CUBE = b"<mujoco><asset><texture type='cube' fileright='../../x.png'/></asset></mujoco>"
HIDDEN = b"<!DOCTYPE mujoco [<!-- ><mujoco><include file='/etc/passwd'/></mujoco> --> ]><mujoco><nonsense/></mujoco>"
SOUND = sealed({MODEL: MJCF, TABLES: b'{"stages": []}'})


def changed(change: Callable[[bytes], bytes]) -> Callable[[Path], None]:
    """Writes the sound package's .tgz with other bytes."""

    def write(path: Path) -> None:
        write_tarball(path, SOUND)
        path.write_bytes(change(path.read_bytes()))

    return write


def large(path: Path) -> None:
    path.mkdir()
    with (path / "large").open("wb") as file:
        file.truncate(MOST_BYTES + 1)


# files of a .tgz, or what writes it
CASES: dict[str, dict[str, bytes] | Callable[[Path], None]] = {
    "its end is cut off": changed(lambda data: data[:-20]),
    "a bit is turned": changed(lambda data: data[:-6] + bytes([data[-6] ^ 4]) + data[-5:]),
    "another kind of file": changed(lambda _: b"PK\x03\x04"),
    "a .gz without a .tar": changed(lambda _: gzip.compress(b"text" * 300)),
    "it unpacks without bound": large,
    "a link": lambda path: tarball(path, [(entry("Runtime/a.json", kind=tarfile.SYMTYPE), b"")]),
    "a file twice": lambda path: tarball(path, 2 * [(entry("Runtime/a.json"), b"")]),
    "no manifest": {MODEL: MJCF},
    "a manifest that is no JSON": SOUND | {MANIFEST: b"{"},
    "a manifest of blocks without end": SOUND | {MANIFEST: b'{"a":' * 100_000},
    "a file was changed": SOUND | {MODEL: MJCF + b" "},
    "a file was left out": {MODEL: MJCF, MANIFEST: SOUND[MANIFEST]},
    "a file was added": SOUND | {"Runtime/more.dll": b"more"},
    "a file beside the package": SOUND | {"../outside": b"more"},
    "sealed anew: a model that reads other files": sealed({MODEL: b"<mujoco><include file='/etc/passwd'/></mujoco>"}),
    "… a texture from outside the package": sealed({MODEL: CUBE}),
    "… a model in what only some call a comment": sealed({MODEL: HIDDEN}),
    "… a model cut in half": sealed({MODEL: MJCF[: len(MJCF) // 2]}),
    "… a model that is none": sealed({MODEL: b"<mujoco><worldbody><nonsense/></worldbody></mujoco>"}),
}


def refusal(case: dict[str, bytes] | Callable[[Path], None]) -> str:
    """What is printed of the package; "" where it is taken."""
    with TemporaryDirectory() as folder:
        path = Path(folder) / "twin.tgz"
        write_tarball(path, case) if isinstance(case, dict) else case(path)
        try:
            files = read_package(path)
            package_digest(files)
            arm_of(files)
        except InputError as error:
            return str(error).replace(f"{folder}/", "")
    return ""


def table() -> str:
    rows = [f"| {name} | `{refusal(case)}` |" for name, case in CASES.items()]
    return "\n".join(["| the package | the line |", "|---|---|", *rows])


def test_the_table_is_what_the_reader_prints_and_it_takes_a_sound_package_alone():
    assert refusal(SOUND) == ""
    assert "``" not in table()
    assert f"\n{table()}\n" in (PROJECT / "docs/measurements/packages.md").read_text(encoding="utf-8")


if __name__ == "__main__":
    print(table())
