"""`python -m benchmarks.pipeline`: how long each stage takes here and in another commit, stage by stage in one run.

The other commit is cloned into a temporary folder; both run on this checkout's session, one stage after the other, each
on what its own earlier stages wrote. Results of this checkout are left alone: it is copied too. With `--stages`, only
those run, on what the stages before them wrote in this checkout.
"""

import argparse
import os
import shutil
import subprocess
import sys
import tempfile
import time
from pathlib import Path
from typing import NamedTuple

import yaml

from trunkline.errors import InputError, in_one_line
from trunkline.pipeline.results import recorded

ROOT = Path(__file__).parents[1]


class Cost(NamedTuple):
    """Of one stage: wall time and time to its first line of output, s; CPU time, s; most memory, MiB."""

    wall: float
    first: float
    cpu: float
    memory: float


def run_stage(stage: str, folder: Path) -> Cost:
    """Run one stage in `folder`, the root of a checkout, with this Python.

    Raises:
        InputError: the stage failed; the message is its last line.
    """
    begun, first, lines = time.monotonic(), 0.0, []
    process = subprocess.Popen(
        [sys.executable, "-m", f"stages.{stage}"],
        cwd=folder, stdout=subprocess.PIPE, stderr=subprocess.STDOUT, text=True,
    )  # fmt: skip
    assert process.stdout is not None
    for line in process.stdout:
        first = first or time.monotonic() - begun
        lines.append(line)
    _, status, usage = os.wait4(process.pid, 0)
    if status:
        raise InputError(f"{folder.name}: {stage}: {lines[-1] if lines else 'no output'}")
    return Cost(time.monotonic() - begun, first, usage.ru_utime + usage.ru_stime, usage.ru_maxrss / 1024)


def copies(other: str, session: str, folder: Path, results: bool) -> dict[str, Path]:
    """This working tree and commit `other`, each in a folder of its own with the session's logs.

    With `results`, also with what this checkout's stages wrote.
    """
    logs = ROOT / "data" / "raw" / session
    if not logs.is_dir():
        raise InputError(f"{logs}: no such folder, expected a session's logs (run `make demo`)")
    made = {"here": folder / "here", other: folder / "other"}
    for path in made.values():
        subprocess.run(["git", "clone", "-q", str(ROOT), str(path)], check=True)
        shutil.copytree(logs, path / "data" / "raw" / session)
    subprocess.run(["git", "checkout", "-q", other], cwd=made[other], check=True)
    listing = ["git", "ls-files", "-z", "--modified", "--others", "--exclude-standard"]
    for name in subprocess.run(listing, cwd=ROOT, capture_output=True, text=True, check=True).stdout.split("\0"):
        if name and (ROOT / name).is_file():
            (made["here"] / name).parent.mkdir(parents=True, exist_ok=True)
            shutil.copy(ROOT / name, made["here"] / name)
    # without the file, Python would take the `stages` that is installed
    (made[other] / "stages" / "__init__.py").touch()
    for path in made.values() if results else ():
        for name in ("data/processed", "artifacts"):
            shutil.copytree(ROOT / name, path / name, dirs_exist_ok=True)
    return made


@in_one_line
@recorded("pipeline")
def main() -> int:
    parser = argparse.ArgumentParser(description=__doc__)
    parser.add_argument("--against", default="HEAD~1", help="the other commit")
    parser.add_argument("--session", default="demo")
    parser.add_argument("--stages", nargs="+", help="all by default")
    chosen = parser.parse_args()
    stages = chosen.stages or list(yaml.safe_load((ROOT / "dvc.yaml").read_text())["stages"])
    with tempfile.TemporaryDirectory() as folder:
        made = copies(chosen.against, chosen.session, Path(folder), bool(chosen.stages))
        totals = {name: 0.0 for name in made}
        print(f"wall s (to the first line; CPU s; MiB), here against {chosen.against}")
        for stage in stages:
            costs = {name: run_stage(stage, path) for name, path in made.items()}
            cells = [f"{c.wall:6.1f} ({c.first:4.1f}; {c.cpu:6.1f}; {c.memory:5.0f})" for c in costs.values()]
            ratio = costs["here"].wall / costs[chosen.against].wall
            print(f"{stage:20s} {'  '.join(cells)}  ratio {ratio:.2f}", flush=True)
            totals = {name: total + costs[name].wall for name, total in totals.items()}
        here, other = totals.values()
        print(f"{'all':20s} {here:6.1f} against {other:.1f}  ratio {here / other:.2f}")
    return 0


if __name__ == "__main__":
    sys.exit(main())
