"""A worker of a Dask scheduler, as `TRUNKLINE_SCHEDULER` needs it: `trunkline worker tcp://host:8786`

It is `dask worker` with one thread in each process, as many as there are cores (`--nworkers`); further options are
Dask's (`python -m distributed.cli.dask_worker --help`).
"""

import argparse
import os
import sys

from trunkline.compute.threads import thread_count
from trunkline.errors import InputError, in_one_line
from trunkline.program import command_parser


@in_one_line
def main(arguments: list[str] | None = None) -> int:
    words = sys.argv[1:] if arguments is None else arguments
    if {"-h", "--help"} & set(words):
        _parser().parse_args(["--help"])
    try:
        import distributed  # noqa: F401
    except ImportError:
        raise InputError(
            "trunkline.compute.worker: found no library distributed, expected trunkline[cluster]"
        ) from None
    count = [] if "--nworkers" in words else ["--nworkers", str(thread_count())]
    command = [sys.executable, "-m", "distributed.cli.dask_worker", "--nthreads", "1", *count, *words]
    os.environ["TRUNKLINE_THREADS"] = "1"
    os.execv(sys.executable, command)


def _parser() -> argparse.ArgumentParser:
    """For the help alone: Dask parses the arguments."""
    parser = command_parser("worker", __doc__)
    parser.add_argument("scheduler", metavar="ADDRESS", help="of the scheduler")
    parser.add_argument("--nworkers", metavar="N", help="processes; default: as many as there are cores")
    return parser


if __name__ == "__main__":
    sys.exit(main())
