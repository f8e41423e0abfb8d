"""Identification side by side with raw simulation, with the paper's recipe as first written, and with mujoco.sysid.

    python -m benchmarks.identification [--quick] [--only rate recipe sysid growth physics]

Needs what `make demo` leaves behind. Uses TRUNKLINE_THREADS threads; runs of rivals alternate, and the best of each
counts. CPU time is that of all threads: on a busy machine it says more than wall time.
"""

import argparse
import os
import sys

from benchmarks.identification import growth, physics, rate, recipe, sysid
from benchmarks.identification.case import QUICK, Size, read_case
from trunkline.compute.threads import thread_count
from trunkline.errors import in_one_line
from upkeep.results import recorded

PARTS = {
    "rate": rate.report,
    "recipe": recipe.report,
    "sysid": sysid.report,
    "growth": growth.report,
    "physics": physics.report,
}


@in_one_line
def main() -> int:
    parser = argparse.ArgumentParser(prog="benchmarks.identification", description=__doc__)
    parser.add_argument("--quick", action="store_true", help="a small run, some minutes on 2 quiet cores")
    parser.add_argument("--only", nargs="+", choices=PARTS, default=list(PARTS), help="some of the parts")
    arguments = parser.parse_args()
    size = QUICK if arguments.quick else Size()
    for name in arguments.only:
        with recorded(f"identification_{name}", keep=not arguments.quick):
            print(f"{thread_count()} threads; load average before: {os.getloadavg()[0]:.1f}", flush=True)
            PARTS[name](read_case, size)
    return 0


if __name__ == "__main__":
    sys.exit(main())
