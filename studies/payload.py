"""The heaviest mass that the arm holds: `python -m studies.payload`

Goes over the cells of `studies/payload.yaml` and adds a row for each to docs/results/payload.csv as soon as it is done;
stopped, it goes on from there. A file of other settings or another arm is refused, `--anew` begins another.
`--quick` is a small chart: hanging objects of two diameters, 1 placement, a coarser ladder.
`--cells N` stops after N more. Prints the rows and their cost; docs/results/payload.png shows them.
"""

import argparse
import hashlib
import json
import sys
import time
from dataclasses import asdict, astuple, fields
from pathlib import Path

import pandas as pd
from omegaconf import OmegaConf

from trunkline.errors import InputError, in_one_line
from trunkline.figures.payload import payload_figure
from trunkline.figures.style import save_figure
from trunkline.hybrid.friction import IMPRATIO, SOLIMP, SOLREF
from trunkline.hybrid.payload import Cell, Outcome, PayloadSettings, cells, chart_rows
from trunkline.pipeline.config import validated
from trunkline.pipeline.inputs import read_spec
from trunkline.pipeline.results import recorded
from trunkline.progress import progress
from trunkline.settings import read_yaml

MODEL = Path("artifacts/identify_control/arm.xml")
SETTINGS = Path("studies/payload.yaml")
TABLE, QUICK_TABLE = Path("docs/results/payload.csv"), Path("docs/results/payload_quick.csv")
QUICK = {
    "grids": [{"supports": ["hanging"], "shapes": ["cylinder", "box", "sphere", "toy"], "diameters": [0.03, 0.06],
               "frictions": [0.45], "pulls": ["dorsal"], "shortenings": [0.2]}],
    "masses": [0.1, 0.3, 0.6], "wraps": [0.6], "placements": 1,
}  # fmt: skip
KEYS, FOUND = ([field.name for field in fields(kind)] for kind in (Cell, Outcome))


def read_settings(quick: bool) -> PayloadSettings:
    values = OmegaConf.to_container(read_yaml(SETTINGS))
    assert isinstance(values, dict)
    return validated(PayloadSettings, values | (QUICK if quick else {}), SETTINGS)


def read_table(path: Path, digest: str) -> pd.DataFrame:
    """The rows so far. Raises InputError if they are of other settings."""
    if not path.is_file():
        return pd.DataFrame()
    table = pd.read_csv(path)
    if (found := set(table["settings"])) - {digest}:
        raise InputError(
            f"{path}: found rows of other settings or another arm ({', '.join(sorted(found))}), expected "
            f"{digest}; --anew begins another table"
        )
    return table


@in_one_line
def main() -> int:
    parser = argparse.ArgumentParser(description=__doc__)
    parser.add_argument("--quick", action="store_true")
    parser.add_argument("--anew", action="store_true")
    parser.add_argument("--cells", type=int, default=sys.maxsize)
    options = parser.parse_args()
    chart, arm = read_settings(options.quick), read_spec(MODEL)
    told = json.dumps(
        {
            **{key: value for key, value in asdict(chart).items() if key != "grids"},  # of those rows tell
            "contacts": [IMPRATIO, SOLREF, SOLIMP],
            "arm": hashlib.sha256(MODEL.read_bytes()).hexdigest(),
        },
        sort_keys=True,
    )
    digest, path = hashlib.sha256(told.encode()).hexdigest()[:12], QUICK_TABLE if options.quick else TABLE
    if options.anew:
        path.unlink(missing_ok=True)
    table = read_table(path, digest)
    done = {Cell(*row) for row in table[KEYS].itertuples(index=False)} if len(table) else set()
    begun, grasps, rows = time.process_time(), 0, chart_rows(arm, chart, done)
    with progress(min(len(cells(chart)) - len(done), options.cells), "payload", "cells") as bar:
        for _, (cell, outcome) in zip(range(options.cells), rows, strict=False):
            row = pd.DataFrame([[*astuple(cell), *astuple(outcome), digest]],
                               columns=[*KEYS, *FOUND, "settings"])  # fmt: skip
            table, grasps = pd.concat([table, row]), grasps + outcome.grasps
            path.parent.mkdir(parents=True, exist_ok=True)
            table.to_csv(path, index=False, float_format="%.6g")
            bar.update(1, last=f"{cell.support} {cell.shape} {1e3 * cell.diameter:.0f} mm: {1e3 * outcome.mass:.0f} g")
    if len(table):
        save_figure(payload_figure(table), path.with_suffix(".png"))
        with recorded("payload", keep=not options.quick and len(table) == len(cells(chart))):
            print(table[[*KEYS, *FOUND]].to_string(index=False))
    if grasps:
        print(f"{grasps} grasps, {(time.process_time() - begun) / grasps:.2f} s of processor each")
    return 0


if __name__ == "__main__":
    sys.exit(main())
