"""The real dvc.yaml, params.yaml and conf folder around stages that only hash what they read.

Quick, and honest about what depends on what: an output changes exactly when something its stage declares has changed.
"""

import copy
import json
import os
import shutil
import subprocess
import sys
from pathlib import Path

from dvc.repo import Repo
from omegaconf import OmegaConf

ROOT = Path(__file__).parents[2]
RESULTS = ("artifacts/", "dvc.lock", "demo/dvc.lock", "rehearsal/dvc.lock", ".dvc/", "examples/")

STUB = '''
import functools, hashlib, json, pathlib
from omegaconf import OmegaConf

def run(stage):
    declared = json.load(open("stub.json"))[stage]
    digest = hashlib.sha256()
    for name in declared["deps"]:
        path = pathlib.Path(name)
        for file in sorted(path.rglob("*.*")) if path.is_dir() else [path]:
            if "__pycache__" not in file.parts:
                digest.update(file.read_bytes())
    for file, keys in declared["params"].items():
        values = OmegaConf.to_container(OmegaConf.load(file))
        chosen = {k: functools.reduce(dict.get, k.split("."), values) for k in keys or sorted(values)}
        digest.update(json.dumps(chosen).encode())
    for name in declared["outs"]:
        path = pathlib.Path(name) if pathlib.Path(name).suffix else pathlib.Path(name, "digest.txt")
        path.parent.mkdir(parents=True, exist_ok=True)
        path.write_text(json.dumps({"digest": int(digest.hexdigest()[:8], 16)}))
    pathlib.Path(declared["log"]).open("a").write(stage + chr(10))
'''


class StubPipeline:
    """A Git and DVC repository in `folder` with the project's pipeline and stub stages."""

    def __init__(self, folder: Path):
        self.folder, self.log = folder, folder.parent / f"{folder.name}.log"
        folder.mkdir()
        listing = ["git", "ls-files", "-z", "--cached", "--others", "--exclude-standard", "--deduplicate"]
        files = subprocess.run(listing, cwd=ROOT, capture_output=True, text=True, check=True).stdout.split("\0")
        for name in files:
            if name and not name.startswith(RESULTS) and (ROOT / name).is_file():
                (folder / name).parent.mkdir(parents=True, exist_ok=True)
                shutil.copy(ROOT / name, folder / name)
        self.run("git", "init", "-q")
        self.run("git", "config", "user.name", "test")
        self.run("git", "config", "user.email", "test@localhost")
        self.run("dvc", "init", "-q")
        shutil.copy(ROOT / ".dvc" / "config", folder / ".dvc" / "config")
        self._write_stubs()
        self.commit()

    def clone(self, folder: Path) -> "StubPipeline":
        """Another clone, which has what Git has: no data, no cache."""
        self.run("git", "clone", "-q", ".", str(folder))
        other = copy.copy(self)
        other.folder = folder
        return other

    def run(self, *command: str) -> str:
        """Output of a command in the repository; fails with what it printed."""
        path = os.pathsep.join([str(Path(sys.executable).parent), os.environ["PATH"]])
        environment = os.environ | {"PATH": path, "DVC_NO_ANALYTICS": "1", "PYTHONPATH": ""}
        done = subprocess.run(command, cwd=self.folder, env=environment, capture_output=True, text=True, check=False)
        assert done.returncode == 0, f"{' '.join(command)}:\n{done.stdout}{done.stderr}"
        return done.stdout

    def commit(self) -> None:
        self.run("git", "add", "-A")
        self.run("git", "commit", "-qm", "state")

    def restore(self) -> None:
        """Back to the last commit and its results."""
        self.run("git", "checkout", "-q", ".")
        self.run("dvc", "checkout", "-q")

    def ran(self, *command: str) -> list[str]:
        """The stages that `command` ran, in their order."""
        self.log.unlink(missing_ok=True)
        self.run(*command)
        return self.log.read_text().split() if self.log.exists() else []

    def edit(self, name: str, change) -> None:
        """Replace the text of a file by `change(text)`."""
        path = self.folder / name
        path.write_text(change(path.read_text()))

    def tunable(self, stage: str) -> tuple[str, float]:
        """The first number of the stage's section: its dotted key and its value."""
        number = self._first_number(OmegaConf.load(self.folder / "params.yaml")[stage])
        assert number, f"params.yaml: {stage}: no number to tune"
        return f"{stage}.{number[0]}", number[1]

    def _first_number(self, section) -> tuple[str, float] | None:
        for key, value in section.items():
            if isinstance(value, int | float) and not isinstance(value, bool):
                return key, value
            if OmegaConf.is_dict(value) and (number := self._first_number(value)):
                return f"{key}.{number[0]}", number[1]
        return None

    def _write_stubs(self) -> None:
        declared = {}
        with Repo(str(self.folder)) as repo:
            for stage in repo.index.stages:
                module = stage.cmd.split()[-1]
                declared[module] = {
                    "deps": [_relative(dep, repo) for dep in stage.deps if not hasattr(dep, "params")],
                    "outs": [_relative(out, repo) for out in stage.outs],
                    "params": {_relative(dep, repo): dep.params for dep in stage.deps if hasattr(dep, "params")},
                    "log": str(self.log),
                }
        (self.folder / "stub.json").write_text(json.dumps(declared))
        (self.folder / "stub.py").write_text(STUB)
        for module in declared:
            file = self.folder / Path(*module.split(".")).with_suffix(".py")
            file.write_text(f"import stub\n\nstub.run({module!r})\n")


def _relative(entry, repo: Repo) -> str:
    return os.path.relpath(entry.fs_path, repo.root_dir)
