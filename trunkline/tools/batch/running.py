"""The pipeline of one arm, in a folder of its own: a dvc.yaml and params.yaml like another's, a link to its session.

`dvc exp run` varies the parameters of one repository's one session. Many sessions, with a cache that only this machine
needs, take a repository of DVC's each, without Git, that reads the project's code where it is.
"""

import os
import subprocess
import sys
from pathlib import Path
from typing import Any

import yaml
from omegaconf import DictConfig, OmegaConf

from trunkline.errors import InputError, nearest
from trunkline.files import written_whole
from trunkline.pipeline.config import PROJECT
from trunkline.settings import read_yaml
from trunkline.tools.batch.listing import ListedArm

OWN = ("data/", "artifacts/")  # what a pipeline has for itself; all else is read where it is
LOG = "fleet.log"


def prepare(arm: ListedArm, folder: Path, until: str) -> None:
    """Write what the pipeline of an arm takes into `folder`, up to the stage `until`.

    Raises:
        InputError: there is no such stage, or `params` has a section of none.
    """
    like = PROJECT if arm.like == "." else Path(arm.like)
    stages = needed(_plain(read_yaml(like / "dvc.yaml"))["stages"], until, like)
    params = read_yaml(like / "params.yaml")
    for section in arm.params:
        if section not in params:
            raise InputError(f"{arm.name}: params: found {section!r}, expected a section of {like / 'params.yaml'}"
                             f"{nearest(section, [str(key) for key in params])}")  # fmt: skip
    assert arm.session is not None, "arms that were run already are not prepared"
    session = Path(arm.session)
    # `only` is of another session
    layers = {"ingest": {"only": None}}, arm.params, {"ingest": {"session": session.name}}
    merged = OmegaConf.merge(params, *layers)
    assert isinstance(merged, DictConfig)  # as both are
    used = {key: value for key, value in _without_null(_plain(merged)).items() if key in stages}
    raw = folder / "data/raw"
    raw.mkdir(parents=True, exist_ok=True)
    for link in raw.iterdir():
        if link.is_symlink():
            link.unlink()
    (raw / session.name).symlink_to(session)
    _write(folder / "dvc.yaml", {"stages": {name: _from(stage, like, folder) for name, stage in stages.items()}})
    _write(folder / "params.yaml", used)
    if not (folder / ".dvc").is_dir():
        _dvc(folder, "init", "--no-scm", "--quiet")
        _dvc(folder, "config", "core.analytics", "false")


def run(folder: Path) -> str | None:
    """`dvc repro` there, which goes on where it was stopped; why it failed, in a few words, if it did."""
    with (folder / LOG).open("w", encoding="utf-8") as log:
        code = _dvc(folder, "repro", log=log)
    if code == 0:
        return None
    lines = (folder / LOG).read_text(encoding="utf-8").splitlines()
    errors = [line for line in lines if line.lower().startswith("error:")]
    reason = errors[0].partition(":")[2].strip() if errors else f"dvc ended with {code}"
    return f"{reason} ({folder / LOG})"


def needed(stages: dict[str, Any], until: str, where: Path) -> dict[str, Any]:
    """The stage `until` and all whose outputs it depends on, in the order of the file.

    Raises:
        InputError: there is no such stage.
    """
    if until not in stages:
        expected = f"expected a stage of {where / 'dvc.yaml'}{nearest(until, list(stages))}"
        raise InputError(f"--until: found {until!r}, {expected}")
    writes = {place: name for name, stage in stages.items() for key in ("outs", "metrics", "plots")
              for place in map(_place, stage.get(key, []))}  # fmt: skip
    required, waiting = set(), [until]
    while waiting:
        name = waiting.pop()
        if name not in required:
            required.add(name)
            waiting += [writes[dep] for dep in stages[name].get("deps", []) if dep in writes]
    return {name: stage for name, stage in stages.items() if name in required}


def _without_null(values: dict[str, Any]) -> dict[str, Any]:
    """Without keys that the list sets to null: an arm without motors has no `kp` to look for."""
    return {
        key: _without_null(value) if isinstance(value, dict) else value
        for key, value in values.items() if value is not None
    }  # fmt: skip


def _place(entry: str | dict) -> str:
    return entry if isinstance(entry, str) else next(iter(entry))


def _from(stage: dict[str, Any], like: Path, folder: Path) -> dict[str, Any]:
    """A stage of the pipeline in `like` as one in `folder`: what is not its own has another path."""

    def moved(name: str) -> str:
        return name if name.startswith(OWN) else os.path.relpath(like / name, folder.resolve())

    params = [
        {moved(str(file)): keys for file, keys in entry.items()} if isinstance(entry, dict) else entry
        for entry in stage.get("params", [])
    ]
    plots = [{_place(plot): {"cache": False}} for plot in stage.get("plots", [])]  # no templates here
    return stage | {"deps": [moved(name) for name in stage.get("deps", [])], "params": params, "plots": plots}


def _dvc(folder: Path, *words: str, log=None) -> int:
    environment = os.environ | {"DVC_NO_ANALYTICS": "1", "PATH": f"{Path(sys.executable).parent}:{os.environ['PATH']}"}
    command = [sys.executable, "-m", "dvc", *words]
    if log is not None:
        return subprocess.run(command, cwd=folder, env=environment, stdout=log, stderr=log, check=False).returncode
    done = subprocess.run(command, cwd=folder, env=environment, capture_output=True, text=True, check=False)
    if done.returncode:
        raise InputError(f"{folder}: dvc {' '.join(words)}: {(done.stderr or done.stdout).strip()}")
    return 0


def _plain(config: DictConfig) -> dict[str, Any]:
    """Without what `${}` stands for, which DVC puts in."""
    content = OmegaConf.to_container(config, resolve=False)
    assert isinstance(content, dict)
    return {str(key): value for key, value in content.items()}


def _write(path: Path, content: dict) -> None:
    """YAML, left alone where it is the same: what has not changed runs nothing again."""
    text = yaml.safe_dump(content, sort_keys=False, allow_unicode=True, width=1000)
    if not path.is_file() or path.read_text(encoding="utf-8") != text:
        with written_whole(path) as part:
            part.write_text(text, encoding="utf-8")
