"""A folder in which a stage runs as in the project's, on a small session."""

from pathlib import Path

from demo.instruments import InstrumentSettings
from tests.support.sessions import all_truths, instruments, record

ROOT = Path(__file__).parents[2]


def workbench(folder: Path, settings: InstrumentSettings | None = None) -> Path:
    """Make `folder` a project with the settings of this one and the small session as data/raw/demo."""
    (folder / "conf").symlink_to(ROOT / "conf")
    (folder / "params.yaml").write_text((ROOT / "params.yaml").read_text())
    record(folder / "data/raw/demo", all_truths(), settings or instruments())
    return folder
