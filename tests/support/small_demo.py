"""`make small_demo`: the demo in little under build/, by the same dvc.yaml and code, for tests of what it makes.

The stand-in lab's session is recorded whole, at real size; the stages take some of its trials, and settings by which
they soon end: tests/small_demo.yaml. DVC runs again only what changed.
"""

import os
import shutil
import subprocess
import sys
from pathlib import Path

import yaml

from tests.support.folders import ROOT, SMALL_DEMO

WANTED = ROOT / "tests/small_demo.yaml"
SETTINGS = ("dvc.yaml", "params.yaml", "versions.yaml", "conf", "demo/dvc.yaml", "demo/params.yaml", "demo/conf")
COPIED = (*SETTINGS, ".dvcignore")  # without it, what Python and numba keep beside the code would count as code
LAB = tuple(f"demo/{path.name}" for path in sorted((ROOT / "demo").glob("*.py")))
LINKED = ("trunkline", "stages", "docs", "LICENSE", *LAB, "demo/plants")


def main() -> int:
    wanted = yaml.safe_load(WANTED.read_text())
    lay(wanted["settings"])
    try:
        run("dvc", "repro", "-q", "demo/dvc.yaml")
        choose(wanted["trials"].split())
        run("dvc", "repro", "-q", "dvc.yaml")
    except subprocess.CalledProcessError:
        print("error: the demo in little did not come to its end, see above", file=sys.stderr)
        return 1
    return 0


def lay(settings: dict[str, dict]) -> None:
    """The checkout's files in a project of its own: settings as copies, changed; code as links, so that what numba
    compiles of it is compiled once."""
    if not (SMALL_DEMO / ".dvc").is_dir():
        SMALL_DEMO.mkdir(parents=True, exist_ok=True)
        run("dvc", "init", "-q", "--no-scm")
    for name in COPIED:
        source, target = ROOT / name, SMALL_DEMO / name
        shutil.rmtree(target) if target.is_dir() else target.unlink(missing_ok=True)
        target.parent.mkdir(parents=True, exist_ok=True)
        shutil.copytree(source, target) if source.is_dir() else shutil.copy(source, target)
    for name in LINKED:
        target = SMALL_DEMO / name
        if not target.is_symlink():
            target.symlink_to(ROOT / name)
    for name, changes in settings.items():
        path = SMALL_DEMO / name
        text = path.read_text()
        head = "".join(line for line in text.splitlines(True) if line.startswith("# @package"))
        path.write_text(head + yaml.safe_dump(changed(yaml.safe_load(text), changes, name)))


def changed(values: dict, changes: dict, where: str) -> dict:
    """`values` with other numbers, of keys that there are."""
    for key, value in changes.items():
        if key not in values:
            raise KeyError(f"{WANTED.name}: {where}: no {key}")
        values[key] = changed(values[key], value, f"{where}: {key}") if isinstance(value, dict) else value
    return values


def choose(names: list[str]) -> None:
    """A session of some trials of the recorded one."""
    whole, some = SMALL_DEMO / "data/raw/demo", SMALL_DEMO / "data/raw/some_of_demo"
    session = yaml.safe_load((whole / "session.yaml").read_text())
    session["trials"] = [trial for trial in session["trials"] if trial["file"].removesuffix(".mcap") in names]
    assert len(session["trials"]) == len(names), f"{WANTED.name}: trials: not all of them are recorded"
    shutil.rmtree(some, ignore_errors=True)
    some.mkdir(parents=True)
    (some / "session.yaml").write_text(yaml.safe_dump(session, sort_keys=False))
    for trial in session["trials"]:
        os.link(whole / trial["file"], some / trial["file"])


def run(*command: str) -> None:
    path = os.pathsep.join([str(Path(sys.executable).parent), os.environ["PATH"]])
    environment = os.environ | {"PATH": path, "DVC_NO_ANALYTICS": "1", "PYTHONPATH": ""}
    subprocess.run(command, cwd=SMALL_DEMO, env=environment, check=True)


if __name__ == "__main__":
    sys.exit(main())
