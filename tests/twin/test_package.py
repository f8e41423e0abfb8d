"""Packages are data: what is damaged or hostile is one line that names the file, and is not unpacked without bound."""

import gzip
import hashlib
import io
import json
import tarfile
import tracemalloc

import pytest

from trunkline.errors import InputError
from trunkline.twin import package
from trunkline.twin.package import MANIFEST, ROOT
from trunkline.unity.upm_package import write_tarball

MODEL, TABLES = "Runtime/Model/arm.xml", "Runtime/Model/parameters.json"
MJCF = b"<mujoco><worldbody/></mujoco>"


def sealed(files: dict[str, bytes], **blocks) -> dict[str, bytes]:
    """`files` with a manifest of their digests."""
    digests = {path: hashlib.sha256(data).hexdigest() for path, data in files.items()}
    manifest = {"sha256": digests, "hybrid": {"arm": MODEL, "parameters": TABLES, "robot": {}}} | blocks
    return files | {MANIFEST: json.dumps(manifest).encode()}


@pytest.fixture
def files() -> dict[str, bytes]:
    return sealed({MODEL: MJCF, TABLES: b'{"stages": []}'})


def tarball(path, entries) -> None:
    """A .tgz of (TarInfo, contents)."""
    with tarfile.open(path, "w:gz") as archive:
        for entry, data in entries:
            archive.addfile(entry, io.BytesIO(data))


def entry(name: str, size: int = 0, kind: bytes = tarfile.REGTYPE) -> tarfile.TarInfo:
    info = tarfile.TarInfo(ROOT + name)
    info.size, info.type = size, kind
    return info


@pytest.fixture
def few_bytes(monkeypatch):
    monkeypatch.setattr(package, "MOST_BYTES", 1 << 20)


@pytest.mark.parametrize("where", ["in a file", "in a header", "in a folder"])
def test_more_than_a_package_has_is_refused_before_it_is_read(where, few_bytes, tmp_path):
    size, path = 64 << 20, tmp_path / "twin.tgz"
    if where == "in a folder":
        path = tmp_path / "twin"
        path.mkdir()
        with (path / "large").open("wb") as file:
            file.truncate(size)
    else:
        kind = tarfile.REGTYPE if where == "in a file" else tarfile.XHDTYPE  # a header is read whole by tarfile
        tarball(path, [(entry("large", size, kind), bytes(size))])
    tracemalloc.start()
    with pytest.raises(InputError, match=r"found more than 1 MiB in it, expected a package"):
        package.read_package(path)
    assert tracemalloc.get_traced_memory()[1] < 8 << 20
    tracemalloc.stop()


def test_holes_count_as_what_they_unpack_to(few_bytes, tmp_path):
    header = bytearray(entry("sparse", 512).tobuf(tarfile.GNU_FORMAT))
    header[156:157] = tarfile.GNUTYPE_SPARSE
    header[386:410] = b"00000000000\x0000000001000\x00"  # one piece of 512 bytes at 0
    header[483:495] = b"01000000000\x00"  # 128 MiB in all
    header[148:156] = b" " * 8
    header[148:156] = b"%06o\x00 " % sum(header)
    (tmp_path / "twin.tgz").write_bytes(gzip.compress(bytes(header) + bytes(512 + 1024)))
    with pytest.raises(InputError, match="found more than 1 MiB"):
        package.read_tarball(tmp_path / "twin.tgz")


