"""Where tests find what is not in Git: the package and the session of `make demo`, and recordings of others' arms."""

from pathlib import Path

import pytest

ROOT = Path(__file__).parents[2]
SHARED = ROOT.parent / "shared/data"
CASES = ROOT.parent / "shared/cases"
SMALL_DEMO = ROOT / "build/small_demo"

# parameters.json of a stage that has identified nothing: what `read_table` asks for
TABLE_OF_NOTHING = {
    "parameters": {}, "fitted_to": {}, "compared": {"experiments": [], "frames": 1, "command_delay": 0.0},
}  # fmt: skip

with_recordings = pytest.mark.skipif(not SHARED.is_dir(), reason="no ../shared/data, the recordings of others' arms")
with_cases = pytest.mark.skipif(not CASES.is_dir(), reason="no ../shared/cases, sessions as others record them")


def demo_with(pattern: str) -> Path:
    """The project whose `make demo` made what matches: this one, or that in little which `make test` makes."""
    for root in (ROOT, SMALL_DEMO):
        if any(root.glob(pattern)):
            return root
    pytest.fail(f"found no {pattern}: `make demo` makes it, or `make small_demo` in little", pytrace=False)


def package() -> Path:
    """The Unity package that the stage made last."""
    pattern = "artifacts/package_unity/*.tgz"
    (path,) = demo_with(pattern).glob(pattern)
    return path


def unpack(files: dict[str, bytes], folder: Path) -> Path:
    """A package's files in a folder."""
    for path, data in files.items():
        (folder / path).parent.mkdir(parents=True, exist_ok=True)
        (folder / path).write_bytes(data)
    return folder
