"""What a live session was to achieve and what it does: a Markdown table.

    python -m benchmarks.acceptance [PACKAGE]

Goals were set before any of it was built; what misses one is printed as it is. The hands, touches and links are
simulated, as the files of this folder say. Times are by the wall, of a machine that should do nothing else.
"""

import argparse
from pathlib import Path

from benchmarks.acceptance import pressing, previewing, records, rules
from trunkline.ar.preview.package import only_package
from trunkline.errors import in_one_line
from upkeep.results import recorded


@in_one_line
def run() -> int:
    parser = argparse.ArgumentParser(prog="benchmarks.acceptance", description=(__doc__ or "").partition("\n")[0])
    parser.add_argument("package", nargs="?", type=Path)
    package = parser.parse_args().package or only_package()
    with recorded("acceptance"):
        print("| what | found | goal |\n|---|---:|---:|", flush=True)
        for row in (*pressing.rows(), *previewing.rows(package), *rules.rows(), *records.rows()):
            print(f"| {row.what} | {row.found} | {row.goal} |", flush=True)
    return 0


if __name__ == "__main__":
    raise SystemExit(run())
