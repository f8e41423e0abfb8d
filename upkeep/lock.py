"""`python -m upkeep.lock`: does dvc.lock belong to this code, params.yaml, libraries and metrics?

Works in a fresh clone, without data or cache. DVC compares commands, parameters and every file that is there;
files that only the cache holds are compared through the lock: what a stage read must be what another wrote.

A stage whose dvc.yaml says `meta: {on_demand: true}`, as the rehearsal's of hours, may lag behind what it read: its
results must be those that it wrote, and no more is asked. `dvc status` tells whether it lags.
"""

import subprocess
import sys
from pathlib import Path

from dvc.repo import Repo

from trunkline.errors import in_one_line
from trunkline.pipeline.checkout import require_checkout
from upkeep.versions import installed_otherwise, locked_otherwise

ABSENT = ("deleted", "not in cache")  # DVC's words for a file that a clone without the cache lacks


def mismatches(root: Path) -> list[str]:
    """One line per way in which the lock files disagree with the working tree or with themselves."""
    with Repo(str(root)) as repo:
        lines = [*_unlocked(repo), *_changed(repo), *_inconsistent(repo)]
    return [*lines, *locked_otherwise(root), *installed_otherwise(root)]


def _unlocked(repo: Repo) -> list[str]:
    """Stages that never ran, or that gained a dependency or an output since."""
    lines = []
    for stage in repo.index.stages:
        entries = [*stage.deps, *stage.outs]
        if _on_demand(stage) and not _has_results(stage):
            continue
        new = [str(_path(entry)) for entry in entries if not entry.hash_info]
        if new:
            what = "never ran" if len(new) == len(entries) else f"not in the lock file: {', '.join(new)}"
            lines.append(f"{stage.name}: {what}")
    return lines


def _changed(repo: Repo) -> list[str]:
    """What `dvc status` reports, but for files that a clone without the cache cannot have."""
    command = ["git", "ls-files", "-z"]
    listed = subprocess.run(command, cwd=repo.root_dir, capture_output=True, text=True, check=True).stdout
    expected = {Path(file) for file in listed.split("\0") if file}
    expected |= {folder for file in expected for folder in file.parents}
    expected |= {_path(out) for out in repo.index.outs if not out.use_cache}
    lagging = {stage.addressing: _has_results(stage) for stage in repo.index.stages if _on_demand(stage)}
    lines = []
    for address, changes in repo.status().items():
        stage = address.rpartition(":")[2]
        for change in changes:
            if isinstance(change, str):  # "changed command"
                lines += [] if address in lagging else [f"{stage}: {change}"]
                continue
            lines += [
                f"{stage}: {kind}: {name}: {state}"
                for kind, states in change.items()
                if address not in lagging or (lagging[address] and kind == "changed outs")
                for name, state in states.items()
                if state not in ABSENT or Path(name) in expected
            ]
    return lines


def _inconsistent(repo: Repo) -> list[str]:
    written = {_path(out): out for out in repo.index.outs}
    return [
        f"{stage.name}: read another {_path(dep)} than {out.stage.name} wrote"
        for stage in repo.index.stages
        if not _on_demand(stage)
        for dep in stage.deps
        if (out := written.get(_path(dep))) and dep.hash_info and dep.hash_info != out.hash_info
    ]


def _on_demand(stage) -> bool:
    return bool((stage.meta or {}).get("on_demand"))


def _has_results(stage) -> bool:
    """It ran, or somebody put results in its place."""
    return any(out.hash_info or (Path(out.fs_path).exists() and not out.use_cache) for out in stage.outs)


def _path(entry) -> Path:
    return Path(entry.fs_path).relative_to(entry.repo.root_dir)


@in_one_line
def main(root: Path = Path(".")) -> int:
    require_checkout(root)
    problems = mismatches(root)
    for problem in problems:
        print(f"lock: FAIL {problem}")
    print(f"lock: {len(problems)} problems")
    return 1 if problems else 0


if __name__ == "__main__":
    sys.exit(main())
