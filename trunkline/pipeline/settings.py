"""`python -m trunkline.pipeline.settings`: check every stage's settings before anything runs."""

import hashlib
import json
import sys
from pathlib import Path

from trunkline.errors import InputError, in_one_line, nearest
from trunkline.pipeline.checkout import require_checkout
from trunkline.pipeline.config import PROJECT, SHARED, check_settings, container, own_or_project
from trunkline.recordings.session.session import sessions_in
from trunkline.settings import read_yaml

LAB = "demo"  # the session that the stand-in lab records, see demo/dvc.yaml


def check_once(running: str = "", root: Path = Path(".")) -> None:
    """Check the settings of the stages that come after `running` in dvc.yaml, or of all, unless they passed before.

    Every stage that DVC runs calls this first, so that a typo in the last section shows before the first stage works.
    To check a stage is to import it, which takes seconds: hence the note, in DVC's temporary folder, of which settings
    have passed. Outside of a pipeline (no dvc.yaml) there is nothing to check.

    Raises:
        InputError: for the first mistake in any section.
    """
    if not (root / "dvc.yaml").is_file():
        return
    order = list(read_yaml(root / "dvc.yaml").stages)
    digests = settings_digests(order[order.index(running) + 1 :] if running in order else order, root)
    note = own_or_project(root, "stages").parent / ".dvc" / "tmp" / f"settings.{root.resolve().name}.json"
    passed = json.loads(note.read_text()) if note.is_file() else {}
    changed = [stage for stage, digest in digests.items() if passed.get(stage) != digest]
    if changed:
        print(f"settings: checking those of {', '.join(changed)}", flush=True)
    check_settings(root, changed)
    note.parent.mkdir(parents=True, exist_ok=True)
    note.write_text(json.dumps(passed | digests))


def settings_digests(stages: list[str], root: Path) -> dict[str, str]:
    """By stage, of its section, its files, and what stages nest in their settings: a range is a type of pydantic's."""
    conf, files = own_or_project(root, "conf"), own_or_project(root, "stages")
    params = container(read_yaml(root / "params.yaml"))
    ranges = [file.read_bytes() for file in sorted((PROJECT / "trunkline").glob("**/*.py"))]
    common = [text for text in ranges if b"pydantic" in text]
    common += [file.read_bytes() for file in sorted((conf / SHARED).glob("**/*.yaml"))]
    digests = {}
    for stage in stages:
        stage_files = [*sorted((conf / stage).glob("**/*.yaml")), *files.glob(f"{stage}.py")]
        parts = [repr(params.get(stage)).encode(), *(file.read_bytes() for file in stage_files), *common]
        digests[stage] = hashlib.sha256(b"\0".join(parts)).hexdigest()
    return digests


def require_session(root: Path) -> None:
    """Raise InputError unless the session of params.yaml is there, or comes: from the stand-in lab, or by `dvc pull`.

    DVC, which looks for it before any stage runs, would only say that a path does not exist.
    """
    params, raw = read_yaml(root / "params.yaml"), root / "data" / "raw"
    wanted = params.get("ingest", {}).get("session")
    tracked = [file.stem for file in raw.glob("*.dvc")]
    folders = [file.parents[1].name for file in raw.glob("[!.]*/[!.]*/session.yaml")]  # of several sessions
    there = sorted({LAB, *tracked, *sessions_in(raw), *folders})
    if wanted is not None and wanted not in there:
        expected = f"one of the sessions in {raw}: {', '.join(there)}{nearest(str(wanted), there)}"
        raise InputError(f"{root / 'params.yaml'}: ingest.session: found {wanted!r}, expected {expected}")


@in_one_line
def main() -> int:
    require_checkout(Path("."))
    check_once()
    require_session(Path("."))
    print("settings: in order")
    return 0


if __name__ == "__main__":
    sys.exit(main())
