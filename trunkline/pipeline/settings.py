"""`python -m trunkline.pipeline.settings`: check every stage's settings before anything runs."""

import hashlib
import sys
from pathlib import Path

from trunkline.errors import InputError, in_one_line, nearest
from trunkline.pipeline.checkout import require_checkout
from trunkline.pipeline.config import PROJECT, check_settings, own_or_project
from trunkline.recordings.session.session import sessions_in
from trunkline.settings import read_yaml

LAB = "demo"  # the session that the stand-in lab records, see demo/dvc.yaml


def check_once(root: Path = Path(".")) -> None:
    """Check the settings of all stages, unless these very files passed before.

    Every stage that DVC runs calls this first, so that a typo in the last section shows before the first stage works.
    To check is to import every stage, which takes seconds: hence the note of what has passed, in DVC's temporary
    folder, and a stage that is run by itself checks its own settings alone.
    Outside of a pipeline (no dvc.yaml) there is nothing to check.

    Raises:
        InputError: for the first mistake in any section.
    """
    if not (root / "dvc.yaml").is_file():
        return
    conf, stages = own_or_project(root, "conf"), own_or_project(root, "stages")
    files = [root / "params.yaml", root / "dvc.yaml", *conf.glob("**/*.yaml"), *stages.glob("*.py")]
    # and what stages nest in their settings: a range is a type of pydantic's
    files += [file for file in (PROJECT / "trunkline").glob("**/*.py") if b"pydantic" in file.read_bytes()]
    digest = hashlib.sha256()
    for file in sorted(file for file in files if file.is_file()):
        digest.update(str(file).encode() + b"\0" + file.read_bytes() + b"\0")
    passed = stages.parent / ".dvc" / "tmp" / f"settings.{root.resolve().name}.sha256"
    if passed.is_file() and passed.read_text() == digest.hexdigest():
        return
    print("settings: checking those of all stages", flush=True)
    print(f"settings: {len(check_settings(root))} stages checked", flush=True)
    passed.parent.mkdir(parents=True, exist_ok=True)
    passed.write_text(digest.hexdigest())


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
