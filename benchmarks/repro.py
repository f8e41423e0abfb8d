"""`dvc repro` where nothing is to be done: what it costs to ask.

python -m benchmarks.repro [--times 5]
"""

import argparse
import subprocess
import sys
import time

import numpy as np

from benchmarks.pipeline import ROOT, environment
from trunkline.errors import InputError, in_one_line
from upkeep.results import recorded

NOTHING = "Data and pipelines are up to date."


def repro() -> float:
    """s that it takes.

    Raises:
        InputError: there was something to do.
    """
    begun = time.monotonic()
    command = [sys.executable, "-m", "dvc", "repro"]
    found = subprocess.run(command, cwd=ROOT, env=environment(), capture_output=True, text=True)
    if NOTHING not in found.stdout:
        raise InputError("dvc repro: found something to do, expected nothing: run it once before")
    return time.monotonic() - begun


@in_one_line
def main() -> int:
    parser = argparse.ArgumentParser(description=__doc__)
    parser.add_argument("--times", type=int, default=5)
    given = parser.parse_args()
    repro()  # which compiles DVC, where it never ran
    with recorded("repro", given.times >= 5):
        found = np.array([repro() for _ in range(given.times)])
        print(
            f"`dvc repro` with nothing to do, {len(found)} times: {np.median(found):.2f} s median, "
            f"{found.max():.2f} s most"
        )
    return 0


if __name__ == "__main__":
    raise SystemExit(main())
