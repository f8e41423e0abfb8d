"""Of which code a result that was not made by the pipeline is: the commit, and a digest of each folder it goes through.

A result goes through the files of the checkout that its module imports, directly or not, what lies beside them and is
no Python, and what docs/results/reads.yaml names for it: settings, what stages wrote, the package, modules that it
starts. So what has changed since can be named, and a change of anything else leaves the result as it is.
"""

import ast
import hashlib
import json
import subprocess
import sys
from collections.abc import Collection, Iterable, Mapping
from dataclasses import dataclass
from functools import cache
from pathlib import Path

import yaml

from trunkline.errors import InputError
from trunkline.twin.package import MANIFEST as PACKED
from trunkline.twin.package import read_tarball
from upkeep.provenance import MANIFEST, SHOWN, package_of

ROOMS = ("trunkline", "upkeep", "demo", "rehearsal", "studies", "benchmarks", "qualification", "stages", "tests")

# What surrounds every result (load, show, refuse, write) and never changes a number. Also of tests/pipeline.
INERT = (
    "trunkline/compute/",  # where it runs: the same bits
    *("trunkline/errors.py", "trunkline/files.py", "trunkline/model_files.py"),
    *("trunkline/startup_notice.py", "trunkline/settings.py"),
    *("trunkline/report/figures/", "trunkline/pipeline/", "upkeep/"),
    *("demo/__init__.py", "rehearsal/__init__.py", "rehearsal/report.py", "studies/rows.py"),
)
ACTIVE = ("trunkline/pipeline/identify.py",)
MADE = {".pyc", ".nbi", ".nbc", ".md"}  # by Python and numba; and words

READS, PACKAGE = Path("docs/results/reads.yaml"), "package"


@dataclass(frozen=True)
class Origin:
    """commit, date: of the code, "" where a result names none. code: digest by folder; of `package` that of the Unity
    package."""

    commit: str
    date: str
    code: Mapping[str, str]

    @property
    def digest(self) -> str:
        return hashlib.sha256(json.dumps(dict(self.code), sort_keys=True).encode()).hexdigest()[:SHOWN]

    def changed(self, now: Mapping[str, str]) -> list[str]:
        """The folders that are no longer as they were."""
        return sorted(name for name in {*self.code, *now} if self.code.get(name) != now.get(name))


def origin_of(root: Path, name: str, modules: Collection[str]) -> Origin:
    """That of a result that is to be made now.

    Raises:
        InputError: there is no commit or no such module, or code or settings are not committed.
    """
    try:
        commit, date = git(root, "log", "-1", "--format=%h %cs", "--abbrev=7").split()
        changed = git(root, "status", "--porcelain", "--", ".", ":(exclude)docs").splitlines()
    except (FileNotFoundError, subprocess.CalledProcessError, ValueError):
        raise InputError(f"{root.resolve()}: found no commit, expected one: a result that is kept names it") from None
    if changed:
        more = f" and {len(changed) - 1} more" if changed[1:] else ""
        raise InputError(
            f"{changed[0][3:]}{more}: found changes, expected them committed: a result is kept of a commit"
        )
    for module in modules:
        if not (root / _file(root, module)).is_file():
            raise InputError(
                f"{module}: found no such module in {root.resolve()}, expected that which makes the result"
            )
    code = code_of(root, modules, reads_of(root, name))
    if PACKAGE in code:
        code[PACKAGE] = _package(root)
    return Origin(commit, date, code)


def _package(root: Path) -> str:
    """Digest of the package that the command line names, or of the tree's, by the file itself where there is one."""
    named = [Path(word) for word in sys.orig_argv if word.endswith(".tgz")]
    files = named or sorted((root / MANIFEST).parent.glob("*.tgz"))
    if not files:
        return package_of(root)
    return hashlib.sha256(read_tarball(files[0])[PACKED]).hexdigest()[:SHOWN]


def reads_of(root: Path, name: str) -> list[str]:
    """What the result reads beside the code that it imports, by docs/results/reads.yaml."""
    path = root / READS
    return _flat((yaml.safe_load(path.read_text(encoding="utf-8")) or {}).get(name, [])) if path.is_file() else []


def code_of(root: Path, modules: Iterable[str], reads: Iterable[str] = ()) -> dict[str, str]:
    """Digest by folder of what results of these modules go through. What is not there is not in it.

    Args:
        reads: `package`; modules, as files; settings, as files, folders or `params.yaml:section`; outputs of stages.
    """
    reads = list(reads)
    starts = [_file(root, module) for module in modules]
    starts += [entry for entry in reads if entry.endswith(".py")]
    folders: dict[str, list[Path]] = {}
    for file in with_neighbours(root, imported(root, starts)):
        folders.setdefault(_place(root, file).as_posix(), []).append(file)
    digests = {name: _digest(root, files) for name, files in folders.items()}
    others = {entry: _of_entry(root, entry) for entry in reads if not entry.endswith(".py")}
    return digests | {entry: digest for entry, digest in others.items() if digest}


