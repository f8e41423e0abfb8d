"""`python -m benchmarks.pipeline`: how long each stage takes here and in another commit, stage by stage in one run.

The other commit is cloned into a temporary folder; both run on this checkout's session, one stage after the other, each
on what its own earlier stages wrote. Results of this checkout are left alone: it is copied too. With `--stages`, only
those run, on what the stages before them wrote in this checkout. With `--record`, each commit first records the session
of its own lab, as `make demo` does: for a commit that cannot read this one's.
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
from trunkline.pipeline.config import PROJECT
from upkeep.results import recorded

LOGS = "data/raw/demo"


class Cost(NamedTuple):
    """Of one stage: wall time and time to its first line of output, s; CPU time, s; most memory, MiB."""

    wall: float
    first: float
    cpu: float
    memory: float


def run_stage(module: str, folder: Path) -> Cost:
    """Run a stage's module in `folder`, the root of a checkout, with this Python.

    Raises:
        InputError: the stage failed; the message is its last line.
    """
    environment = {name: value for name, value in os.environ.items() if name != "PYTHONDONTWRITEBYTECODE"}  # as `make`
    begun, first, lines = time.monotonic(), 0.0, []
    process = subprocess.Popen(
        [sys.executable, "-m", module],
        cwd=folder, env=environment | {"PYTHONPATH": str(folder)},
        stdout=subprocess.PIPE, stderr=subprocess.STDOUT, text=True,
    )  # fmt: skip
    assert process.stdout is not None
    for line in process.stdout:
        first = first or time.monotonic() - begun
        lines.append(line)
    _, status, usage = os.wait4(process.pid, 0)
    if status:
        raise InputError(f"{folder.name}: {module}: {lines[-1] if lines else 'no output'}")
    return Cost(time.monotonic() - begun, first, usage.ru_utime + usage.ru_stime, usage.ru_maxrss / 1024)


def copies(other: str, session: bool, folder: Path, results: bool) -> dict[str, Path]:
    """This working tree and commit `other`, each in a folder of its own; with `session`, with the demo's logs.

    With `results`, also with what this checkout's stages wrote.
    """
    if session and not (PROJECT / LOGS).is_dir():
        raise InputError(f"{LOGS}: no such folder, expected a session's logs (run `make demo`)")
    made = {"here": folder / "here", other: folder / "other"}
    for path in made.values():
        subprocess.run(["git", "clone", "-q", str(PROJECT), str(path)], check=True)
        if session:
            shutil.copytree(PROJECT / LOGS, path / LOGS)
    subprocess.run(["git", "checkout", "-q", other], cwd=made[other], check=True)
    listing = ["git", "ls-files", "-z", "--modified", "--others", "--exclude-standard"]
    for name in subprocess.run(listing, cwd=PROJECT, capture_output=True, text=True, check=True).stdout.split("\0"):
        if name and (PROJECT / name).is_file():
            (made["here"] / name).parent.mkdir(parents=True, exist_ok=True)
            shutil.copy(PROJECT / name, made["here"] / name)
    # without the file, Python would take the `stages` that is installed
    (made[other] / "stages" / "__init__.py").touch()
    for path in made.values() if results else ():
        for name in ("data/processed", "artifacts"):
            shutil.copytree(PROJECT / name, path / name, dirs_exist_ok=True)
    return made


def told(cost: Cost | None) -> str:
    """Cells of the table."""
    if cost is None:
        return "– | – | – | –"
    return f"{cost.wall:.1f} s | {cost.first:.1f} s | {cost.cpu:.0f} s | {cost.memory:.0f} MiB"


@in_one_line
@recorded("pipeline")
def main() -> int:
    parser = argparse.ArgumentParser(description=__doc__)
    parser.add_argument("--against", default="HEAD~1", help="the other commit")
    parser.add_argument("--record", action="store_true", help="each commit records its own lab's session")
    parser.add_argument("--stages", nargs="+", help="all by default")
    chosen = parser.parse_args()
    with tempfile.TemporaryDirectory() as folder:
        made = copies(chosen.against, not chosen.record, Path(folder), bool(chosen.stages))
        known = {name: list(yaml.safe_load((path / "dvc.yaml").read_text())["stages"]) for name, path in made.items()}
        modules = ["demo.record"] if chosen.record else []
        modules += [f"stages.{stage}" for stage in chosen.stages or known["here"]]
        totals = dict.fromkeys(made, 0.0)
        words = "time | first line | processor | memory"
        print(f"| stage | here: {words} | {chosen.against}: {words} | time, ratio |")
        print(f"|---|{'---:|' * 9}", flush=True)
        for module in modules:
            stage = module.rpartition(".")[2]
            costs = {
                name: run_stage(module, path) if stage in [*known[name], "record"] else None
                for name, path in made.items()
            }
            here, other = costs["here"], costs[chosen.against]
            ratio = f"{here.wall / other.wall:.2f}" if here and other else "–"
            print(f"| {stage} | {told(here)} | {told(other)} | {ratio} |", flush=True)
            totals = {name: totals[name] + (cost.wall if cost else 0.0) for name, cost in costs.items()}
        here, other = totals.values()
        print(f"| all | {here:.1f} s | | | | {other:.1f} s | | | | {here / other:.2f} |")
    return 0


if __name__ == "__main__":
    sys.exit(main())
