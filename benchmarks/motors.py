"""The tendons' motors in real time, against simulated ones on a virtual bus: loop, pulls, silence, homing.

    python -m benchmarks.motors

`trunkline/execution/check.py` says what is measured.
"""

import sys

from trunkline.errors import in_one_line
from trunkline.execution.check import measures, table
from trunkline.execution.settings import Config
from trunkline.pipeline.config import PROJECT, load_folder
from trunkline.pipeline.results import recorded


@in_one_line
def main(arguments: list[str]) -> int:
    with recorded("motors"):
        print(table(measures(load_folder(Config, PROJECT / "conf/execution").motors)))
    return 0


if __name__ == "__main__":
    sys.exit(main(sys.argv[1:]))