def imported(root: Path, starts: Iterable[str]) -> set[str]:
    """Files of `root` that `starts` import, directly or not, themselves included; without what is inert."""
    reached: set[str] = set()
    todo = list(starts)
    while todo:
        name = todo.pop()
        inert = name.startswith(INERT) and name not in ACTIVE
        if name in reached or inert or not (root / name).is_file():
            continue
        modules, is_empty = _imports((root / name).read_text(encoding="utf-8"))
        if is_empty:
            continue
        reached.add(name)
        if name == "trunkline/model/arm/kinds.py":  # it imports every file beside it
            todo += [f"trunkline/model/arm/{file.name}" for file in (root / "trunkline/model/arm").glob("*.py")]
        for module in modules:
            parts = module.split(".")
            todo += [
                "/".join(parts) + ".py",
                *("/".join([*parts[:n], "__init__.py"]) for n in range(1, len(parts) + 1)),
            ]
    return reached


def with_neighbours(root: Path, files: Iterable[str]) -> list[Path]:
    """`files`, and what is no Python in their folders; of a file that lies in a room itself, what has its stem."""
    paths = {Path(file) for file in files}
    places = {_place(root, file) for file in paths if file.parts[0] in ROOMS}
    for place in {place.parent if place.suffix else place for place in places}:
        inside = len(place.parts) > 1
        inner = (root / place).rglob("*") if inside else (root / place).glob("*")
        others = [file.relative_to(root) for file in inner if file.is_file() and file.suffix not in {".py", *MADE}]
        paths |= {file for file in others if inside or file.with_suffix(".py") in paths}
    return sorted(paths)


def _place(root: Path, file: Path) -> Path:
    """The innermost package that a file is of, or the file where it lies in a room itself."""
    if len(file.parts) < 3:
        return file
    folder = file.parent
    while len(folder.parts) > 2 and not (root / folder / "__init__.py").is_file():
        folder = folder.parent
    return folder


def _flat(entries: str | list) -> list[str]:
    return [entries] if isinstance(entries, str) else [name for entry in entries for name in _flat(entry)]


@cache
def _imports(text: str) -> tuple[list[str], bool]:
    """Modules of the checkout that a module's text imports anywhere in it; and whether it is a docstring alone."""
    tree, modules = ast.parse(text), []
    for node in ast.walk(tree):
        if isinstance(node, ast.Import):
            modules += [alias.name for alias in node.names]
        elif isinstance(node, ast.ImportFrom) and node.module and not node.level:
            modules += [node.module, *(f"{node.module}.{alias.name}" for alias in node.names)]
    is_empty = [type(node) for node in tree.body] == [ast.Expr]
    return [module for module in modules if module.partition(".")[0] in ROOMS], is_empty


def _file(root: Path, module: str) -> str:
    path = module.replace(".", "/")
    return f"{path}/__main__.py" if (root / path / "__main__.py").is_file() else f"{path}.py"


def _of_entry(root: Path, entry: str) -> str:
    """ "" of what is not there."""
    file, _, section = entry.partition(":")
    if entry == PACKAGE:
        return package_of(root)
    if section:
        values = yaml.safe_load((root / file).read_text(encoding="utf-8")) if (root / file).is_file() else {}
        return _short(json.dumps(values[section], sort_keys=True).encode()) if section in values else ""
    if digest := _written(root, entry):
        return digest
    path = root / entry
    files = [path] if path.is_file() else sorted(file for file in path.rglob("*") if file.suffix not in MADE)
    files = [file.relative_to(root) for file in files if file.is_file()]
    return _digest(root, files) if files else ""


def _written(root: Path, entry: str) -> str:
    """Digest of a stage's output by its lock file, as a clone has it; "" of what no stage writes."""
    parts = Path(entry).parts
    folder = Path(*parts[:2]) if parts[0] == "examples" else Path()
    for lock in (root / folder / "dvc.lock", root / "demo" / "dvc.lock"):
        outs = _outs(lock.read_text(encoding="utf-8")) if lock.is_file() else {}
        if digest := outs.get(Path(entry).relative_to(folder).as_posix()):
            return digest[:SHOWN]
    return ""


@cache
def _outs(text: str) -> dict[str, str]:
    """Digests of the outputs in a lock file, by path."""
    stages = yaml.load(text, getattr(yaml, "CSafeLoader", yaml.SafeLoader))["stages"].values()
    return {out["path"]: out["md5"] for stage in stages for out in stage.get("outs", [])}


def _digest(root: Path, files: Iterable[Path]) -> str:
    return _short(
        b"".join(hashlib.sha256(f"{file}\n".encode() + (root / file).read_bytes()).digest() for file in files)
    )


def _short(content: bytes) -> str:
    return hashlib.sha256(content).hexdigest()[:SHOWN]


def git(root: Path, *words: str) -> str:
    """What a Git command prints in `root`; CalledProcessError where it fails."""
    return subprocess.run(["git", *words], cwd=root, capture_output=True, text=True, check=True).stdout
