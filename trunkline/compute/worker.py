"""`python -m trunkline.compute.worker tcp://host:8786`: a worker of a Dask scheduler, as `TRUNKLINE_SCHEDULER` needs
it.

It is `dask worker` with one thread in each process, as many as there are cores (`--nworkers`), and the arithmetic that
stages have; further options are Dask's (`python -m trunkline.compute.worker --help`).
"""

import os
import sys

from trunkline.compute.numerics import hold_arithmetic
from trunkline.compute.threads import thread_count
from trunkline.errors import InputError, in_one_line


@in_one_line
def main() -> int:
    try:
        import distributed  # noqa: F401
    except ImportError:
        raise InputError(
            "trunkline.compute.worker: found no library distributed, expected trunkline[cluster]"
        ) from None
    hold_arithmetic()  # before the processes begin, as NumPy reads it when it is imported
    processes = [] if "--nworkers" in sys.argv else ["--nworkers", str(thread_count())]
    command = [sys.executable, "-m", "distributed.cli.dask_worker", "--nthreads", "1", *processes, *sys.argv[1:]]
    os.environ["TRUNKLINE_THREADS"] = "1"
    os.execv(sys.executable, command)


if __name__ == "__main__":
    sys.exit(main())