def test_a_bit_turned_or_an_end_cut_off_is_damage(files, tmp_path):
    write_tarball(tmp_path / "twin.tgz", files)
    whole = (tmp_path / "twin.tgz").read_bytes()
    assert package.read_tarball(tmp_path / "twin.tgz") == files
    for place in range(len(whole) // 2, len(whole) - 4, 7):  # the last four bytes say how long it is
        turned = bytearray(whole)
        turned[place] ^= 4
        (tmp_path / "turned.tgz").write_bytes(turned)
        with pytest.raises(InputError, match=r"turned\.tgz: damaged: found .*, expected a"):
            package.read_tarball(tmp_path / "turned.tgz")
    (tmp_path / "cut.tgz").write_bytes(whole[:-20])
    with pytest.raises(InputError, match=r"cut\.tgz: damaged: found .*, expected a whole \.tgz"):
        package.read_tarball(tmp_path / "cut.tgz")


def test_no_archive_and_no_file_are_said_as_such(tmp_path):
    (tmp_path / "text.tgz").write_bytes(b"no archive")
    for name, fault in (("text.tgz", "Not a gzipped file"), ("none.tgz", "No such file")):
        with pytest.raises(InputError, match=rf"{name}: found {fault}.*, expected a package's \.tgz"):
            package.read_tarball(tmp_path / name)


@pytest.mark.parametrize(
    ("name", "entries"),
    [
        ("link a link or device", [(entry("link", kind=tarfile.SYMTYPE), b"")]),
        ("hard a link or device", [(entry("hard", kind=tarfile.LNKTYPE), b"")]),
        ("pipe a link or device", [(entry("pipe", kind=tarfile.FIFOTYPE), b"")]),
        ("same twice", [(entry("same", 1), b"a"), (entry("same", 1), b"b")]),
    ],
)
def test_what_is_no_plain_file_or_comes_twice_is_refused(name, entries, tmp_path):
    tarball(tmp_path / "twin.tgz", entries)
    with pytest.raises(InputError, match=f"found {name}, expected plain files, each once"):
        package.read_tarball(tmp_path / "twin.tgz")


@pytest.mark.parametrize("path", ["Runtime/more.dll", "../outside", "/etc/passwd", "Runtime/more.cs.meta"])
def test_a_file_that_the_manifest_does_not_list_is_refused(path, files):
    assert package.package_digest(files)
    with pytest.raises(InputError, match=f"{path}: found sha256 [0-9a-f]{{12}}, expected none as the manifest says"):
        package.package_digest(files | {path: b"more"})


@pytest.mark.parametrize(
    "text",
    [
        b"<mujoco><include file='/etc/passwd'/></mujoco>",
        b"<mujoco><include file='../other.xml'/></mujoco>",
        b"<mujoco><asset><mesh name='m' file='m.stl'/></asset></mujoco>",
        b"<mujoco><asset><hfield name='h' file='C:\\\\h.png'/></asset></mujoco>",
    ],
)
def test_mjcf_that_names_another_file_is_refused(text, files):
    with pytest.raises(InputError, match=rf"{MODEL}: found <\w+> of the file .*, expected MJCF that reads no other"):
        package.arm_of(files | {MODEL: text})


def test_mjcf_cut_in_half_and_mjcf_that_mujoco_refuses_are_one_line(files):
    assert package.arm_of(files).compile().nq == 0
    with pytest.raises(InputError, match=rf"{MODEL}: damaged: found no XML .*, expected MJCF"):
        package.arm_of(files | {MODEL: MJCF[: len(MJCF) // 2]})
    with pytest.raises(InputError, match=rf"{MODEL}: not a model that MuJoCo reads: "):
        package.arm_of(files | {MODEL: b"<mujoco><worldbody><nonsense/></worldbody></mujoco>"})


@pytest.mark.parametrize(
    ("blocks", "line"),
    [
        ({"sha256": 3}, "found no block sha256, expected one"),
        ({"hybrid": []}, "found no block hybrid, expected one"),
        ({"hybrid": {}}, "hybrid: found no arm, expected one"),
        ({"hybrid": {"arm": 5}}, "hybrid: arm: found something else, expected a text"),
        ({"hybrid": {"arm": "nowhere.xml"}}, "nowhere.xml: found no such file, expected it as"),
    ],
)
def test_a_manifest_that_lacks_a_block_is_one_line(blocks, line, files):
    broken = sealed({MODEL: MJCF}, **blocks)
    with pytest.raises(InputError, match=line):
        (package.package_digest(broken), package.arm_of(broken))


def test_tables_and_robots_of_another_form_are_one_line(files):
    assert package.tables_of(files) == {}
    assert package.lacking_of(files) is None
    with pytest.raises(InputError, match=f"{TABLES}: stages: found no list of blocks"):
        package.tables_of(files | {TABLES: b'{"stages": [1]}'})
    with pytest.raises(InputError, match=f"{TABLES}: found no JSON at character 0"):
        package.tables_of(files | {TABLES: b""})
    with pytest.raises(InputError, match=f"{TABLES}: found blocks in blocks without end"):
        package.tables_of(files | {TABLES: b'{"a":' * 100_000})
    with pytest.raises(InputError, match=r"manifest\.json: hybrid: robot: "):
        package.robot_of(files)
