"""Of which code and package the README's numbers are that hours of runs made, and whether the tree still has them.

`make lock` proves all other numbers of the README. The rehearsal's may lag behind (upkeep/lock.py); then
they are stale, and say so: in the README, and by a failure of `make gate`.
"""

import hashlib
import json
from pathlib import Path

from dvc.repo import Repo

from trunkline.files import file_digest

SHOWN = 12  # digits of a digest
REHEARSAL = ("rehearsal/dvc.yaml", "rehearse")
METRICS, MANIFEST = Path("artifacts/rehearse/metrics.json"), Path("artifacts/package_unity/manifest.json")


def stage_code(root: Path, file: str, name: str) -> str:
    """Digest of the code and settings that a stage depends on. In a fresh clone, without data or cache, the same.

    Args:
        file: the stage's dvc.yaml, from `root`. Its `meta: {apart: [...]}` names files and folders that do not count.
    """
    now = {name: now for name, (now, _) in _parts(root, file, name).items()}
    return hashlib.sha256(json.dumps(now, sort_keys=True).encode()).hexdigest()[:SHOWN]


def changed_since(root: Path, file: str, name: str) -> list[str]:
    """Dependencies of a stage that are no longer as they were when it ran, by its lock file."""
    return [name for name, (now, then) in _parts(root, file, name).items() if now != then]


def package_of(root: Path) -> str:
    """Digest of the tree's package, as `unpacked.package_digest`, from the manifest that Git has; "none" without."""
    path = root / MANIFEST
    return file_digest(path)[:SHOWN] if path.is_file() else "none"


def stale(root: Path) -> list[str]:
    """A line for each part of the README whose code or package is not the tree's; none of what never ran."""
    path = root / METRICS
    if not path.is_file():
        return []
    metrics = json.loads(path.read_text(encoding="utf-8"))
    then, now = (metrics.get("code"), metrics.get("package")), (stage_code(root, *REHEARSAL), package_of(root))
    if then == now:
        return []
    changed = changed_since(root, *REHEARSAL) if then[0] != now[0] else []
    changed += ["the package"] if then[1] != now[1] else []
    then_words = f"of code {then[0] or 'that is not named'}, package {then[1] or 'that is not named'}"
    since = ", ".join(changed) or "what the lock file does not tell"
    return [f"README: rehearsal: {then_words}; the tree has code {now[0]}, package {now[1]}; changed since: {since}"]


def _parts(root: Path, file: str, name: str) -> dict[str, tuple]:
    """By dependency, its digest in the tree and in the lock file, as DVC has them: of settings their values; of what
    another stage writes and this clone lacks, the digest in that stage's lock file."""
    with Repo(str(root)) as repo:
        stage = repo.stage.load_one(str(root / file), name)
        apart = [Path(entry) for entry in (stage.meta or {}).get("apart", [])]
        written = {out.fs_path: out.hash_info.value for out in repo.index.outs}
        digests = {}
        for dep in stage.deps:
            path = Path(dep.fs_path).relative_to(repo.root_dir)
            if not any(path.is_relative_to(entry) for entry in apart):
                now = dep.get_hash().value if dep.exists else written.get(dep.fs_path)
                digests[path.as_posix()] = (now, dep.hash_info.value if dep.hash_info else None)
    return digests
