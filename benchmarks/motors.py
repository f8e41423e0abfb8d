"""The tendons' motors in real time, against simulated ones on a virtual bus: loop, pulls, silence, homing.

    python -m benchmarks.motors

`trunkline/ar/drivers/self_test.py` says what is measured.
"""

import sys

from trunkline.ar.drivers.self_test import measures, table
from trunkline.ar.drivers.settings import ExecutionConfig
from trunkline.errors import in_one_line
from trunkline.pipeline.config import PROJECT, load_folder
from upkeep.results import recorded


@in_one_line
def main(arguments: list[str]) -> int:
    with recorded("motors"):
        print(table(measures(load_folder(ExecutionConfig, PROJECT / "conf/execution").motors)))
    return 0


if __name__ == "__main__":
    sys.exit(main(sys.argv[1:]))
